"""The book: it builds without a warning and needs no network, and its pages print what they say."""

import contextlib
import io
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/driftmesh"
PAGES = sorted((ROOT / "docs").glob("*.md"))
FENCE = re.compile(r"^([ ]*)```(\w+)\n(.*?)^\1```$", re.DOTALL | re.MULTILINE)


@pytest.mark.skipif(
    "CI" not in os.environ and any(find_spec(name) is None for name in ("sphinx", "myst_parser", "furo")),
    reason="the tools of docs/requirements.txt are not installed",
)
def test_the_book_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path):
    command = [sys.executable, ROOT / "docs/book/build.py", PROGRAM, tmp_path / "book", "--source", tmp_path / "source"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # the builder looks itself; here only that it does
    page = (tmp_path / "book/sdd.html").read_text("utf-8")
    assert "<math " in page and not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?:https?:)?//", page)
    assert len(list((tmp_path / "book").glob("*.html"))) > 35
    keys = (tmp_path / "book/keys.html").read_text("utf-8")
    assert all(key in keys for key in ("viscosity", "latent_heat", "overlap_cells", "relaxation"))


def test_a_link_to_a_page_that_is_not_there_is_an_error(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs/book"))
    import links

    with pytest.raises(SystemExit, match="nowhere.md"):
        links.rewritten("[x](nowhere.md)", ROOT / "docs/study.md", ROOT)
    text = "[a](../ARCHITECTURE.md#b) [c](study.md) "
    text += "[d](../target/doc/driftmesh/index.html) [e](../target/doc/book/keys.html)"
    expected = '[a](architecture.md#b) [c](study.md) <a href="../driftmesh/index.html">d</a> [e](keys.md)'
    assert links.rewritten(text, ROOT / "docs/study.md", ROOT) == expected
    (tmp_path / "index.html").write_text('<a href="x.html#y"></a><a href="#z"></a><script src="//cdn/a.js"></script>')
    (tmp_path / "x.html").write_text('<p id="y"></p><a href="lost.html"></a>')
    assert links.broken(tmp_path) == ["index.html: #z", "x.html: lost.html"]
    assert links.external(tmp_path) == ["index.html: //cdn/a.js"]


def fences(page):
    """Language and text of the blocks of code of a page."""
    return [(m[2], re.sub(f"^{m[1]}", "", m[3], flags=re.MULTILINE)) for m in FENCE.finditer(page.read_text("utf-8"))]


def same(expected, printed):
    """Whether a line is what was printed, `…` being anything."""
    pattern = ".*".join(re.escape(part) for part in re.sub(r"\s+", " ", expected.strip()).split("…"))
    return re.fullmatch(pattern, re.sub(r"\s+", " ", printed.strip())) is not None


CONSOLE = [page for page in PAGES if any(language == "console" for language, _ in fences(page))]


@pytest.mark.parametrize("page", CONSOLE, ids=lambda page: page.stem)
def test_commands_print_what_stands_below_them(page, tmp_path):
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    for language, text in fences(page):
        if language == "toml" and (name := re.match(r"# (\S+\.toml)\n", text)):
            (tmp_path / name[1]).write_text(text)
        if language != "console":
            continue
        for block in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
            command, *lines = block.replace("→\n    ", "").splitlines()
            words = command.split()
            assert words[0] == "driftmesh", command
            done = subprocess.run([PROGRAM, *words[1:], "--threads", "2"], cwd=tmp_path, capture_output=True, text=True)
            printed = (done.stdout + done.stderr).splitlines()
            lost = [line for line in lines if line.strip() and not any(same(line, out) for out in printed)]
            assert not lost, f"{command}\nprints no such lines as {lost} but\n" + "\n".join(printed)


EXAMPLES = [page for page in PAGES if re.search(r"```python\n.*?```\n\n```text\n", page.read_text("utf-8"), re.DOTALL)]


@pytest.mark.parametrize("page", EXAMPLES, ids=lambda page: page.stem)
def test_examples_print_what_stands_below_them(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, printed = {"__name__": "example"}, ""
    for language, text in fences(page):
        if language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(text, str(page), "exec"), names)
            printed = out.getvalue()
        elif language == "text" and printed:
            assert printed.strip() == text.strip()
            printed = ""


def test_the_trait_of_the_page_is_the_one_that_a_test_compiles():
    blocks = [text for language, text in fences(ROOT / "docs/own-equation.md") if language == "rust"]
    assert blocks and all(text in (ROOT / "tests/coupling.rs").read_text("utf-8") for text in blocks)


def test_the_readme_prints_what_five_minutes_prints():
    readme = (ROOT / "README.md").read_text("utf-8")
    block = readme.partition("of the run\ndirectory:\n\n")[2].partition("\n\n")[0]
    lines = [line.strip() for line in block.splitlines()]
    page = (ROOT / "docs/five-minutes.md").read_text("utf-8")
    assert len(lines) > 8 and [line for line in lines if line not in page] == []


def test_the_tests_named_for_faults_are_there():
    """`file::function` in the table of faults."""
    named = re.findall(r"`(\w+)::(\w+)`", (ROOT / "docs/faults.md").read_text("utf-8"))
    places = [ROOT / "tests", ROOT / "python/tests", ROOT / "tests/python"]
    texts = {}
    for path in (path for place in places for path in place.glob("*.[rp][sy]")):
        texts[path.stem] = texts.get(path.stem, "") + path.read_text("utf-8")
    assert len(named) > 30
    assert [name for file, name in named if not re.search(rf"\b(fn|def) {name}\b", texts.get(file, ""))] == []
