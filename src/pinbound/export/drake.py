"""Convex regions and polytopes as a file of named `HPolyhedron`s, which Drake's `LoadIrisRegionsYamlFile` reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.export.half_spaces import half_spaces_text
from pinbound.model.coupling import real_array
from pinbound.typing import Array

__all__ = ["drake_text", "half_spaces", "save_drake_regions"]


def half_spaces(given: Any) -> tuple[Array, Array]:
    """Return A (k, n) and b (k,) of a convex region, a certified polytope, or a pair of arrays.

    Raises:
        UnsupportedError: If the region is not convex, or the polytope is not certified.
        DimensionError: If the arrays do not fit.

    Example:
        >>> half_spaces(([[1.0, 0.0]], [2.0]))
        (array([[1., 0.]]), array([2.]))
    """
    if hasattr(given, "halfspaces"):
        A, b = given.halfspaces()
    elif hasattr(given, "A") and hasattr(given, "b"):
        verdict = getattr(given, "verdict", None)
        if verdict is not None and verdict.name != "CERTIFIED":
            said = f"the polytope is {verdict.name}, so its A and b are not proven free"
            raise UnsupportedError(f"{said}; give certified_polytope a larger budget, or another q")
        A, b = given.A, given.b
    else:
        A, b = given
    A, b = real_array(A, "A"), real_array(b, "b")
    if A.ndim != 2 or b.shape != (len(A),) or not A.shape[1]:
        raise DimensionError(f"A has shape {A.shape} and b {b.shape}; give (k, n) and (k,)")
    if not (np.all(np.isfinite(A)) and np.all(np.isfinite(b))):
        raise DimensionError("A and b hold a number that is not finite; leave such rows out")
    return A, b


def drake_text(regions: Mapping[str, Any], coordinates: Sequence[str] = ()) -> str:
    """Return named regions over the same coordinates as text for Drake; every number keeps its last bit.

    Args:
        regions: Arguments of `half_spaces`, by name.
        coordinates: Names of the columns, for a comment; not needed if the regions know their coordinates.

    Raises:
        UnsupportedError: If a region is not convex, or a polytope is not certified.
        DimensionError: If there is no region, a name is empty, or arrays or coordinates do not fit.

    Example:
        >>> print(drake_text({"home": ([[1.0, 0.0], [0.0, -0.5]], [1.0, 2.0])}, ("q2", "q3")), end="")
        # x = (q2, q3)
        "home":
          ambient_dimension: 2
          A: [[1.0, 0.0], [0.0, -0.5]]
          b: [1.0, 2.0]
    """
    if not regions:
        raise DimensionError("there is no region to write; give a name and a region at least")
    sets, columns = dict[str, tuple[Array, Array]](), tuple(coordinates)
    for name, region in regions.items():
        if not name or not name.isprintable():
            raise DimensionError(f"a region's name is {name!r}; give printable characters")
        sets[name] = half_spaces(region)
        own = tuple(getattr(region, "coordinates", ()))
        columns = columns or own
        if len(columns) != sets[name][0].shape[1] or (own and own != columns):
            said = f"{name!r} has {sets[name][0].shape[1]} columns{f', {own},' if own else ''} and {columns} are named"
            raise DimensionError(f"{said}; name each column once, in order")
    return half_spaces_text(sets, columns)


def save_drake_regions(path: str | Path, regions: Mapping[str, Any], coordinates: Sequence[str] = ()) -> Path:
    """Write `drake_text` to a file and return its path; an existing file is replaced.

    Drake's q must have the order of the columns; a comment at the top of the file names them.

    Args:
        path: The file.
        regions: Regions, polytopes, or pairs (A, b) with `A x <= b`, by name.
        coordinates: Names of the columns; needed only if all entries are pairs (A, b).

    Returns:
        The file.

    Example:
        >>> import tempfile
        >>> import pinbound as pb
        >>> region = pb.feasible_region(pb.load("minervabot_v3"), ("q2", "q3"))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_drake_regions(folder + "/regions.yaml", {"home": region}).name
        'regions.yaml'
    """
    file = Path(path)
    file.write_text(drake_text(regions, coordinates), encoding="utf-8")
    return file
