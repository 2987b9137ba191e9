"""Values and slopes of monotone cubics from SciPy, for tests/data.rs: python tests/python/monotone.py"""

from scipy.interpolate import PchipInterpolator

places, values = [0, 1, 1.5, 3, 4, 6], [0, 0.5, 2, 2, -1, 3]
cubic = PchipInterpolator(places, values)
for x in (0.3, 1.2, 2.2, 3.7, 5.1, 6.0):
    print([float(cubic(x, order)) for order in range(4)])
