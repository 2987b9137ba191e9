"""The gallery, as `make docs` makes it."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent


def test_every_picture_and_report_of_the_gallery_is_there(tmp_path):
    subprocess.run([sys.executable, ROOT / "docs/gallery.py", ROOT / "target/release/driftmesh", tmp_path], check=True)
    page = (tmp_path / "index.html").read_text()
    named = re.findall(r'(?:src|srcset|href)="([^"]+/[^"]+)"', page)
    assert (
        sum(name.endswith("report.html") for name in named) == 2 * 9
        and sum(name.endswith(".gif") for name in named) == 9
    )
    assert [name for name in named if not (tmp_path / name).is_file()] == []
