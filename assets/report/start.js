// The start of the viewer that the page has, if it has one.

/** Shows data in the viewer of the page; one that is there takes them as more frames of its meshes. */
async function showData(data) {
    const arrays = await Promise.all(data.meshes.map(async (mesh) => unpack(mesh, await inflate(mesh.data))));
    if (window.viewer) return window.viewer.extend(data, arrays);
    document.getElementById("viewer").classList.add("live");
    window.viewer = new (data.line ? LineViewer : MeshViewer)(data, arrays);
}

/** Says in place of a viewer why there is none. */
function cannotShow(error) {
    document.querySelector(".stages").textContent = `The viewer does not work in this browser: ${error.message}`;
}

const source = document.getElementById("viewer-data");
if (source) showData(JSON.parse(source.textContent)).catch(cannotShow);
