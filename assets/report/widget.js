// The view of a notebook: the viewer of the report in a frame, so that neither sees the style and names of the other.

/** Whether the text of an element is light, as on a dark page. */
function isDark(el) {
    const [r, g, b] = getComputedStyle(el)
        .color.match(/[\d.]+/g)
        .map(Number);
    return r + g + b > 384;
}

/** What a viewer cannot change: another lattice, or other fields, need another one. */
function kindOf(text) {
    const { line, cells, meshes } = JSON.parse(text);
    return JSON.stringify([line, cells, meshes.map(({ lines, arrays }) => [lines, arrays.map(({ name }) => name)])]);
}

function render({ model, el }) {
    const frame = document.createElement("iframe"),
        note = document.createElement("p");
    frame.title = "Viewer of the mesh";
    frame.style.cssText = "width: 100%; height: 600px; border: 0";
    note.textContent = "There is nothing to show yet.";
    el.append(note, frame);
    let ready = false,
        kind = null;
    const show = () => {
        const text = model.get("data");
        note.hidden = text !== "";
        frame.hidden = text === "";
        if (!text) return;
        const own = kindOf(text);
        if (own !== kind) {
            // the page says that it is ready, and then gets its data
            [ready, kind] = [false, own];
            frame.srcdoc = model.get("page");
        } else if (ready) frame.contentWindow.postMessage({ driftmesh: text, dark: isDark(el) }, "*");
    };
    const listen = ({ source, data }) => {
        if (source !== frame.contentWindow) return;
        if (data.driftmeshReady) {
            ready = true;
            show();
        }
        if (data.driftmeshHeight) frame.style.height = `${Math.ceil(data.driftmeshHeight)}px`;
    };
    addEventListener("message", listen);
    model.on("change:data", show);
    show();
    return () => {
        removeEventListener("message", listen);
        model.off("change:data", show);
    };
}

export default { render };
