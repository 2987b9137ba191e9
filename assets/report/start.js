// The start of the viewer that the page has, if it has one.

(async () => {
    const source = document.getElementById("viewer-data");
    if (!source) return;
    document.getElementById("viewer").classList.add("live");
    const data = JSON.parse(source.textContent);
    const arrays = await Promise.all(data.meshes.map(async (mesh) => unpack(mesh, await inflate(mesh.data))));
    window.viewer = new (data.line ? LineViewer : MeshViewer)(data, arrays);
})().catch((error) => {
    document.querySelector(".stages").textContent = `The viewer does not work in this browser: ${error.message}`;
});
