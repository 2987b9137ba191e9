"""The scripts in python/examples, on fewer steps and cells."""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
sys.path.insert(0, str(EXAMPLES))


def test_finite_elements_on_a_moving_mesh_beat_a_uniform_one_of_sixteen_times_the_nodes():
    import allen_cahn_scikit_fem as example

    (moving, _), (uniform, _) = example.run(40, True, steps=25), example.run(160, False, steps=25)
    assert moving < 0.5 * uniform and moving < 4e-3, (moving, uniform)
    text = (EXAMPLES / "allen_cahn_scikit_fem.py").read_text().split('"""', 2)[2]
    assert sum(bool(line.strip()) for line in text.splitlines()) <= 60


def test_a_sweep_runs_in_processes(tmp_path):
    import sweep

    errors = sweep.sweep([0.01], [16], tmp_path, processes=2)
    assert errors[0.01, 16, "whole"] < 0.5 * errors[0.01, 16, "fixed"]
    assert {path.name for path in tmp_path.iterdir()} == {"whole-16-0.01", "fixed-16-0.01"}
