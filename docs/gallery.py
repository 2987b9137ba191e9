"""The gallery: a page of studies with their pictures and reports, in the folder given.

Runs each study of `docs/studies.toml` with the program given; `make docs` calls this.
"""

import html
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>driftmesh gallery</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ margin: 0 auto; max-width: 1240px; padding: 1.2rem; font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif;
  background: light-dark(#fff, #16181b); color: light-dark(#1c1e21, #e6e6e3); }}
main {{ display: grid; gap: 1.4rem; grid-template-columns: repeat(auto-fill, minmax(min(100%, 340px), 1fr)); }}
article {{ border: 1px solid light-dark(#d5d8dc, #3b4046); border-radius: 10px; overflow: hidden; }}
img {{ display: block; width: 100%; aspect-ratio: 10 / 9; object-fit: contain; background: #fff; }}
h2 {{ margin: .8rem 1rem 0; font-size: 1.15rem; }}
p {{ margin: .3rem 1rem .9rem; }}
a {{ color: light-dark(#0063a3, #63b3ed); }}
</style>
</head>
<body>
<h1>driftmesh gallery</h1>
<p style="margin-left: 0">Each picture is the outcome of a study in <code>studies/</code>;
its report has the viewer, the figures and the settings.</p>
<main>
{articles}
</main>
</body>
</html>
"""
ARTICLE = """<article>
<a href="{name}/report.html" aria-label="Report of {name}"><picture>
{moving}<img src="{name}/mesh.png" alt="{title}: the mesh over the solution" loading="lazy"></picture></a>
<h2>{title}</h2>
<p>{words} <a href="{name}/report.html">Report</a> of <code>{name}</code>; the run took {seconds:.2g} s.</p>
</article>"""
MOVING = '<source srcset="{name}/animation.gif" media="(prefers-reduced-motion: no-preference)">\n'


def studies():
    """The studies of the gallery, in order."""
    groups = tomllib.loads((ROOT / "docs/studies.toml").read_text("utf-8"))["group"]
    return [study for group in groups for study in group["study"]]


def as_html(text):
    """A sentence with names in backquotes."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", html.escape(text.replace("\n", " "), quote=False))


def article(program, study, out):
    """Runs a study, and says what its picture and its report show."""
    name = study["name"]
    command = [program, "run", ROOT / f"studies/{name}.toml", "--quiet", "--out", out / name]
    status = subprocess.run([*command, "--set", "output.animation=true"], stderr=subprocess.PIPE, text=True)
    if status.returncode != study.get("ends", 0):
        sys.exit(f"error: {name} ended with status {status.returncode}:\n{status.stderr}")
    seconds = json.loads((out / name / "summary.json").read_text())["seconds"]["wall"]
    moving = MOVING.format(name=name) if (out / name / "animation.gif").exists() else ""
    words, title = as_html(study["teaches"]), html.escape(study["title"])
    return ARTICLE.format(name=name, title=title, moving=moving, words=words, seconds=seconds)


def main():
    program, out = sys.argv[1], Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    articles = "\n".join(article(program, study, out) for study in studies())
    (out / "index.html").write_text(PAGE.format(articles=articles))
    print(f"gallery  {out / 'index.html'}")


if __name__ == "__main__":
    main()
