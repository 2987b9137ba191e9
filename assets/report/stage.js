// A canvas with what happens on it.

/** A colour map of the data as 256 pixels, each an opaque ABGR word. */
function colourMap({ name, colours }) {
    const pixel = (_, k) => {
        const c = parseInt(colours.slice(6 * k, 6 * k + 6), 16);
        return -16777216 | ((c & 255) << 16) | (c & 0xff00) | (c >> 16);
    };
    return { name, colours: Int32Array.from({ length: 256 }, pixel) };
}

/** The canvas of a mesh, put on the page and connected to pointer, wheel and keys. */
function stageOf(viewer, mesh, m) {
    const [figure, caption, canvas] = ["figure", "figcaption", "canvas"].map((tag) => document.createElement(tag));
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-roledescription", "mesh");
    figure.append(caption, canvas);
    document.querySelector(".stages").append(figure);
    const stage = { mesh, m, caption, canvas, context: canvas.getContext("2d"), values: null };
    listenToPointers(viewer, stage);
    listenToWheel(viewer, stage);
    canvas.addEventListener("keydown", (event) => viewer.key(stage, event));
    return stage;
}

/** Where an event is on a canvas, in its pixels. */
function placeOn(canvas, event) {
    const box = canvas.getBoundingClientRect();
    return [
        ((event.clientX - box.left) * canvas.width) / box.width,
        ((event.clientY - box.top) * canvas.height) / box.height,
    ];
}

/** One pointer reads or drags, two of them zoom around the one that rests. */
function listenToPointers(viewer, stage) {
    const { canvas } = stage,
        fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        fingers.set(event.pointerId, placeOn(canvas, event));
    });
    for (const end of ["pointerup", "pointercancel"])
        canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
        const before = fingers.get(event.pointerId),
            now = placeOn(canvas, event);
        if (!before) return viewer.point(stage, now);
        const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
        if (other) {
            const distance = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
            viewer.scale(distance(now) / Math.max(1, distance(before)), viewer.physical(stage, other));
        } else {
            viewer.pan(stage, now[0] - before[0], now[1] - before[1]);
        }
        fingers.set(event.pointerId, now);
    });
}

/** The wheel zooms around the pointer. */
function listenToWheel(viewer, stage) {
    const zoom = (event) => {
        event.preventDefault();
        const turned = event.deltaY * (event.deltaMode ? 30 : 1); // lines are some 30 pixels
        viewer.scale(Math.exp(-0.0015 * turned), viewer.physical(stage, placeOn(stage.canvas, event)));
    };
    stage.canvas.addEventListener("wheel", zoom, { passive: false });
}
