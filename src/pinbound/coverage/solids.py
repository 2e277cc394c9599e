"""The structure of a mesh, to propose cuts: its closed surfaces, and its concave edges.

Files often hold several closed surfaces side by side: a tube, a lid, a pin. Each of them is a better part than a piece
cut by a plane through all of them. Within one closed surface, planes along its concave edges separate convex bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.cuts import NO_ROW, cut_by_plane
from pinbound.meshes import Mesh, pieces
from pinbound.values import Value

__all__ = ["Group", "group_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_MOST_SOLIDS = 12  # the largest; smaller ones go with the nearest of these
_SMALL = 1e-3  # of the total volume: a closed surface that encloses less, or is inverted, goes with another one
_FLAT = 0.05  # sine of the angle at an edge: an edge with less is not concave
_FLUSH = 2e-3  # of the extent of a group: concave edges nearer to a plane were cut by it
_TRIPLES = 200  # planes through three points of concave edges that are examined
_PLANES = 5  # planes that are proposed


@dataclass(frozen=True, eq=False)
class Group(Value):
    """A share of a mesh's surface, with its cuts closed.

    Attributes:
        triangles: (n, 3, 3) [m].
        solids: (n,), the number of the closed surface that each belongs to.
        is_surface: (n,), whether each is a triangle of the mesh, or a piece of one; the others close cuts.
        hollows: (k, 4), points on edges at which the surface is concave [m], and the weight of each.
    """

    triangles: Array
    solids: Ints
    is_surface: Flags
    hollows: Array

    @property
    def has_surface(self) -> bool:
        """Whether any of it is of the mesh: a part of what closes cuts alone would hold nothing."""
        return bool(np.any(self.is_surface))

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.triangles)

    def of_solids(self, chosen: Flags) -> tuple[Group, Group]:
        """Return two groups: the chosen triangles, and the others; both keep the concave edges."""
        one, other = (
            Group(self.triangles[rows], self.solids[rows], self.is_surface[rows], self.hollows)
            for rows in (chosen, ~chosen)
        )
        return one, other

    def joined(self, other: Group) -> Group:
        """Return this share and another of the same mesh as one."""
        return Group(
            np.concatenate((self.triangles, other.triangles)),
            np.concatenate((self.solids, other.solids)),
            np.concatenate((self.is_surface, other.is_surface)),
            np.unique(np.concatenate((self.hollows, other.hollows)), axis=0),
        )

    def with_more(self, triangles: Array) -> Group:
        """Return it with more triangles (n, 3, 3); they count as part of the closed surface of its first triangle."""
        owner = np.repeat(self.solids[:1], len(triangles))
        return Group(
            np.concatenate((self.triangles, triangles)),
            np.concatenate((self.solids, owner)),
            np.concatenate((self.is_surface, np.ones(len(triangles), dtype=np.bool_))),
            self.hollows,
        )

    def cut(self, axis: Array, at: float) -> tuple[Group, Group]:
        """Return the parts below and above the plane `axis . x = at`; closed surfaces are cut and closed one by one."""
        numbers: list[int] = np.unique(self.solids).tolist()
        flags = [self.solids == number for number in numbers]
        cuts = [cut_by_plane(self.triangles[rows], axis, at) for rows in flags]
        height = self.hollows[:, :3] @ axis - at
        flush = _FLUSH * float(np.ptp(self.triangles.reshape(-1, 3), axis=0).max())
        found: list[Group] = []
        for side, sign in enumerate((-1.0, 1.0)):
            owner = np.repeat(numbers, [len(cut[side].rows) for cut in cuts]).astype(np.int64)
            surface = [
                (cut[side].rows != NO_ROW) & self.is_surface[rows][cut[side].rows]
                for rows, cut in zip(flags, cuts, strict=True)
            ]
            triangles = np.concatenate([cut[side].triangles for cut in cuts])
            found.append(Group(triangles, owner, np.concatenate(surface), self.hollows[sign * height > flush]))
        return found[0], found[1]

    def planes(self) -> list[tuple[Array, float]]:
        """Return planes that contain many of the concave edges: a unit normal, and the position along it."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        rows = np.all((self.hollows[:, :3] >= low) & (self.hollows[:, :3] <= high), axis=1)
        places, weights = self.hollows[rows, :3], self.hollows[rows, 3]
        thick = _FLUSH * float(np.max(high - low))
        random = np.random.default_rng(0)
        found: list[tuple[Array, float]] = []
        while len(places) > 2 and len(found) < _PLANES:
            corners = places[random.integers(len(places), size=(_TRIPLES, 3))]
            normals: Any = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            size = np.linalg.norm(normals, axis=1)
            some = size > thick**2
            if not np.any(some):
                break
            normals, corners = normals[some] / size[some, None], corners[some, 0]
            close = np.abs(places @ normals.T - np.einsum("ni,ni->n", normals, corners)) <= thick
            best = int(np.argmax(weights @ close))
            if weights @ close[:, best] <= 0.05 * weights.sum():
                break
            found.append((normals[best], float(normals[best] @ corners[best])))
            places, weights = places[~close[:, best]], weights[~close[:, best]]
        return found


def group_of(mesh: Mesh) -> Group:
    """Return the whole mesh as a group, with its closed surfaces numbered.

    A surface is closed if each of its edges is in two triangles, once in each direction. Some triangles go with the
    nearest closed surface: those of open surfaces, of surfaces that enclose almost nothing, and of inverted surfaces
    (holes).

    Example:
        >>> box = np.array(list(np.ndindex(2, 2, 2)), dtype=np.float64)
        >>> from scipy.spatial import ConvexHull
        >>> hull = ConvexHull(box)
        >>> rows = [row if at @ np.cross(*(box[row[1:]] - box[row[0]])) > 0 else row[::-1]
        ...         for row, at in zip(hull.simplices, hull.equations[:, :3])]
        >>> two = Mesh(np.vstack((box, box + 3.0)), np.vstack((rows, np.array(rows) + 8)), np.arange(24))
        >>> np.unique(group_of(two).solids).tolist()
        [0, 1]
    """
    corners = mesh.vertices[mesh.triangles]
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    rows: Ints = index.ravel()[mesh.triangles]
    volumes: Array = np.linalg.det(corners - vertices.mean(axis=0)) / 6.0
    if volumes.sum() < 0.0:  # the whole mesh is inverted
        corners, rows, volumes = corners[:, ::-1], rows[:, ::-1], -volumes
    count = len(vertices)
    start, end = rows.ravel(), np.roll(rows, -1, axis=1).ravel()
    labels = pieces(rows, count)[rows[:, 0]]
    owner = np.repeat(labels, 3)
    there, back = start * count + end, end * count + start
    order = np.argsort(there, kind="stable")
    at = np.minimum(np.searchsorted(there[order], back), len(order) - 1)
    partner: Ints = order[at]
    matched = there[partner] == back
    twice = np.zeros(len(there), dtype=np.bool_)
    twice[order[1:]] |= np.diff(there[order]) == 0
    twice[order[:-1]] |= np.diff(there[order]) == 0
    flat = start == end
    broken = np.bincount(owner, weights=((~matched | twice) & ~flat).astype(np.float64)) > 0
    volume = np.bincount(labels, weights=volumes)
    large = np.flatnonzero(~broken & (volume > _SMALL * np.abs(volume).sum()))
    large = large[np.argsort(-volume[large])][:_MOST_SOLIDS]
    solids = np.zeros(len(corners), dtype=np.int64)
    if len(large):
        number = np.full(len(volume), -1)
        number[large] = np.arange(len(large))
        solids = number[labels]
        lost = np.unique(labels[solids < 0])
        if len(lost):
            solids[solids < 0] = _nearest(corners, solids, labels, len(volume))[labels[solids < 0]]
    surface = np.ones(len(corners), dtype=np.bool_)
    return Group(corners, solids, surface, _hollows(corners, partner, matched & ~twice & ~broken[owner]))


def _nearest(corners: Array, solids: Ints, labels: Ints, count: int) -> Ints:
    """Return for each connected surface the number of the chosen surface that is nearest to its middle."""
    from scipy import spatial

    library: Any = spatial
    kept = np.flatnonzero(solids >= 0)
    tree = library.cKDTree(corners[kept].reshape(-1, 3))
    total = np.maximum(np.bincount(labels, minlength=count), 1)[:, None]
    middles = np.stack([np.bincount(labels, corners[:, :, axis].mean(axis=1), count) for axis in range(3)], axis=1)
    found: Ints = solids[kept][np.asarray(tree.query(middles / total)[1]) // 3]
    return found


def _hollows(corners: Array, partner: Ints, chosen: Flags) -> Array:
    """Return two points on each concave edge between two triangles, and their weights."""
    edge = np.flatnonzero(chosen & (np.arange(len(partner)) < partner))
    other = partner[edge]
    normals: Any = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0.0)
    a, b = corners[edge // 3, edge % 3], corners[edge // 3, (edge + 1) % 3]
    apex = corners[other // 3, (other + 2) % 3]
    turn = np.linalg.norm(np.cross(normals[edge // 3], normals[other // 3]), axis=1)
    rows = np.flatnonzero((turn > _FLAT) & (np.einsum("ni,ni->n", normals[edge // 3], apex - a) > 0.0))
    a, b = a[rows], b[rows]
    weight = np.linalg.norm(b - a, axis=1) * turn[rows]
    return np.concatenate([np.column_stack((a + part * (b - a), weight)) for part in (0.25, 0.75)])
