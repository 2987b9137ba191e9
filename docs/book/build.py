"""Builds the book from the pages of docs/: `python docs/book/build.py PROGRAM OUT`.

Pages are copied to `target/book` with links that work in a book; three are made: all keys of studies from the schema
that the program prints, the Python package from its source, and the worked studies from `docs/studies.toml`. Sphinx
then builds them, and any warning is an error. `--beside` also looks for what the book links to outside of itself: the
documentation of the library and the gallery, which `make docs` builds first.
"""

import argparse
import html
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import api
import keys
import links

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent))
import gallery  # noqa: E402  beside this directory

ROOT = HERE.parents[1]
STUDIES = """# Worked studies

Every picture is the outcome of a study in `studies/` of the source; behind it is the report of the run, with the moving
mesh to play, its figures and its settings. `driftmesh run studies/NAME.toml` runs one; with an installed package
`driftmesh studies` writes them all into `studies/` first. `make docs` made the runs behind these pictures, and the same
pictures as moving images are [in the gallery](../target/doc/gallery/index.html).

"""
FIGURE = """<figure>
<a href="../gallery/{name}/report.html"><img src="../gallery/{name}/mesh.png" alt="{title}" loading="lazy"></a>
<figcaption><strong>{title}</strong> (<code>{name}</code>). {words}</figcaption>
</figure>"""


def studies():
    """The page of worked studies, in the groups of their table."""
    groups = tomllib.loads((ROOT / "docs/studies.toml").read_text("utf-8"))["group"]
    lines = [STUDIES]
    for group in groups:
        lines += [f"## {group['title']}", "", '<div class="studies">']
        for study in group["study"]:
            title, words = html.escape(study["title"]), gallery.as_html(study["teaches"])
            lines.append(FIGURE.format(name=study["name"], title=title, words=words))
        lines += ["</div>", ""]
    return "\n".join(lines)


def stage(program, source):
    """Writes the pages from which Sphinx builds the book."""
    shutil.rmtree(source, ignore_errors=True)
    (source / "_static").mkdir(parents=True)
    shutil.copy(HERE / "conf.py", source)
    shutil.copy(HERE / "book.css", source / "_static")
    for picture in (ROOT / "docs").glob("*.png"):
        shutil.copy(picture, source)
    pages = {page.name: page for page in (ROOT / "docs").glob("*.md")}
    pages |= {name: ROOT / file for file, name in links.ROOT_PAGES.items()}
    for name, page in pages.items():
        (source / name).write_text(links.rewritten(page.read_text("utf-8"), page, ROOT), "utf-8")
    if "cluster.md" not in pages:  # the chapter on clusters comes by itself
        index = (source / "index.md").read_text("utf-8")
        (source / "index.md").write_text(index.replace("\ncluster\n", "\n"), "utf-8")
    package = api.page(ROOT / "python/driftmesh")
    made = {"keys.md": keys.page(program), "python-api.md": package, "studies.md": studies()}
    for name, text in made.items():
        (source / name).write_text(links.rewritten(text, ROOT / "docs" / name, ROOT), "utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--source", type=Path, default=ROOT / "target/book")
    parser.add_argument("--beside", action="store_true")
    given = parser.parse_args()
    stage(given.program.resolve(), given.source)
    shutil.rmtree(given.out, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--keep-going", "--builder", "html"]
    subprocess.run([*command, "-d", given.source / ".doctrees", given.source, given.out], check=True)
    wrong = links.external(given.out) + links.broken(given.out, beside=given.beside)
    if wrong:
        raise SystemExit("error: these are loaded from elsewhere, or lead nowhere:\n" + "\n".join(wrong))
    print(f"book     {given.out / 'index.html'}")


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(f"error: {' '.join(map(str, error.cmd[:4]))} … ended with status {error.returncode}")
