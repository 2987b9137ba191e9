"""The gallery, as `make docs` makes it."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent


def test_every_picture_and_report_of_the_gallery_is_there(tmp_path):
    subprocess.run([sys.executable, ROOT / "docs/gallery.py", ROOT / "target/release/driftmesh", tmp_path], check=True)
    page = (tmp_path / "index.html").read_text()
    named = re.findall(r'(?:src|srcset|href)="([^"]+/[^"]+)"', page)
    groups = tomllib.loads((ROOT / "docs/studies.toml").read_text("utf-8"))["group"]
    studies = [study["name"] for group in groups for study in group["study"]]
    assert len(studies) == len(set(studies)) >= 20
    assert sum(name.endswith("report.html") for name in named) == 2 * len(studies)
    assert sum(name.endswith("mesh.png") for name in named) == len(studies)
    assert sum(name.endswith(".gif") for name in named) > len(studies) / 2
    assert [name for name in named if not (tmp_path / name).is_file()] == []
