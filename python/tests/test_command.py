"""The command that the package installs, and the studies it brings."""

import filecmp
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import driftmesh
import pytest

ROOT = Path(__file__).resolve().parents[2]
STUDY = """
[study]
name = "bump"
kind = "moving-mesh"
[grid]
cells = [8, 8]
[time]
start = 0
end = 0.01
[pde]
kind = "prescribed"
u = "exp(-20*((x - 0.5)^2 + (y - 0.5)^2))"
"""


def program(*words, **settings):
    return subprocess.run([sys.executable, "-m", "driftmesh", *words], capture_output=True, text=True, **settings)


def test_the_command_is_the_program(tmp_path):
    """Its answers, its exit status, and its words to whoever asks wrongly."""
    done = program("--version")
    assert done.returncode == 0 and done.stdout == f"driftmesh {driftmesh.__version__}\n"
    assert "Usage: driftmesh <COMMAND>" in program("--help").stdout
    wrong = program("runn")
    assert wrong.returncode == 2 and "unrecognized subcommand 'runn'" in wrong.stderr
    done = program("run", "-", "--out", "bump", input=STUDY, cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "bump/final.npz").is_file(), done.stderr
    missing = program("run", "nothing.toml", cwd=tmp_path)
    assert missing.returncode == 2 and "nothing.toml" in missing.stderr


def test_an_installed_package_has_the_command():
    try:
        files = importlib.metadata.files("driftmesh") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package is not installed")
    scripts = [Path(file.locate()) for file in files if file.name in ("driftmesh", "driftmesh.exe")]
    done = subprocess.run([scripts[0], "list", "pdes"], capture_output=True, text=True)
    assert done.returncode == 0 and "burgers" in done.stdout


def test_the_package_brings_the_studies(tmp_path):
    """All of them, as they are in the sources; what is there already is kept."""
    written = driftmesh.studies(tmp_path)
    names = {path.name for path in (ROOT / "studies").iterdir() if path.is_file()}
    assert {path.name for path in written} == names
    assert all(filecmp.cmp(path, ROOT / "studies" / path.name, shallow=False) for path in written)
    (tmp_path / "burgers.toml").write_text("mine")
    (tmp_path / "fisher.toml").unlink()
    done = program("studies", str(tmp_path))
    assert done.returncode == 0 and len(done.stdout.splitlines()) == len(names)
    assert (tmp_path / "burgers.toml").read_text() == "mine" and (tmp_path / "fisher.toml").is_file()
    taken = tmp_path / "file"
    taken.touch()
    with pytest.raises(OSError, match="file"):
        driftmesh.studies(taken)
