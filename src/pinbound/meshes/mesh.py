"""Triangles of a mesh file, and the checks that refuse faulty ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from pinbound.exceptions import InputError, Problem
from pinbound.tolerances import LARGEST_BODY
from pinbound.values import Value

__all__ = ["MOST_BYTES", "MOST_TRIANGLES", "Mesh", "checked", "numbers", "pieces", "refuse", "too_many"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_TRIANGLES = 1_000_000
"""Largest number of triangles of a mesh; a collision mesh has some thousand."""
MOST_BYTES = 512 * 2**20
"""Largest size of a file, packed or unpacked [bytes]; a million triangles as text take half of it."""
_SIMPLER = "Give a simpler mesh: collision bodies need some thousand triangles"
_NUMBERS = re.compile(r"[-+.\deEnNaAiIfFtTyY\s]*")  # digits, and the letters of inf, infinity and nan


@dataclass(frozen=True, eq=False)
class Mesh(Value):
    """A surface of triangles.

    Attributes:
        vertices: (n, 3) [m].
        triangles: (m, 3), indices of rows of `vertices`.
        polygons: (m,), the number of the polygon in the file from which each triangle was cut.
        source: The name of the file, as the user knows it.
        notes: One sentence for each part of the file that was not used.
    """

    vertices: Array
    triangles: Ints
    polygons: Ints
    source: str = "mesh"
    notes: tuple[str, ...] = ()

    def placed(self, rotation: Array, translation: Array) -> Mesh:
        """Return the mesh in another frame: each vertex x becomes `rotation x + translation`.

        Args:
            rotation: (3, 3).
            translation: (3,) [m].

        Example:
            >>> corner = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.zeros(1, np.int64))
            >>> corner.placed(np.eye(3), np.array([0.0, 0.0, 1.0])).vertices.tolist()
            [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 2.0]]
        """
        moved = self.vertices @ np.asarray(rotation, dtype=np.float64).T + translation
        return Mesh(moved, self.triangles, self.polygons, self.source, self.notes)


def refuse(source: str, message: str, remedy: str, line: int | None = None) -> NoReturn:
    """Raise the error of a file, with its only fault."""
    raise InputError([Problem(message, remedy, source, line)])


def too_many(source: str, count: int) -> None:
    """Refuse a file whose header states too many triangles, before the triangles are read."""
    if count > MOST_TRIANGLES:
        refuse(source, f"has {count} triangles; up to {MOST_TRIANGLES} are read", _SIMPLER)


def checked(
    source: str,
    vertices: Any,
    triangles: Any,
    polygons: Any,
    scale: Sequence[float] = (1.0, 1.0, 1.0),
    notes: Sequence[str] = (),
) -> Mesh:
    """Return the scaled mesh; refuse it without triangles, or if a vertex is missing or not finite."""
    corners, places = np.asarray(triangles, dtype=np.int64).reshape(-1, 3), np.asarray(vertices, dtype=np.float64)
    if not len(corners):
        refuse(source, "holds no triangle", "Export the surface as triangles")
    too_many(source, len(corners))
    if corners.min() < 0 or corners.max() >= len(places):
        said = f"a triangle names vertex {int(corners.max() if corners.max() >= len(places) else corners.min())}"
        refuse(source, f"{said}; it has {len(places)} vertices", "Export the mesh again")
    used, corners = np.unique(corners, return_inverse=True)
    with np.errstate(over="ignore", invalid="ignore"):
        places = places[used] * np.asarray(scale, dtype=np.float64)
    if not np.all(np.isfinite(places)):
        refuse(source, "a vertex holds a number that is not finite", "Export the mesh again")
    if np.abs(places).max() > LARGEST_BODY:
        said = f"a vertex is {np.abs(places).max():.3g} m from the origin of the mesh"
        refuse(source, said, f"Give metres, or a scale; bodies reach up to {LARGEST_BODY:g} m")
    return Mesh(places, corners.reshape(-1, 3), np.asarray(polygons, dtype=np.int64), source, tuple(notes))


def numbers(source: str, text: str | None, what: str, line: int | None = None) -> Array:
    """Return the numbers of a text, which are separated by spaces; refuse words that are not numbers."""
    words = text or ""
    try:
        if _NUMBERS.fullmatch(words):
            return np.array(words.split(), dtype=np.float64)
    except ValueError:
        pass
    refuse(source, f"{what} holds something that is not a number", "Export the mesh again", line)


def pieces(triangles: Ints, count: int) -> Ints:
    """Return the number of each vertex's connected piece; a vertex without triangles is a piece of its own.

    Example:
        >>> pieces(np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6]]), 7).tolist()
        [0, 0, 0, 0, 1, 1, 1]
    """
    from scipy import sparse
    from scipy.sparse import csgraph

    ends = np.concatenate((triangles[:, :2], triangles[:, 1:]))
    graph = cast(Any, sparse).coo_array((np.ones(len(ends), dtype=np.bool_), ends.T), (count, count))
    return np.asarray(cast(Any, csgraph).connected_components(graph, directed=False)[1], dtype=np.int64)
