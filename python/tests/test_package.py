"""What the package says of itself: types, docs, examples of the README, notebooks."""

import ast
import doctest
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import readme

import driftmesh
from driftmesh import errors

ROOT = Path(__file__).resolve().parents[2]
CACHE = ROOT / "target/mypy"
MODULES = [
    "differences",
    "errors",
    "generators",
    "laplacian",
    "line",
    "mesh",
    "methods",
    "monitors",
    "poisson",
    "quality",
    "remap",
    "study",
]


def tool(*arguments, **settings):
    done = subprocess.run([sys.executable, "-m", *arguments], capture_output=True, text=True, **settings)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_stubs_are_those_of_the_module():
    native = driftmesh._driftmesh
    stub = ast.parse(Path(native.__file__).with_name("_driftmesh.pyi").read_text("utf-8"))

    def parameters(function):
        return [argument.arg for argument in function.args.args if argument.arg not in ("self", "cls")]

    told = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert set(told) | {"VERSION"} == set(native.__all__) == {name for name in vars(native) if not name.startswith("_")}
    for name, node in told.items():
        pairs = [(node, getattr(native, name))]
        if isinstance(node, ast.ClassDef):
            methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
            assert {each.name for each in methods} - {"__new__"} == {
                m for m in vars(pairs[0][1]) if not m.startswith("_")
            }
            pairs = [
                (each, pairs[0][1] if each.name == "__new__" else getattr(pairs[0][1], each.name)) for each in methods
            ]
        for given, function in pairs:
            names = [name for name in inspect.signature(function).parameters if name != "self"]
            assert parameters(given) == names, name


def test_package_and_examples_pass_mypy_strict(tmp_path):
    (tmp_path / "readme_examples.py").write_text("\n".join(readme.examples()))
    strict = ("mypy", "--strict", "--config-file=", f"--cache-dir={CACHE}")
    tool(*strict, "-p", "driftmesh", cwd=tmp_path)
    tool(*strict, "readme_examples.py", cwd=tmp_path)


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, tried = doctest.testmod(importlib.import_module(f"driftmesh.{name}"))
    assert failed == 0 < tried


def test_every_public_function_has_an_example_and_says_what_it_raises():
    for name in driftmesh.__all__:
        value = getattr(driftmesh, name)
        if name.startswith("_"):
            continue
        doc = inspect.getdoc(value) or ""
        assert ">>> " in doc or "for an example" in doc, name
        if inspect.isfunction(value):
            assert "Raises:" in doc and "Args:" in doc, name


def test_the_examples_of_the_readme_run(tmp_path):
    done = subprocess.run(
        [sys.executable, readme.__file__], capture_output=True, text=True, env=os.environ | {"MPLBACKEND": "Agg"}
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("example ") == len(readme.examples()) >= 4 and "left out" not in done.stdout


def test_every_failure_has_its_exception():
    page = (ROOT / "docs/errors.md").read_text("utf-8")
    names = re.findall(r"^- `([a-z-]+)`: ", page, re.MULTILINE)
    assert len(names) > 20
    for name in names:
        error = getattr(errors, "".join(word.capitalize() for word in name.split("-")))
        assert issubclass(error, driftmesh.MeshError) and error.__doc__


def test_importing_leaves_the_heavy_ones_alone():
    heavy = ("matplotlib", "scipy", "tqdm", "meshio", "pyvista")
    code = f"import driftmesh, sys; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def notebook_code(name):
    import nbformat

    notebook = nbformat.read(ROOT / f"python/notebooks/{name}.ipynb", as_version=4)
    return "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code")


@pytest.mark.parametrize("name", ["own-solver", "schwarz", "solve-bvp"])
def test_notebooks_run(name, tmp_path):
    import nbformat
    from nbclient import NotebookClient

    ast.parse(notebook_code(name))
    notebook = nbformat.read(ROOT / f"python/notebooks/{name}.ipynb", as_version=4)
    NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
