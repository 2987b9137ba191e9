"""Layers on a line, stationary and travelling: largest errors and CPU seconds of driftmesh, of MMPDE6 in SciPy by the
method of lines (mmpde6 below) and, where the package bacoli_py is installed, of BACOLI, which is error controlled and
of high order.

    python benches/lines.py [path of the driftmesh program]

CPU is that of the whole process for driftmesh, start and output included, and that of the call for the others; what
driftmesh spends on mesh, density and equation alone is told, too. The tolerance in time of MMPDE6 is the loosest one
with which its error is within a tenth of its best. BACOLI may have as many intervals as there are cells (kcol = 3, so
three times as many unknowns), or a third of that, with the smallest tolerance for which these suffice; its callbacks
are functions in Python.

The last lines are 1000 steps of Burgers' equation on 1000 cells, on one thread.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

ROOT = Path(__file__).parents[1]
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/driftmesh")


class Layer:
    """u_t + u u_x = ν u_xx with u = c − a tanh(a (x − x₀ − c t)/2ν) on [0, 1] from t = 0."""

    def __init__(self, name, viscosity, a, c, x0, end):
        self.name, self.viscosity, self.a, self.c, self.x0, self.end = name, viscosity, a, c, x0, end

    def exact(self, t, x):
        return self.c - self.a * np.tanh(self.a * (x - self.x0 - self.c * t) / (2 * self.viscosity))

    def formula(self, t):
        return f"{self.c!r} - {self.a!r}*tanh({self.a!r}*(x - {self.x0!r} - {self.c!r}*{t})/{2 * self.viscosity!r})"


LAYERS = [
    Layer("stationary layer", 5e-3, 1.0, 0.0, 0.5, 1.0),
    Layer("travelling layer", 1e-3, 0.5, 0.5, 0.2, 1.0),
]


def mmpde6(layer, n, tolerance, tau=1e-2):
    """Nodes and values at the end: x'_ξξ = −(M x_ξ)_ξ/τ with a smoothed arc length M, central differences for u."""
    nu, start = layer.viscosity, np.linspace(0, 1, n + 1)
    band = np.array([np.ones(n - 1), np.full(n - 1, -2.0), np.ones(n - 1)])

    def f(t, w):
        x, u = np.r_[0, w[: n - 1], 1], np.empty(n + 1)
        u[0], u[n], u[1:-1] = layer.exact(t, 0.0), layer.exact(t, 1.0), w[n - 1 :]
        h, slope = np.diff(x), np.diff(u) / np.diff(x)
        monitor = np.sqrt(1 + slope**2)
        for _ in range(4):
            monitor = np.convolve(np.r_[monitor[0], monitor, monitor[-1]], [0.25, 0.5, 0.25], "valid")
        dx = solve_banded((1, 1), band, -np.diff(monitor * h) / tau)
        wide = h[1:] + h[:-1]
        du = nu * 2 * np.diff(slope) / wide - np.diff(u**2 / 2)[1:] / wide - np.diff(u**2 / 2)[:-1] / wide
        return np.r_[dx, du + dx * (u[2:] - u[:-2]) / wide]

    x = adapted(layer, start)
    run = solve_ivp(f, (0, layer.end), np.r_[x[1:-1], layer.exact(0, x[1:-1])], "BDF", rtol=tolerance, atol=tolerance)
    w, ends = run.y[:, -1], [layer.exact(layer.end, x) for x in (0.0, 1.0)]
    return np.r_[0, w[: n - 1], 1], np.r_[ends[0], w[n - 1 :], ends[1]], run.nfev


def adapted(layer, x):
    """Nodes of equal smoothed arc length at the start."""
    for _ in range(50):
        monitor = np.sqrt(1 + (np.diff(layer.exact(0, x)) / np.diff(x)) ** 2)
        for _ in range(4):
            monitor = np.convolve(np.r_[monitor[0], monitor, monitor[-1]], [0.25, 0.5, 0.25], "valid")
        whole = np.r_[0, np.cumsum(monitor * np.diff(x))]
        x = 0.5 * x + 0.5 * np.interp(np.linspace(0, whole[-1], len(x)), whole, x)
    return x


def of_scipy(layer, n):
    """Largest error at the nodes, CPU seconds and right-hand sides."""
    tried = []
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6):
        clock = time.process_time()
        x, u, calls = mmpde6(layer, n, tolerance)
        tried.append((np.abs(u - layer.exact(layer.end, x)).max(), time.process_time() - clock, calls))
    best = min(error for error, *_ in tried)
    return next(one for one in tried if one[0] <= 1.1 * best)


def of_bacoli(layer, intervals):
    """Smallest largest error with at most so many intervals, on 2001 equal places, CPU seconds and tolerance."""
    np.int = int  # bacoli_py is older than NumPy 1.24
    import bacoli_py

    nu = layer.viscosity

    def f(t, x, u, ux, uxx, fval):
        fval[0] = nu * uxx[0] - u[0] * ux[0]
        return fval

    def derivf(t, x, u, ux, uxx, dfdu, dfdux, dfduxx):
        dfdu[0, 0], dfdux[0, 0], dfduxx[0, 0] = -ux[0], -u[0], nu
        return dfdu, dfdux, dfduxx

    def left(t, u, ux, value):
        value[0] = u[0] - layer.exact(t, 0.0)
        return value

    def right(t, u, ux, value):
        value[0] = u[0] - layer.exact(t, 1.0)
        return value

    def start(x, u):
        u[0] = layer.exact(0.0, x)
        return u

    places, best = np.linspace(0, 1, 2001), None
    problem = bacoli_py.ProblemDefinition(1, f=f, bndxa=left, bndxb=right, uinit=start, derivf=derivf)
    for tolerance in 10.0 ** -np.arange(1, 10):
        solver = bacoli_py.Solver(nint_max=intervals, kcol=3)
        clock = time.process_time()
        try:
            mesh = np.linspace(0, 1, max(intervals // 2, 2))
            found = solver.solve(problem, 0.0, mesh, [layer.end], places, tolerance, tolerance, dirichlet=True)
        except Exception:  # more intervals are needed
            break
        seconds = time.process_time() - clock
        error = np.abs(found.u[0, -1] - layer.exact(layer.end, places)).max()
        if best is None or error < best[0]:
            best = (error, seconds, tolerance)
    return best


def run(text, *options):
    """The summary of a study, its nodes and values, and the CPU seconds of the process."""
    with tempfile.TemporaryDirectory() as directory:
        study = Path(directory) / "line.toml"
        study.write_text(f'[study]\nname = "line"\nkind = "moving-mesh"\n{text}\n[output]\nreport = false\n')
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [PROGRAM, "run", str(study), "--out", f"{directory}/run", "--quiet", *options]
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        summary = json.loads((Path(directory) / "run/summary.json").read_text())
        arrays = dict(np.load(Path(directory) / "run/final.npz"))
    return summary, arrays, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_driftmesh(layer, n):
    """Largest error at the nodes, CPU seconds and Newton iterations."""
    summary, arrays, seconds = run(f"""
[grid]
cells = [{n}]
[time]
start = 0.0
end = {layer.end}
[pde]
kind = "burgers"
viscosity = {layer.viscosity}
initial = "{layer.formula(0.0)}"
boundary = "{layer.formula("t")}"
""")
    error = np.abs(arrays["u"] - layer.exact(layer.end, arrays["x"])).max()
    return error, seconds, summary["work"]["newton_iterations"], computing(summary)


def computing(summary):
    """Seconds of a run without its start and what it writes."""
    return sum(summary["seconds"][part] for part in ("monitor", "interface", "mesh", "pde"))


def main():
    for layer in LAYERS:
        for n in (20, 40, 80):
            ours, theirs = of_driftmesh(layer, n), of_scipy(layer, n)
            print(f"{layer.name}, {n} cells, ν = {layer.viscosity}")
            print(
                f"  driftmesh  error {ours[0]:.1e}, {ours[1]:.3f} s, of these {ours[3]:.4f} s computing, "
                f"{ours[2]} Newton iterations"
            )
            print(
                f"  mmpde6     error {theirs[0]:.1e}, {theirs[1]:.3f} s, {theirs[2]} right-hand sides: "
                f"{theirs[0] / ours[0]:.1f} times the error, {theirs[1] / ours[1]:.1f} times the CPU, "
                f"{theirs[1] / ours[3]:.0f} times that of computing"
            )
            for intervals in (n // 3, n):
                try:
                    found = of_bacoli(layer, intervals)
                except ImportError:
                    continue
                if found is None:
                    print(f"  bacoli     {intervals} intervals do not suffice for any tolerance")
                    continue
                print(
                    f"  bacoli     {intervals} intervals, tolerance {found[2]:.0e}: error {found[0]:.1e}, "
                    f"{found[1]:.3f} s: {found[0] / ours[0]:.2f} times the error, "
                    f"{found[1] / ours[1]:.1f} times the CPU, "
                    f"{found[1] / ours[3]:.1f} times that of computing"
                )
    steps = ("[grid]\ncells = [1000]\n[time]\nstart = 0.25\nend = 1.25\nstep = 1e-3\n"
             '[pde]\nkind = "burgers"\nviscosity = 1e-3\n')
    seconds = [run(steps, "--threads", "1") for _ in range(5)]
    best = min(seconds, key=lambda found: found[2])
    parts = ", ".join(f"{part} {best[0]['seconds'][part]:.3f}" for part in ("monitor", "mesh", "pde", "output"))
    print(f"{best[0]['work']['steps']} steps on 1000 cells: {best[2]:.3f} s of one core ({parts})")


if __name__ == "__main__":
    main()
