"""`driftmesh schema` against the studies and the mistakes that it is there to show."""

import json
import subprocess
import tomllib
from pathlib import Path

import jsonschema
import pytest

ROOT = Path(__file__).parents[2]
STUDIES = sorted((ROOT / "studies").glob("*.toml"))


@pytest.fixture(scope="module")
def validator():
    text = subprocess.run([ROOT / "target/release/driftmesh", "schema"], capture_output=True, check=True).stdout
    schema = json.loads(text)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_study_is_valid(validator, path):
    study = tomllib.loads(path.read_text("utf-8"))
    assert [error.message for error in validator.iter_errors(study)] == []
    # as the program writes it, too
    resolved = subprocess.run(
        [ROOT / "target/release/driftmesh", "check", path], capture_output=True, check=True, text=True
    )
    assert [error.message for error in validator.iter_errors(tomllib.loads(resolved.stdout))] == []


@pytest.mark.parametrize(
    "key, value",
    [
        ("study.kind", "moving"),
        ("grid.cels", [4, 4]),
        ("grid.cells", [4, 4, 4]),
        ("grid.cells", [4.5, 4]),
        ("pde.viscosity", "thin"),
        ("pde.kind", "burger"),
        ("mesh.generator", {"kind": "stochastic", "subdomains": [2, 2], "seeds": 1}),
        ("mesh.relaxation", {"step": 3}),
        ("time.step", "automatic"),
        ("monitor", {"kind": "arclength", "strength": {"relatives": 3.0}}),
    ],
)
def test_mistakes_are_seen(validator, key, value):
    study = tomllib.loads((ROOT / "studies/burgers.toml").read_text("utf-8"))
    *tables, last = key.split(".")
    at = study
    for table in tables:
        at = at.setdefault(table, {})
    at[last] = value
    assert not validator.is_valid(study)
