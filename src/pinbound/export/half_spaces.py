"""Convex sets `{x : A x <= b}` as YAML of named `HPolyhedron`s, which Drake's `LoadIrisRegionsYamlFile` reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pinbound.typing import Array

__all__ = ["half_spaces_text", "write_half_spaces"]


def half_spaces_text(sets: Mapping[str, tuple[Array, Array]], coordinates: Sequence[str]) -> str:
    """Return the YAML `{name: {ambient_dimension, A, b}}` of sets {A x <= b}, every number to its last bit.

    Args:
        sets: A (m, k) and b (m,) by name.
        coordinates: Names of the entries of x; they are written as a comment, because Drake's format has no field for
            them.

    Example:
        >>> print(half_spaces_text({"one": (np.array([[1.0, -0.5]]), np.array([1e-9]))}, ["q1", "q2"]))
        # x = (q1, q2)
        "one":
          ambient_dimension: 2
          A: [[1.0, -0.5]]
          b: [1.0e-09]
        <BLANKLINE>
    """
    lines = [f"# x = ({', '.join(coordinates)})".replace("\n", " ")]
    for name, (A, b) in sets.items():
        quoted = name.replace("\\", "\\\\").replace('"', '\\"')
        rows = ", ".join(_numbers(row) for row in A)
        lines += [
            f'"{quoted}":',
            f"  ambient_dimension: {len(coordinates)}",
            f"  A: [{rows}]",
            f"  b: {_numbers(b)}",
        ]
    return "\n".join(lines) + "\n"


def write_half_spaces(path: Path, sets: Mapping[str, tuple[Array, Array]], coordinates: Sequence[str]) -> Path:
    """Write `half_spaces_text` to a file.

    Raises:
        OSError: If the file cannot be written.
    """
    path.write_text(half_spaces_text(sets, coordinates), encoding="utf-8")
    return path


def _numbers(row: Array) -> str:
    return f"[{', '.join(_number(float(x)) for x in np.asarray(row))}]"


def _number(x: float) -> str:
    """Return a number with a decimal point, because YAML 1.1 reads `1e-09` as text."""
    text = repr(x)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
