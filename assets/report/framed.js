// The viewer in a frame of a notebook, which gets its data from there.

/** Light or dark, as the notebook is. */
function setTheme(dark) {
    const root = document.documentElement;
    root.style.colorScheme = dark ? "dark" : "light";
    root.classList.toggle("dark", dark);
    root.classList.toggle("light", !dark);
}

// data that come while others are unpacked wait, and only the newest of them is shown
let waiting = null,
    busy = false;
async function showNewest() {
    if (busy) return;
    busy = true;
    while (waiting) {
        const data = waiting;
        waiting = null;
        await showData(data).catch(cannotShow);
    }
    busy = false;
}

addEventListener("message", ({ source, data }) => {
    if (source !== parent || !data?.driftmesh) return;
    setTheme(data.dark);
    waiting = JSON.parse(data.driftmesh);
    showNewest();
});
new ResizeObserver(() => parent.postMessage({ driftmeshHeight: document.body.scrollHeight }, "*")).observe(
    document.body,
);
parent.postMessage({ driftmeshReady: true }, "*");
