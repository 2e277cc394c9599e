"""Arguments of Python calls that are checked in the same way everywhere: whole numbers, seeds, lists of names."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from numbers import Integral, Real
from typing import Any, cast

import numpy as np

from pinbound.exceptions import DimensionError

__all__ = ["is_amount", "names_of", "random_numbers", "three_numbers", "whole_number"]


def whole_number(value: Any, what: str, least: int = 0) -> int:
    """Return a whole number of at least `least`.

    Raises:
        DimensionError: If it is none; True and 1.0 are none.

    Example:
        >>> whole_number(-1, "seed")
        Traceback (most recent call last):
        pinbound.exceptions.DimensionError: seed is -1; give a whole number of 0 or more
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
        raise DimensionError(f"{what} is {value!r}; give a whole number of {least} or more")
    return int(value)


def is_amount(value: Any) -> bool:
    """Return whether a value is a number of at least 0; True is none, and NaN neither.

    Example:
        >>> is_amount(0.5), is_amount("1"), is_amount(float("nan"))
        (True, False, False)
    """
    return not isinstance(value, bool) and isinstance(value, Real) and float(value) >= 0.0


def random_numbers(seed: Any) -> np.random.Generator:
    """Return the random numbers of a seed.

    Raises:
        DimensionError: If the seed is not a whole number of at least 0. None is no seed: its numbers differ each time.

    Example:
        >>> random_numbers(7).random() == random_numbers(7).random()
        True
    """
    return np.random.default_rng(whole_number(seed, "seed"))


def three_numbers(values: Any, what: str) -> tuple[float, float, float]:
    """Return a point or a direction as three finite numbers.

    Raises:
        DimensionError: If it is not.

    Example:
        >>> three_numbers([1, 2, 3], "xyz")
        (1.0, 2.0, 3.0)
    """
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"{what} is {values!r}; give three numbers") from error
    if not all(map(math.isfinite, (x, y, z))):
        raise DimensionError(f"{what} is {values!r}; give three finite numbers")
    return x, y, z


def names_of(names: Any, what: str) -> tuple[Any, ...]:
    """Return a name, or several, as a tuple; NumPy's strings become Python's, so that messages and tables show names.

    Entries of other types pass through: who looks them up says that there is no such name.

    Raises:
        DimensionError: If it is neither a text nor a list, or a list of lists.

    Example:
        >>> names_of("q1", "coordinates"), names_of(np.array(["q1", "q2"]), "coordinates")
        (('q1',), ('q1', 'q2'))
    """
    if isinstance(names, str):
        return (str(names),)
    entries: list[Any] = []
    is_list = isinstance(names, Iterable) and not (isinstance(names, np.ndarray) and names.ndim != 1)
    if is_list:
        entries = [str(name) if isinstance(name, str) else name for name in cast(Iterable[Any], names)]
    if not is_list or not all(isinstance(name, Hashable) for name in entries):
        raise DimensionError(f"{what} is {names!r}; give a name, or a list of names")
    return tuple(entries)
