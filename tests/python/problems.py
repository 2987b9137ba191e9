"""Reference values of tests/problems.rs, from SciPy: python tests/python/problems.py"""

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.sparse import diags


def robertson():
    """Kinetics of Robertson at t = 40 and 400, by backward differences."""

    def rates(t, y):
        slow, fast, last = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
        return [fast - slow, slow - fast - last, last]

    run = solve_ivp(rates, (0, 400), [1, 0, 0], method="BDF", rtol=1e-11, atol=1e-15, t_eval=[40, 400])
    print("robertson", run.y.T.tolist())


def tridiagonal(n):
    return diags([np.ones(n - 1), np.ones(n), np.ones(n - 1)], [-1, 0, 1])


def richards(n=800):
    """Heads at x = 20, 25, 28 and 30 in the column of Celia et al. (1990) after 360 s, on n equal cells."""
    alpha, full, dry, beta = 1.611e6, 0.287, 0.075, 3.96

    def capacity(h):
        size = np.abs(h)
        return alpha * (full - dry) * beta * size ** (beta - 1) / (alpha + size**beta) ** 2

    def conductivity(h):
        return 0.00944 * 1.175e6 / (1.175e6 + np.abs(h) ** 4.74)

    dx = 40 / n
    x = (np.arange(n) + 0.5) * dx

    def change(t, h):
        all_heads = np.concatenate([[-61.5], h, [-20.7]])
        slope = np.diff(all_heads) / dx
        slope[[0, -1]] *= 2
        k = 0.5 * (conductivity(all_heads[1:]) + conductivity(all_heads[:-1]))
        k[[0, -1]] = conductivity(np.array([-61.5, -20.7]))
        return np.diff(k * (slope + 1)) / dx / capacity(h)

    start = np.full(n, -61.5)
    run = solve_ivp(change, (0, 360), start, method="BDF", rtol=1e-8, atol=1e-8, jac_sparsity=tridiagonal(n))
    print("richards", [float(np.interp(at, x, run.y[:, -1])) for at in (20, 25, 28, 30)])


def electrolyte():
    """Potential at x = 0.5, 1 and 2 and the cations at x = 0 of an electrolyte between electrodes, at rest."""

    def slopes(x, y, k):
        return np.vstack([y[1], k[0] * np.sinh(y[0]), np.exp(-y[0])])

    def ends(a, b, k):
        return np.array([a[0] + 1, b[0] - 1, a[2], k[0] * b[2] - 20])

    x = np.linspace(0, 10, 401)
    guess = np.vstack([x / 5 - 1, np.full_like(x, 0.2), x])
    found = solve_bvp(slopes, ends, x, guess, p=[2.0], tol=1e-10, max_nodes=200000)
    k = found.p[0]
    print("electrolyte", [float(found.sol(at)[0]) for at in (0.5, 1, 2)], float(k / 2 * np.exp(1)))


def keller_segel(n=1600):
    """Density of cells at the centre at t = 0.05, from the equation of the mass within a radius, in w = r²."""
    high, width = 120.0, 12.0
    w = (np.arange(n + 1) / n) ** 3
    mass = high / (2 * width) * (1 - np.exp(-width * w))
    mean = 2 * mass[-1]
    left, right = w[1:-1] - w[:-2], w[2:] - w[1:-1]

    def change(t, inside):
        m = np.concatenate([[0], inside, [mass[-1]]])
        below, above = (m[1:-1] - m[:-2]) / left, (m[2:] - m[1:-1]) / right
        first = (right * below + left * above) / (left + right)
        second = 2 * (above - below) / (left + right)
        return 4 * w[1:-1] * second + 2 * first * (m[1:-1] - mean * w[1:-1] / 2)

    run = solve_ivp(change, (0, 0.05), mass[1:-1], method="BDF", rtol=1e-8, atol=1e-12, jac_sparsity=tridiagonal(n - 1))
    a, b = run.y[0, -1] / w[1], run.y[1, -1] / w[2]
    print(f"keller_segel on {n} cells", 2 * (a + (a - b) / (w[2] - w[1]) * w[1]))


if __name__ == "__main__":
    robertson()
    richards()
    electrolyte()
    keller_segel(800)
    keller_segel()
