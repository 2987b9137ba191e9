"""Kills runs at random moments and goes on, until each has ended: its results must have the bits of an undisturbed run.

    python tests/python/kills.py [KILLS] [SEED]

prints for each study how many kills it took, how many of these left a checkpoint, and how many runs they were spread
over.
"""

import csv
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/driftmesh"
SHORT = ["output.report=false", "output.frames.every=4", "output.checkpoint.steps=3"]
TIMES = ["time.end=0.6", "time.report=[0.4,0.6]"]
WALKS = 'mesh.generator={kind="stochastic",subdomains=[4,4],seed=7}'
STUDIES = {
    "case B, automatic steps": ("burgers", ["grid.cells=[40,40]", "pde.viscosity=0.005", *TIMES]),
    "case B, residual walks, automatic steps": (
        "burgers",
        ["grid.cells=[40,40]", "pde.viscosity=0.005", WALKS, *TIMES],
    ),
    "case B, residual walks, compared": ("burgers-b-stochastic", ["time.end=0.4", "time.report=[0.3,0.4]"]),
    "Stefan, explicit": ("stefan-slides", ["time.end=0.5", "time.report=[0.25,0.5]"]),
    "Stefan, implicit, automatic steps": (
        "stefan-slides",
        ["time.end=0.5", "time.report=[0.5]", "front.stepping=implicit", "time.step=auto"],
    ),
}


def command(name, settings, out):
    sets = [part for setting in [*settings, *SHORT] for part in ("--set", setting)]
    return [PROGRAM, "run", ROOT / f"studies/{name}.toml", "--quiet", "--resume", "--out", out, *sets]


def untimed(path):
    """What a file holds, but for the seconds that a run took."""
    if path.name == "history.csv":
        with path.open(newline="") as rows:
            return [{name: entry for name, entry in row.items() if name != "seconds"} for row in csv.DictReader(rows)]
    if path.name == "summary.json":
        return {key: value for key, value in json.loads(path.read_text()).items() if key != "seconds"}
    # the last state has the seconds, too
    return None if path.name == "final.state" else path.read_bytes()


def left(directory):
    return {str(path.relative_to(directory)): path for path in directory.rglob("*") if path.is_file()}


def assert_same(whole, cut):
    ours, theirs = left(whole), left(cut)
    assert ours.keys() == theirs.keys(), ours.keys() ^ theirs.keys()
    for name in ours:
        assert untimed(ours[name]) == untimed(theirs[name]), f"{name} differs in {cut}"


def killed(words, seconds):
    """Runs a command for some time at most; whether it was killed then."""
    process = subprocess.Popen(words)
    try:
        code = process.wait(seconds)
        assert code == 0, f"exit status {code}"
        return False
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return True


def kill_often(name, settings, kills, chance, place):
    """Kills, those that left a checkpoint, and the runs that they were spread over."""
    whole = place / "whole"
    began = time.monotonic()
    assert not killed(command(name, settings, whole), 600)
    length = time.monotonic() - began
    counts = [0, 0, 0]
    while counts[0] < kills:
        cut = place / f"cut-{counts[2]}"
        while killed(command(name, settings, cut), chance.uniform(0, 0.7 * length)):
            counts[0] += 1
            counts[1] += any(cut.glob("checkpoint.[01]"))
        counts[2] += 1
        assert_same(whole, cut)
    return counts


def main(kills=200, seed=1):
    chance, total = random.Random(seed), [0, 0, 0]
    for title, (name, settings) in STUDIES.items():
        with tempfile.TemporaryDirectory() as place:
            counts = kill_often(name, settings, -(-kills // len(STUDIES)), chance, Path(place))
        print(
            f"{title:42} {counts[0]:4} kills, {counts[1]:4} with a checkpoint, in {counts[2]:3} runs: the same bits",
            flush=True,
        )
        total = [a + b for a, b in zip(total, counts)]
    print(f"{'all':42} {total[0]:4} kills, {total[1]:4} with a checkpoint, in {total[2]:3} runs: the same bits")


if __name__ == "__main__":
    main(*(int(number) for number in sys.argv[1:]))
