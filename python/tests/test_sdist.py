"""The source distribution holds all that a build reads."""

import re
import subprocess
import sys
import tarfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INCLUDED = re.compile(r'include_(?:str|bytes)!\("([^"]+)"\)')


def test_the_source_distribution_holds_what_a_build_reads(tmp_path):
    command = [sys.executable, "-m", "maturin", "sdist", "--out", tmp_path]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        packed.extractall(tmp_path, filter="data")
    (top,) = (path for path in tmp_path.iterdir() if path.is_dir())
    held = {path.relative_to(top).as_posix() for path in top.rglob("*") if path.is_file()}
    metadata = ["cargo", "metadata", "--offline", "--no-deps", "--format-version", "1"]
    subprocess.run(metadata, cwd=top, check=True, capture_output=True)

    def here(folder, ending):
        return {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob(f"*.{ending}")}

    wanted = {"Cargo.lock", "README.md", ".cargo/config.toml", "python/pyo3.cfg"} | here("studies", "toml")
    for folder in ("src", "cli/src", "reproduce/src", "python/src"):
        wanted |= here(folder, "rs")
    for source in [ROOT / name for name in wanted if name.endswith(".rs") and "/tests/" not in name]:
        files = [(source.parent / name).resolve() for name in INCLUDED.findall(source.read_text("utf-8"))]
        wanted |= {path.relative_to(ROOT).as_posix() for path in files}
    assert "assets/report/page.html" in wanted and len(wanted) > 350
    assert wanted - held == set()
