"""Reference solutions for tests/published_lines.rs, by methods that have nothing to do with driftmesh.

    python tests/published/references.py

writes one table for each problem without an exact solution, `x` and the unknowns at the end of the run, beside this
file, and the times of two blow-ups. It needs NumPy and SciPy, and a minute. Every reference is computed twice, the
second time on half as many cells; the printed difference bounds its error.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import bmat, diags, identity, lil_matrix

HERE = Path(__file__).parent


def neumann(n: int, h: float):
    """u_xx on n + 1 equal nodes with u_x = 0 at both ends, of second order."""
    lower, upper = np.ones(n), np.ones(n)
    lower[-1] = upper[0] = 2
    return diags([lower, -2 * np.ones(n + 1), upper], [-1, 0, 1]).tocsr() / h**2


def flame(n: int):
    """Dwyer and Sanders: a density and a temperature, on n equal cells; BDF."""
    laplace = neumann(n, 1 / n)
    inner = np.ones(n + 1)
    inner[-1] = 0  # the temperature is given there

    def wall(t):
        return 0.2 + min(t / 2e-4, 1.0)

    def f(t, w):
        rho, temperature = w[: n + 1], w[n + 1 :].copy()
        temperature[-1] = wall(t)
        burnt = 3.52e6 * np.exp(-4 / temperature) * rho
        return np.r_[laplace @ rho - burnt, inner * (laplace @ temperature + burnt)]

    def jacobian(t, w):
        rho, temperature = w[: n + 1], w[n + 1 :].copy()
        temperature[-1] = wall(t)
        rate = 3.52e6 * np.exp(-4 / temperature)
        by_rho, by_t = diags(rate), diags(inner * 4 / temperature**2 * rate * rho)
        return bmat(
            [[laplace - by_rho, -by_t], [diags(inner) @ by_rho, diags(inner) @ laplace + by_t]], format="csc"
        )

    w = np.r_[np.ones(n + 1), np.full(n + 1, 0.2)]
    for end in (2e-4, 6e-3):  # the given temperature has a kink
        start = 0.0 if end == 2e-4 else 2e-4
        w = solve_ivp(f, (start, end), w, "BDF", jac=jacobian, rtol=1e-7, atol=1e-9, first_step=1e-8).y[:, -1]
    temperature = w[n + 1 :]
    temperature[-1] = wall(6e-3)
    return np.linspace(0, 1, n + 1), w[: n + 1], temperature


def hot_spot(n: int, end: float = 0.29):
    """Adjerid and Flaherty: a single temperature, on n equal cells; BDF."""
    laplace = neumann(n, 1 / n)
    inner = np.ones(n + 1)
    inner[-1] = 0
    factor = 5 * np.exp(20.0) / 20

    def f(t, u):
        return inner * (laplace @ u + factor * (2 - u) * np.exp(-20 / u))

    def jacobian(t, u):
        rate = np.exp(-20 / u) * factor * ((2 - u) * 20 / u**2 - 1)
        return (diags(inner) @ (laplace + diags(rate))).tocsc()

    u = solve_ivp(f, (0, end), np.ones(n + 1), "BDF", jac=jacobian, rtol=1e-8, atol=1e-10).y[:, -1]
    return np.linspace(0, 1, n + 1), u


def opposite_waves(n: int, end: float = 0.5):
    """Madsen: u goes to the right and v to the left by one cell in each step, exactly; between two halves of the
    reaction u' = v' = −100 u v, which has a solution in closed form."""
    x = np.linspace(-0.5, 0.5, n + 1)
    h = 1 / n
    u = np.where(np.abs(x + 0.2) < 0.1, 0.5 * (1 + np.cos(10 * np.pi * x)), 0.0)
    v = np.where(np.abs(x - 0.2) < 0.1, 0.5 * (1 + np.cos(10 * np.pi * x)), 0.0)

    def react(u, v, dt):
        d = u - v  # is kept
        k = np.exp(-100 * np.abs(d) * dt)
        low, high = np.minimum(u, v), np.maximum(u, v)
        # low' = −100 low (low + |d|)
        close = np.abs(d) < 1e-9
        with np.errstate(divide="ignore", invalid="ignore"):
            new = np.where(close, low / (1 + 100 * low * dt), np.abs(d) * low * k / (high - low * k))
        return np.where(d > 0, new + d, new), np.where(d > 0, new, new - d)

    for _ in range(round(end / h)):
        u, v = react(u, v, h / 2)
        u, v = np.r_[0, u[:-1]], np.r_[v[1:], 0]
        u, v = react(u, v, h / 2)
    return x, u, v


def pulses(n: int, end: float = 300.0):
    """Gray and Scott: a pulse of v in u = 1 divides; on n equal cells of half the line; BDF."""
    length, du, dv, feed, kill = 100.0, 1.0, 0.01, 0.01, 0.053
    laplace = neumann(n, length / n)

    def f(t, w):
        u, v = w[: n + 1], w[n + 1 :]
        r = u * v**2
        return np.r_[du * (laplace @ u) - r + feed * (1 - u), dv * (laplace @ v) + r - (feed + kill) * v]

    def jacobian(t, w):
        u, v = w[: n + 1], w[n + 1 :]
        one = identity(n + 1)
        return bmat(
            [
                [du * laplace - diags(v**2) - feed * one, -diags(2 * u * v)],
                [diags(v**2), dv * laplace + diags(2 * u * v) - (feed + kill) * one],
            ],
            format="csc",
        )

    x = np.linspace(0, length, n + 1)
    bump = np.exp(-(x**2) / 20)
    w = solve_ivp(f, (0, end), np.r_[1 - 0.5 * bump, 0.25 * bump], "BDF", jac=jacobian, rtol=1e-7, atol=1e-9).y[:, -1]
    return x, w[: n + 1], w[n + 1 :]


def blow_up(n: int, source, slope, start, largest: float, rest) -> float:
    """The time at which u_t = u_xx + f(u) on [0, 1], u = 0 at the ends, is infinite: differences of fourth order on n
    equal cells of the left half, to a largest value by Radau's method, and `rest` of it from there."""
    h = 0.5 / n
    laplace = lil_matrix((n + 1, n + 1))
    for i in range(1, n + 1):
        for k, weight in zip(range(-2, 3), (-1 / 12, 4 / 3, -5 / 2, 4 / 3, -1 / 12), strict=True):
            j = i + k
            if j < 0:
                laplace[i, -j] -= weight  # u is odd about an end where u = u_xx = 0, up to the source there
            else:
                laplace[i, min(j, 2 * n - j)] += weight
    laplace = (laplace / h**2).tocsc()

    def f(t, u):
        du = laplace @ u + source(u)
        du[0] = 0
        return du

    def jacobian(t, u):
        d = slope(u)
        d[0] = 0
        return (laplace + diags(d)).tocsc()

    def reached(t, u):
        return u[-1] - largest

    reached.terminal = True
    x = np.linspace(0, 0.5, n + 1)
    run = solve_ivp(f, (0, 1), start(x), "Radau", jac=jacobian, rtol=1e-9, atol=1e-9, events=reached, first_step=1e-7)
    return run.t[-1] + rest(run.y[-1, -1])


def write(name: str, columns: list[str], fine, coarse) -> None:
    off = max(np.abs(np.interp(coarse[0], fine[0], a) - b).max() for a, b in zip(fine[1:], coarse[1:], strict=True))
    # nodes where linear interpolation between them needs them: all are kept where the slope changes
    kept = thinned(fine[0], np.array(fine[1:]))
    table = np.column_stack([column[kept] for column in fine])
    np.savetxt(HERE / f"{name}.csv", table, "%.9g", ",", header=",".join(columns), comments="")
    print(f"{name}: {len(table)} rows, {off:.1e} between {len(fine[0]) - 1} and {len(coarse[0]) - 1} cells")


def thinned(x, values, allowed: float = 1e-5):
    """Indices of nodes between which linear interpolation is right to a share of the range."""
    scale = np.ptp(values, axis=1, keepdims=True)
    kept, first = [0], 0
    while first < len(x) - 1:
        step = 1
        while first + 2 * step < len(x):
            span = slice(first, first + 2 * step + 1)
            share = (x[span] - x[first]) / (x[first + 2 * step] - x[first])
            line = values[:, [first]] + share * (values[:, [first + 2 * step]] - values[:, [first]])
            if (np.abs(values[:, span] - line) > allowed * scale).any():
                break
            step *= 2
        first += step
        kept.append(first)
    return np.array(kept)


if __name__ == "__main__":
    write("flame", ["x", "rho", "T"], flame(8000), flame(4000))
    write("hot-spot", ["x", "u"], hot_spot(4000), hot_spot(2000))
    write("opposite-waves", ["x", "u", "v"], opposite_waves(20000), opposite_waves(10000))
    write("pulses", ["x", "u", "v"], pulses(8000), pulses(4000))
    for n in (1000, 2000):
        square = blow_up(
            n, lambda u: u**2, lambda u: 2 * u, lambda x: 20 * np.sin(np.pi * x), 1e5, lambda u: 1 / u
        )
        exponential = blow_up(n, np.exp, np.exp, lambda x: 5 * np.sin(np.pi * x), 14.0, lambda u: np.exp(-u))
        print(f"blow-ups on {n} cells: u² at t = {square:.8f}, e^u at t = {exponential:.8f}")
