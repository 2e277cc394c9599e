"""Tubes of undecided cells around searched contact curves: the curves in them, and the parts that they may connect.

In an undecided cell the signs of `f - T` at the corners show where the contour passes. The crossing of a side is found
to rounding. No proof depends on these curves: outside the tubes every point is free or in contact, as the drawing says.
So a face of the drawing without the tubes is free. Two parts of it that only a tube connects are not proven to be
connected (`Tubes.doubts`). There cells are cut further, as long as this helps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely
from scipy import sparse

from pinbound.loops.through_loops import LoopFunction
from pinbound.region.cells import Searched, SeparationFunction, decided, pave
from pinbound.region.contours import STRIDE, box_sides, chain_up
from pinbound.region.deadline import Deadline
from pinbound.region.lines import Line
from pinbound.typing import Array, Flags, Ints

__all__ = ["Doubts", "Part", "Tubes"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
csgraph = cast(Any, sparse.csgraph)

_ROUNDS = 20  # rounds of the search for a crossing in its bracket
_HALVING = 5  # rounds of these that use a guess
_NEAR = (2e-3, 3e-5)  # of a side: the distances from a guess at which its two sides are tried
_BRACKET = 1e-4  # of a side: the accuracy of a crossing
_DEEPER = 7  # levels beyond the width, down to which cells are halved where two parts may be connected
_MOST_DOUBTFUL = 20_000  # cells that are cut further at a time
_CRUMB = 16.0  # cells of the stated width: smaller parts are not reported
_SHORTEST = 12  # cells that a curve passes: a shorter curve is traced in finer cells
_TOUCH = 1e-3  # of a cell's side: shapes nearer than this touch


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a face outside all tubes, proven free.

    Attributes:
        face: Number of the face.
        polygon: Its shape, in units of `Slice.scales`.
    """

    face: int
    polygon: Any


@dataclass(frozen=True, eq=False)
class Doubts:
    """Cells in which it is undecided whether two parts are connected.

    Attributes:
        within: (k,) cells between parts of one face: the drawing connects them.
        between: (k,) cells between parts of two faces: the drawing separates them.
    """

    within: Ints
    between: Ints

    def __bool__(self) -> bool:
        """Return whether there are such cells."""
        return bool(len(self.within) or len(self.between))


class Tubes:
    """Undecided cells, which change as they are cut."""

    def __init__(self, searched: Searched, width: float, deadline: Deadline | None, adapts: bool = False) -> None:
        """Divide the slice into cells of the stated width; if it `adapts`, of a multiple that gives enough cells."""
        self.searched, self.deadline = searched, deadline
        self.cells, self.grid = pave(searched, deadline, adapts)
        self.width = width * 2.0 ** (searched.grid.level - self.grid.level)
        self._signs: dict[int, tuple[Ints, Flags]] = {}
        self._roots: dict[int, tuple[Any, Array]] = {}
        self.hidden = np.empty(0, dtype=np.int64)

    # ------------------------------------------------------------------ the curves

    def lines(self) -> list[Line]:
        """Return the contours of all boundaries within their undecided cells.

        `hidden` gets the cells without a contour whose corners are all free, which may contain an island, and the cells
        of the shortest curves.
        """
        found: list[Line] = []
        hidden: list[Ints] = []
        for which, (curve, function) in enumerate(zip(self.searched.curves, self.searched.functions, strict=True)):
            mine = self.cells.cell[self.cells.which == which]
            if len(mine):
                drawn, seen = self._trace(which, function, self.cells.corners[mine], self.cells.sizes[mine])
                found += [Line(curve.name, curve.source, curve.is_contact, points, function) for points in drawn]
                hidden.append(mine[~seen])
        self.hidden = np.unique(np.concatenate(hidden)) if hidden else np.empty(0, dtype=np.int64)
        return found

    def _trace(
        self, which: int, function: SeparationFunction | LoopFunction, corners: Ints, sizes: Ints
    ) -> tuple[tuple[Array, ...], Flags]:
        """Return the contours of one boundary, and whether each of its cells is next to one, or to contact."""
        if self.deadline is not None:
            self.deadline.check()
        nodes, cell, end = box_sides(corners, sizes)
        contact = self._contact(which, function, nodes)
        changes = contact[end[:, 0]] != contact[end[:, 1]]
        passed = np.zeros(len(nodes), dtype=bool)  # corners of cells that a contour passes
        crossed = np.zeros(len(corners), dtype=bool)
        crossed[cell[changes]] = True
        passed[end[crossed[cell]]] = True
        seen = np.zeros(len(corners), dtype=bool)
        np.logical_or.at(seen, cell, np.any(passed[end] | contact[end], axis=1))
        cell, end = cell[changes], end[changes]
        if not len(cell):
            return (), seen
        pieces, piece = np.unique(np.sort(end, axis=1), axis=0, return_inverse=True)
        piece = piece.ravel()
        turned = contact[pieces[:, 0]]
        free, hit = (np.where(turned == side, pieces[:, 1], pieces[:, 0]) for side in (True, False))
        points = self._crossings(which, function, nodes[free], nodes[hit])
        # Around each cell, counter-clockwise: a crossing out of contact is connected to the next one into it. So
        # the free areas between two curves that pass through a cell are separate.
        middle = self.grid.places(corners) + 0.5 * self.grid.step * sizes[:, None]
        first = self.grid.places(np.stack((nodes // STRIDE, nodes % STRIDE), axis=-1)[end[:, 0]]) - middle[cell]
        last = self.grid.places(np.stack((nodes // STRIDE, nodes % STRIDE), axis=-1)[end[:, 1]]) - middle[cell]
        forward = first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0] > 0.0
        leaves = contact[np.where(forward, end[:, 0], end[:, 1])]
        toward = 0.5 * (first + last) / (self.grid.step * sizes[cell][:, None])
        order = np.lexsort((np.arctan2(toward[:, 1], toward[:, 0]), cell))
        cell, piece, leaves = cell[order], piece[order], leaves[order]
        start = np.searchsorted(cell, cell, side="left")
        stop = np.searchsorted(cell, cell, side="right")
        following = np.where(np.arange(len(cell)) + 1 < stop, np.arange(len(cell)) + 1, start)
        rows = np.flatnonzero(leaves)
        pairs = np.stack((piece[rows], piece[following[rows]]), axis=1)
        real = pairs[:, 0] != pairs[:, 1]
        pairs, owner = pairs[real], cell[rows][real]
        seen[owner[_crumbs(pairs, len(points))]] = False
        return chain_up(pairs, points[pairs], np.arange(len(pairs))), seen

    def _contact(self, which: int, function: SeparationFunction | LoopFunction, nodes: Ints) -> Flags:
        """Return whether corners are in contact; each is evaluated once."""
        known, values = self._signs.get(which, (np.empty(0, dtype=np.int64), np.empty(0, dtype=bool)))
        new = nodes[~np.isin(nodes, known)]
        if len(new):
            found = function.value(self.grid.places(np.stack((new // STRIDE, new % STRIDE), axis=1))) <= 0.0
            keys = np.concatenate((known, new))
            order = np.argsort(keys)
            known, values = keys[order], np.concatenate((values, found))[order]
            self._signs[which] = known, values
        return values[np.searchsorted(known, nodes)]

    def _crossings(self, which: int, function: SeparationFunction | LoopFunction, free: Ints, hit: Ints) -> Array:
        """Return where contact begins between free corners and those in contact: points (N, 2), still free."""
        keys = _short(free) + 1j * _short(hit)
        known, points = self._roots.get(which, (np.empty(0, dtype=complex), np.empty((0, 2))))
        new = ~np.isin(keys, known)
        if np.any(new):
            ends = [self.grid.places(np.stack((x // STRIDE, x % STRIDE), axis=1)) for x in (free[new], hit[new])]
            found = _first_contact(function, *ends)
            known, points = np.concatenate((known, keys[new])), np.concatenate((points, found))
            order = np.argsort(known)
            known, points = known[order], points[order]
            self._roots[which] = known, points
        return points[np.searchsorted(known, keys)]

    # ------------------------------------------------------------------ what they connect

    def boxes(self, cells: Ints | slice = slice(None), grown: float = 0.0) -> Any:
        """Return some of the cells as polygons, each enlarged by a share of its side."""
        low, high = self.grid.boxes(self.cells)
        spare = grown * (high - low)[cells]
        low, high = low[cells] - spare, high[cells] + spare
        return gis.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])

    def outline(self) -> Any:
        """Return the union of all cells; equal cells in a row are merged first."""
        sizes, corners = self.cells.sizes, self.cells.corners
        order = np.lexsort((corners[:, 0], corners[:, 1], sizes))
        sizes, corners = sizes[order], corners[order]
        apart = (np.diff(sizes) != 0) | (np.diff(corners[:, 1]) != 0) | (np.diff(corners[:, 0]) != sizes[:-1])
        first = np.concatenate(([True], apart)) if len(order) else np.empty(0, dtype=bool)
        last = np.concatenate((apart, [True])) if len(order) else np.empty(0, dtype=bool)
        low, high = self.grid.places(corners[first]), self.grid.places(corners[last] + sizes[last][:, None])
        return gis.union_all(gis.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))

    def parts(self, faces: Sequence[Any], outline: Any) -> list[Part]:
        """Return the parts of faces outside all cells."""
        left = gis.difference(np.array(faces), outline)
        pieces, face = gis.get_parts(left, return_index=True)
        kept = gis.area(pieces) > 0.0
        return [Part(int(i), piece) for i, piece in zip(face[kept], pieces[kept], strict=True)]

    def _graph(self) -> tuple[Any, int]:
        """Return the graph of cells and their corners: two steps lead from a cell to a touching cell."""
        nodes, cell, end = box_sides(self.cells.corners, self.cells.sizes)
        return _incidence(len(self.cells), len(nodes), cell, end), len(self.cells)

    def doubts(
        self, faces: Sequence[Any], sides: Sequence[Any], parts: Sequence[Part], start: Array, room: Any
    ) -> Doubts:
        """Return the cells along the shortest chains that may connect the start's part with other parts.

        Args:
            faces: The free faces, the start's first.
            sides: For each face, its sides of the exact lines; faces with different sides are not connected.
            parts: The proven parts of the faces.
            start: (2,).
            room: The set within the limits, as a polygon.
        """
        none = np.empty(0, dtype=np.int64)
        if not len(self.cells):
            return Doubts(none, none)
        tree = gis.STRtree(self.boxes(grown=_TOUCH))

        def at(shapes: Sequence[Any]) -> Ints:
            return np.unique(np.asarray(tree.query(np.array(shapes), predicate="intersects")[1], dtype=np.int64))

        point = gis.Point(start)
        away = [float(part.polygon.distance(point)) for part in parts]
        home = int(np.argmin(away)) if parts and min(away) <= _TOUCH * float(self.grid.step.max()) else -1
        sources = at([parts[home].polygon]) if home >= 0 else at([point])
        least = _CRUMB * float(np.prod(self.grid.step)) * float(self.grid.size) ** 2
        others = [p for i, p in enumerate(parts) if i != home and (p.polygon.area > least or home < 0)]
        graph, count = self._graph()
        inside = np.zeros(count, dtype=bool)
        inside[at([faces[0]])] = True
        open_ = np.zeros(count, dtype=bool)
        open_[at([room])] = True
        same = [p.polygon for p in others if p.face == 0]
        within = _between(graph, count, inside & open_, sources, at(same)) if same else none
        between = none
        if home >= 0:
            for face in sorted({p.face for p in others if p.face and sides[p.face] == sides[0]}):
                reached = at([p.polygon for p in others if p.face == face])
                between = np.union1d(between, _between(graph, count, open_, sources, reached))
        return Doubts(within, between)

    def deeper(self, doubtful: Ints) -> Ints:
        """Return the cells, of those given, that may be cut further."""
        finest = max(self.grid.size >> _DEEPER, 1)
        found = doubtful[self.cells.sizes[doubtful] > finest]
        return found if len(found) <= _MOST_DOUBTFUL else np.empty(0, dtype=np.int64)

    def around(self, point: Array) -> Ints:
        """Return the cells that touch a point, if they can be cut."""
        low, high = self.grid.boxes(self.cells)
        spare = _TOUCH * (high - low)
        touches = np.all((low - spare <= point) & (point <= high + spare), axis=1) & (self.cells.sizes > 1)
        return np.flatnonzero(touches)

    def cut(self, chosen: Ints) -> None:
        """Cut some cells into four, and keep the undecided ones."""
        mask = np.zeros(len(self.cells), dtype=bool)
        mask[chosen] = True
        finer = decided(self.searched, self.cells.take(mask).quarters(), self.deadline)
        self.cells = self.cells.take(~mask).with_more(finer)

    def blocks(self, chosen: Ints) -> list[tuple[Any, str]]:
        """Return polygons around some cells, one for each touching group, and a boundary that is undecided there."""
        if not len(chosen):
            return []
        tree_of = gis.get_parts(gis.union_all(self.boxes(chosen, grown=_TOUCH)))
        polygons = [gis.Polygon(part.exterior) for part in tree_of]
        owner = np.asarray(gis.STRtree(polygons).query(self.boxes(chosen), predicate="intersects"))
        found: list[tuple[Any, str]] = []
        curves = self.searched.curves
        for number, polygon in enumerate(polygons):
            mine = chosen[owner[0][owner[1] == number]]
            which: Ints = self.cells.which[np.isin(self.cells.cell, mine)]
            open_: list[int] = np.unique(which).tolist()
            first = min(open_, key=lambda which: curves[which].is_contact)  # a limit comes first: it ends the region
            found.append((polygon, curves[first].name))
        return found

    def network(self, faces: Sequence[Any], index: int, sides: Sequence[Any], room: Any) -> tuple[Ints, list[int]]:
        """Return all cells that may belong to the component of a face, and the faces that they may connect to it."""
        if not len(self.cells):
            return np.empty(0, dtype=np.int64), [index]
        tree = gis.STRtree(self.boxes(grown=_TOUCH))
        open_ = np.zeros(len(self.cells), dtype=bool)
        open_[tree.query(room, predicate="intersects")] = True
        graph, count = self._graph()
        usable = np.concatenate((open_, np.ones(graph.shape[0] - count, dtype=bool)))
        tube: Ints = csgraph.connected_components(_restricted(graph, usable), directed=False)[1][:count]
        kept = [i for i, side in enumerate(sides) if side == sides[index]]
        near = tree.query(np.array([faces[i] for i in kept]), predicate="intersects")
        touched = {face: set(tube[near[1][near[0] == row]].tolist()) for row, face in enumerate(kept)}
        joined, reached = {index}, set(touched[index])
        while more := [face for face in kept if face not in joined and touched[face] & reached]:
            joined.update(more)
            for face in more:
                reached |= touched[face]
        return np.flatnonzero(open_ & np.isin(tube, list(reached))), sorted(joined)

    def farthest(self, lines: Sequence[Line], room: Any, closed: Sequence[Any]) -> float:
        """Return a bound of the distance of a contour from the lines, outside closed places."""
        if not len(self.cells) or not lines:
            return 0.0
        boxes = self.boxes()
        kept = np.flatnonzero(gis.intersects(boxes, room))
        for place in closed:
            kept = kept[~gis.within(boxes[kept], place)]
        segments = np.concatenate([np.stack((line.points[:-1], line.points[1:]), axis=1) for line in lines])
        middle = gis.centroid(boxes[kept])
        _, away = gis.STRtree(gis.linestrings(segments)).query_nearest(middle, all_matches=False, return_distance=True)
        return float(np.max(away + 0.5 * self.cells.sizes[kept] * np.hypot(*self.grid.step), initial=0.0))


def _incidence(count: int, corners: int, cell: Ints, end: Ints) -> Any:
    """Return the graph of cells and corners, numbered in this order: an edge if a corner is on a cell's border."""
    rows, columns = np.concatenate((cell, cell)), np.concatenate((end[:, 0], end[:, 1])) + count
    size = count + corners
    return sparse.csr_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(size, size))


def _restricted(graph: Any, usable: Flags) -> Any:
    """Return the graph without the edges of unusable nodes."""
    whole = graph.tocoo()
    kept = usable[whole.row] & usable[whole.col]
    return sparse.csr_matrix((whole.data[kept], (whole.row[kept], whole.col[kept])), shape=graph.shape)


def _crumbs(pairs: Ints, count: int) -> Flags:
    """Return which pairs (P, 2) of `count` crossings belong to curves of very few cells."""
    graph = sparse.csr_matrix((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    curve: Ints = csgraph.connected_components(graph, directed=False)[1][pairs[:, 0]]
    return np.bincount(curve)[curve] <= _SHORTEST if len(pairs) else np.zeros(0, dtype=bool)


def _short(nodes: Ints) -> Any:
    """Return keys of corners as numbers that a float64 can represent: coordinates are at most 2^26."""
    return ((nodes // STRIDE) * ((1 << 26) + 1) + nodes % STRIDE).astype(np.float64)


def _between(graph: Any, count: int, allowed: Flags, sources: Ints, targets: Ints) -> Ints:
    """Return the cells on the shortest chains (and on those two cells longer) between cells; none without a chain."""
    usable = np.ones(graph.shape[0], dtype=bool)
    usable[:count] = allowed
    sources, targets = sources[allowed[sources]], targets[allowed[targets]]
    if not len(sources) or not len(targets):
        return np.empty(0, dtype=np.int64)
    cut = _restricted(graph, usable)
    ways = [
        csgraph.dijkstra(cut, directed=False, indices=rows, unweighted=True, min_only=True)[:count]
        for rows in (sources, targets)
    ]
    total = ways[0] + ways[1]
    total[~allowed] = np.inf
    least = float(total.min(initial=np.inf))
    return np.flatnonzero(total <= least + 4.0) if np.isfinite(least) else np.empty(0, dtype=np.int64)


def _first_contact(function: SeparationFunction | LoopFunction, free: Array, hit: Array) -> Array:
    """Return the free end of a bracket of contact between free points and points in contact, (N, 2) each.

    Beyond contact f may stay at zero. So guesses come from the free side: by Newton's method, then by a secant through
    the last two free points. A point slightly beyond the guess and one slightly before it are tried, so that the
    bracket closes around it. If a guess does not help, as at a kink, the bracket is halved.
    """
    along = hit - free
    low, high = np.zeros(len(free)), np.ones(len(free))
    value, gradient = function.value_gradient(free)
    slope = np.einsum("na,na->n", gradient, along)
    live = np.arange(len(free))
    for turn in range(_ROUNDS):
        near = _NEAR[min(turn // 2, len(_NEAR) - 1)]
        with np.errstate(invalid="ignore", divide="ignore"):
            guess = low[live] - value[live] / slope[live]
        asked = guess + (near if turn % 2 == 0 else -near)
        poor = ~((asked > low[live]) & (asked < high[live])) | (turn > _HALVING)
        asked = np.where(poor, 0.5 * (low[live] + high[live]), asked)
        found = function.value(free[live] + asked[:, None] * along[live])
        is_free = found > 0.0
        moved = live[is_free]
        slope[moved] = (found[is_free] - value[moved]) / (asked[is_free] - low[moved])
        low[moved], value[moved] = asked[is_free], found[is_free]
        high[live[~is_free]] = asked[~is_free]
        live = live[high[live] - low[live] > _BRACKET]
        if not len(live):
            break
    return free + low[:, None] * along
