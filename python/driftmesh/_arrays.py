"""Arrays in: any real dtype, strides and order; shapes and values checked here, with both shapes in the message."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

#: More threads than this are a mistake on any machine.
MOST_THREADS = 4096


def real(name: str, values: ArrayLike) -> Floats:
    """Real numbers as a contiguous, aligned array of float64; no copy where it is one."""
    if np.ma.is_masked(values):
        raise ValueError(f"`{name}` has masked entries; fill them first")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"`{name}` is no array of numbers: {error}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"`{name}` is of dtype {array.dtype}; give real numbers")
    return np.require(array, np.float64, ("C", "A"))


def finite(name: str, values: ArrayLike, shape: tuple[int, ...] | None = None, of: str = "the mesh") -> Floats:
    """The same, of a given shape, without NaN and infinity."""
    array = real(name, values)
    if shape is not None and array.shape != shape:
        raise ValueError(f"`{name}` has shape {array.shape}, but {of} has shape {shape}")
    if not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"`{name}` is {array[place]} at index {place}; every value must be finite")
    return array


def positive(name: str, value: float) -> float:
    """A finite number above 0."""
    number = scalar(name, value)
    if not number > 0:
        raise ValueError(f"`{name}` is {number}, but must be above 0")
    return number


def scalar(name: str, value: float) -> float:
    """A finite number."""
    try:
        # float() reads texts and truth values too, but here they are mistakes
        number = None if isinstance(value, (str, bytes, bool, np.bool_)) else float(value)
    except (TypeError, ValueError):
        number = None
    if number is None:
        raise ValueError(f"`{name}` is {value!r}, but must be a number")
    if not np.isfinite(number):
        raise ValueError(f"`{name}` is {number}, but must be finite")
    return number


def count(name: str, value: Any) -> int:
    """A whole number, 0 or more."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not 0 <= value < 1 << 62:
        raise ValueError(f"`{name}` is {value!r}, but must be a whole number, 0 or more")
    return int(value)


def threads(value: Any) -> int | None:
    """A number of threads, 1 or more; None for all cores."""
    if value is not None and not 1 <= count("threads", value) <= MOST_THREADS:
        raise ValueError(f"`threads` is {value}, but must be between 1 and {MOST_THREADS}, or None for all cores")
    return None if value is None else int(value)


def pair(name: str, values: Sequence[Any] | NDArray[Any]) -> tuple[Any, Any]:
    """Two entries, one an axis."""
    try:
        first, second = values
    except (TypeError, ValueError):
        raise ValueError(f"`{name}` is {values!r}, but must have two entries, one an axis") from None
    return first, second


def word(name: str, value: Any, words: Sequence[str]) -> str:
    """One of some words; American spelling will do."""
    given = value.replace("optimized", "optimised") if "optimised" in words and isinstance(value, str) else value
    if not isinstance(given, str) or given not in words:
        raise ValueError(f"`{name}` is {value!r}, but must be one of {', '.join(words)}")
    return given
