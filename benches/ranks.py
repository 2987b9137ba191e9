"""Seconds of the mesh step on one rank and on two, by generator: `make ranks` prints the table of docs/cluster.md."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/driftmesh"
CELLS = 256
STEPS = 8
STUDY = f"""
[study]
name = "ranks"
kind = "moving-mesh"
[grid]
cells = [{CELLS}, {CELLS}]
[time]
start = 0.25
end = {0.25 + 1e-3 * STEPS}
step = 1e-3
[pde]
kind = "burgers"
viscosity = 0.005
[mesh]
start = "uniform"
[output]
report = false
"""
GENERATORS = {
    "whole": '{kind="whole"}',
    "stochastic, residual walks": '{kind="stochastic",subdomains=[4,4]}',
    "stochastic, strips": '{kind="stochastic",subdomains=[4,4],estimator={kind="strip"}}',
    "schwarz, overlap 8": '{kind="schwarz",subdomains=[4,4],overlap=8,tolerance=1e-8}',
}
TIMES = 5


def seconds(ranks, generator, place):
    """Milliseconds of the mesh and of everything but output in a step, and what rank 0 received in it."""
    study = place / "study.toml"
    study.write_text(STUDY)
    words = ["mpirun", "-n", str(ranks), PROGRAM, "run", study, "--quiet", "--threads", "1", "--out", place / "out"]
    subprocess.run([*words, "--set", f"mesh.generator={generator}"], check=True, cwd=place)
    summary = json.loads((place / "out/summary.json").read_text())
    spent, got = summary["seconds"], summary["parallel"]
    mesh = spent["interface"] + spent["mesh"]
    per = 1e3 / summary["work"]["steps"]
    return per * mesh, per * (mesh + spent["pde"] + spent["monitor"]), got["messages"], got["bytes"]


print(f"| {CELLS}² cells, ms a step | mesh, 1 rank | 2 ranks | ratio | all, 1 rank | 2 ranks | messages | kB |")
print("|---|---:|---:|---:|---:|---:|---:|---:|")
for name, generator in GENERATORS.items():
    with tempfile.TemporaryDirectory() as place:
        # in turns, the best of several: other programs only add
        runs = [[seconds(ranks, generator, Path(place)) for ranks in (1, 2)] for _ in range(TIMES)]
    one, two = (list(map(min, zip(*(run[k] for run in runs)))) for k in (0, 1))
    print(
        f"| {name} | {one[0]:.0f} | {two[0]:.0f} | {one[0] / two[0]:.2f} | {one[1]:.0f} | {two[1]:.0f} | "
        f"{two[2]:.0f} | {two[3] / 1e3:.0f} |",
        flush=True,
    )
