"""Wavefront OBJ: vertices and polygons; other content (normals, textures, lines, names) is ignored."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pinbound.meshes.mesh import refuse, too_many

__all__ = ["read_obj"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_IGNORED = frozenset(
    "vt vn vp g o s mg mtllib usemtl usemap maplib l p bevel c_interp d_interp lod shadow_obj trace_obj".split()
)
_FREE_FORM = frozenset("cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con".split())
_MEND = "Export the mesh again"


def read_obj(data: bytes, source: str) -> tuple[Array, Ints, Ints, tuple[str, ...]]:
    """Return vertices, triangles, the polygon from which each triangle was cut, and notes on unused parts.

    A polygon is cut into a fan of triangles. In `v x y z w`, x, y and z are divided by w, as in Pinocchio's loader.

    Raises:
        InputError: If a line does not follow the format.
    """
    vertices: list[tuple[float, float, float]] = []
    triangles: list[tuple[int, int, int]] = []
    polygons: list[int] = []
    polygon = short = 0
    text = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").decode("utf-8-sig", "replace")
    for number, line in enumerate(text.split("\n"), 1):
        words = line.partition("#")[0].split()
        if not words or words[0] in _IGNORED:
            continue
        if words[0] == "v":
            vertices.append(_vertex(words[1:], source, number))
        elif words[0] in ("f", "fo"):
            corners = [_corner(word, len(vertices), source, number) for word in words[1:]]
            if len(corners) < 3:
                short += 1  # a line or a point, or the rest of a polygon where a file was cut off
                continue
            triangles += [(corners[0], one, two) for one, two in pairwise(corners[1:])]
            polygons += [polygon] * (len(corners) - 2)
            polygon += 1
            too_many(source, len(triangles))
        elif words[0] in _FREE_FORM:
            refuse(source, f"holds a free-form surface ({words[0]})", "Export the surface as triangles", number)
        else:
            refuse(
                source,
                f"the line starts with {words[0][:20]!r}, which no line of an OBJ file starts with",
                _MEND,
                number,
            )
    shape = np.array(triangles, dtype=np.int64).reshape(-1, 3)
    notes = (f"polygons of fewer than three corners are not used ({short})",) if short else ()
    return np.array(vertices, dtype=np.float64).reshape(-1, 3), shape, np.array(polygons, dtype=np.int64), notes


def _vertex(words: list[str], source: str, line: int) -> tuple[float, float, float]:
    try:
        if any("_" in word for word in words) or len(words) not in (3, 4, 6, 7):
            raise ValueError
        x, y, z = map(float, words[:3])
        if len(words) != 4:
            return x, y, z
        w = float(words[3])
        return x / w, y / w, z / w
    except (ValueError, ZeroDivisionError):
        refuse(source, f"'v {' '.join(words)[:60]}' is not a vertex", "Export the mesh again", line)


def _corner(word: str, count: int, source: str, line: int) -> int:
    try:
        index = int(word.partition("/")[0])
    except ValueError:
        index = 0
    if not index or index > count or -index > count or "_" in word:
        said = f"{word[:30]!r} of a polygon is none of the {count} vertices so far"
        refuse(source, said, "Export the mesh again", line)
    return index - 1 if index > 0 else count + index
