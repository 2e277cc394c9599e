"""COLLADA (DAE): the polygons of the geometries in a scene, read as by Pinocchio's loader.

The transformations of every node are applied. The unit of the file and its up-axis are not applied: assimp stores both
in the root of its scene, and Pinocchio's loader ignores the transformation of the root.
"""

from __future__ import annotations

import math

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from pinbound.meshes.mesh import numbers, refuse, too_many

__all__ = ["read_dae"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Piece = tuple[Array, Ints, Ints]

_MOST_NODES = 20_000
_DEEPEST = 64
_DRAWN = ("triangles", "polylist", "polygons", "trifans", "tristrips")
_MEND = "Export the mesh again"
_UP = "Z_UP"


def read_dae(data: bytes, source: str) -> tuple[Array, Ints, Ints, tuple[str, ...]]:
    """Return vertices, triangles, the polygon from which each triangle was cut, and notes.

    Raises:
        InputError: If it is not a COLLADA file, or if a part of the file is damaged or missing.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=True)
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        refuse(source, f"is no XML ({' '.join(str(error).split())[:80]})", _MEND, getattr(error, "lineno", None))
    if root.getroottree().docinfo.internalDTD is not None:
        refuse(source, "declares a document type, which may hold entities", "Remove the <!DOCTYPE ...>")
    if _name(root) != "COLLADA":
        refuse(source, f"is not a COLLADA file: its root is <{_name(root)[:40]}>", _MEND)
    return _Reader(root, source).read()


class _Reader:
    """Reads one file: it finds elements by id, and walks the scene once."""

    def __init__(self, root: etree._Element, source: str) -> None:
        self.root, self.source = root, source
        self.by_id: dict[str, etree._Element] = {}
        for element in root.iter(etree.Element):
            key = element.get("id")
            if key is not None:
                self.by_id.setdefault(key, element)
        self.geometries: dict[int, list[Piece]] = {}
        self.nodes = self.count = 0
        self.notes: list[str] = []

    def read(self) -> tuple[Array, Ints, Ints, tuple[str, ...]]:
        instance = next((one for one in self.root.iterfind("{*}scene/{*}instance_visual_scene")), None)
        if instance is None:
            refuse(self.source, "has no <instance_visual_scene>, so it places no geometry", _MEND)
        scene = self._referred(instance, "visual_scene")
        pieces: list[Piece] = []
        for node in _children(scene, "node"):
            pieces += self._node(node, np.eye(4), 0)
        vertices = np.vstack([one[0] for one in pieces]) if pieces else np.zeros((0, 3))
        starts = np.cumsum([0, *(len(one[0]) for one in pieces)])
        counts = np.cumsum([0, *(int(one[2][-1]) + 1 if len(one[2]) else 0 for one in pieces)])
        triangles = [one[1] + start for one, start in zip(pieces, starts[:-1], strict=True)]
        polygons = [one[2] + count for one, count in zip(pieces, counts[:-1], strict=True)]
        self._asset()
        empty = np.zeros((0, 3), dtype=np.int64)
        return vertices, np.vstack([empty, *triangles]), np.concatenate([empty[:, 0], *polygons]), tuple(self.notes)

    def _asset(self) -> None:
        unit = next(self.root.iterfind("{*}asset/{*}unit"), None)
        meter = "1" if unit is None else unit.get("meter", "1")
        axis = (self.root.findtext("{*}asset/{*}up_axis") or "Y_UP").strip()
        try:
            is_metre = float(meter) == 1.0
        except ValueError:
            is_metre = False
        said = ([] if is_metre else [f"its unit of {meter[:20]} m"]) + ([] if axis == _UP else [f"its {axis[:20]}"])
        if said:
            self.notes.append(f"{' and '.join(said)} {'are' if len(said) > 1 else 'is'} not applied, as in Pinocchio")

    def _node(self, node: etree._Element, above: Array, depth: int) -> list[Piece]:
        self.nodes += 1
        if depth > _DEEPEST or self.nodes > _MOST_NODES:
            refuse(self.source, f"nests nodes deeper than {_DEEPEST}, or has more than {_MOST_NODES}", _MEND)
        matrix, found = above, list[Piece]()
        for child in node.iterchildren(etree.Element):
            step = self._step(child)
            if step is not None:
                matrix = matrix @ step
        for child in node.iterchildren(etree.Element):
            kind = _name(child)
            if kind == "node":
                found += self._node(child, matrix, depth + 1)
            elif kind == "instance_node":
                found += self._node(self._referred(child, "node"), matrix, depth + 1)
            elif kind in ("instance_geometry", "instance_controller"):
                found += self._placed(child, kind, matrix)
        return found

    def _placed(self, instance: etree._Element, kind: str, matrix: Array) -> list[Piece]:
        if kind == "instance_controller":
            skin = next(self._referred(instance, "controller").iterfind("{*}skin"), None)
            if skin is None:
                refuse(self.source, "has a <controller> without <skin>", _MEND, instance.sourceline)
            self.notes.append("bones are not read: the mesh is taken in its rest pose")
            geometry = self._referred(skin, "geometry", "source")
        else:
            geometry = self._referred(instance, "geometry")
        if id(geometry) not in self.geometries:
            self.geometries[id(geometry)] = [
                self._drawn(one, mesh) for mesh in _children(geometry, "mesh") for one in _children(mesh, *_DRAWN)
            ]
        pieces = self.geometries[id(geometry)]
        self.count += sum(len(one[1]) for one in pieces)
        too_many(self.source, self.count)
        with np.errstate(over="ignore", invalid="ignore"):
            return [(v @ matrix[:3, :3].T + matrix[:3, 3], triangles, polygons) for v, triangles, polygons in pieces]

    def _referred(self, element: etree._Element, kind: str, key: str = "url") -> etree._Element:
        address = element.get(key, "")
        found = self.by_id.get(address[1:]) if address[:1] == "#" else None
        if found is None or (kind and _name(found) != kind):
            said = f"<{_name(element)}> names {address[:60]!r}, which is no <{kind or 'source'}> of this file"
            refuse(self.source, said, _MEND, element.sourceline)
        return found

    def _step(self, element: etree._Element) -> Array | None:
        """Return the matrix of one transformation of a node; None if the element is not a transformation."""
        kind, count = _name(element), {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3, "lookat": 9, "skew": 7}
        if kind not in count:
            return None
        values = self._numbers(element, count[kind])
        step = np.eye(4)
        if kind == "matrix":
            step = values.reshape(4, 4)
            if not np.array_equal(step[3], (0.0, 0.0, 0.0, 1.0)):
                refuse(self.source, "the last row of a <matrix> is not 0 0 0 1", _MEND, element.sourceline)
        elif kind == "translate":
            step[:3, 3] = values
        elif kind == "scale":
            step[:3, :3] = np.diag(values)
        elif kind == "rotate":
            length = float(np.linalg.norm(values[:3]))
            if not length > 0.0:
                refuse(self.source, "a <rotate> has no axis", _MEND, element.sourceline)
            x, y, z = values[:3] / length
            angle = math.radians(values[3])
            c, s = math.cos(angle), math.sin(angle)
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            step[:3, :3] = c * np.eye(3) + s * cross + (1.0 - c) * np.outer((x, y, z), (x, y, z))
        else:
            refuse(self.source, f"a node has a <{kind}>", "Export the mesh again", element.sourceline)
        return step

    def _numbers(self, element: etree._Element, count: int) -> Array:
        found = numbers(self.source, element.text, f"<{_name(element)}>", element.sourceline)
        if len(found) != count:
            said = f"<{_name(element)}> has {len(found)} numbers, not {count}"
            refuse(self.source, said, _MEND, element.sourceline)
        if not np.all(np.isfinite(found)):
            refuse(self.source, f"<{_name(element)}> holds a number that is not finite", _MEND, element.sourceline)
        return found

    def _drawn(self, element: etree._Element, mesh: etree._Element) -> Piece:
        """Return vertices, triangles and polygons of one element that has polygons, such as <triangles>, <polylist>."""
        kind, line = _name(element), element.sourceline
        said = element.get("count", "")
        if kind in ("triangles", "polylist") and said.isdigit():
            too_many(self.source, int(said[:12]))
        inputs = _children(element, "input")
        vertex = next((one for one in inputs if one.get("semantic") == "VERTEX"), None)
        if vertex is None:
            refuse(self.source, f"<{kind}> has no input VERTEX", _MEND, line)
        offsets = [self._offset(one) for one in inputs]
        stride, offset = max(offsets) + 1, self._offset(vertex)
        runs = [self._indices(one, stride)[:, offset] for one in _children(element, "p")]
        if next(element.iterfind("{*}ph"), None) is not None:
            refuse(self.source, "a polygon has a hole (<ph>)", "Export the surface as triangles", line)
        lengths = [len(run) for run in runs]
        if kind in ("triangles", "polylist"):
            run = np.concatenate([*runs, np.zeros(0, dtype=np.int64)])
            if kind == "triangles":
                sizes = np.full(len(run) // 3, 3)
            else:
                listed = [n for one in _children(element, "vcount") for n in self._indices(one, 1)[:, 0].tolist()]
                sizes = np.array(listed, dtype=np.int64)
            if sizes.sum() != len(run):
                refuse(self.source, f"<{kind}> has {len(run)} corners, not {int(sizes.sum())}", _MEND, line)
            if said.isdigit() and int(said[:12]) != len(sizes):
                refuse(self.source, f"<{kind}> has {len(sizes)} polygons, not {said[:12]}", _MEND, line)
            triangles, polygons = _fans(run, sizes)
        elif kind == "tristrips":
            strips = [np.column_stack((run[:-2], run[1:-1], run[2:])) for run in runs if len(run) > 2]
            triangles = np.vstack([np.zeros((0, 3), dtype=np.int64), *strips])
            polygons = np.arange(len(triangles))
        else:
            run = np.concatenate([*runs, np.zeros(0, dtype=np.int64)])
            triangles, polygons = _fans(run, np.array(lengths, dtype=np.int64))
            polygons = np.arange(len(triangles)) if kind == "trifans" else polygons
        return self._positions(vertex, mesh), triangles, polygons

    def _offset(self, element: etree._Element) -> int:
        text = element.get("offset", "0")
        if not text.isdigit() or len(text) > 3:
            refuse(self.source, f"the offset of an <input> is {text[:20]!r}", _MEND, element.sourceline)
        return int(text)

    def _indices(self, element: etree._Element, stride: int) -> Ints:
        found = numbers(self.source, element.text, f"<{_name(element)}>", element.sourceline)
        if len(found) % stride or not np.all((found >= 0) & (found < 2.0**31) & (found == np.floor(found))):
            said = (
                f"<{_name(element)}> holds something that is not an index, or an incomplete corner (each "
                f"has {stride} numbers)"
            )
            refuse(self.source, said, _MEND, element.sourceline)
        too_many(self.source, len(found) // (9 * stride))
        return found.astype(np.int64).reshape(-1, stride)

    def _positions(self, vertex: etree._Element, mesh: etree._Element) -> Array:
        vertices = self._referred(vertex, "vertices", "source")
        position = next((one for one in _children(vertices, "input") if one.get("semantic") == "POSITION"), None)
        if position is None:
            refuse(self.source, "<vertices> has no input POSITION", _MEND, vertices.sourceline)
        source = self._referred(position, "source", "source")
        accessor = next(source.iterfind("{*}technique_common/{*}accessor"), None)
        if accessor is None:
            refuse(self.source, "the source of the positions has no <accessor>", _MEND, source.sourceline)
        values = self._referred(accessor, "float_array", "source")
        array = numbers(self.source, values.text, "<float_array>", values.sourceline)
        said = values.get("count", str(len(array)))
        if said != str(len(array)):
            refuse(self.source, f"a <float_array> has {len(array)} numbers, not {said[:20]}", _MEND, values.sourceline)
        count, stride, start = (
            self._whole(accessor, key, one) for key, one in (("count", 0), ("stride", 1), ("offset", 0))
        )
        names = [str(one.get("name", "")).upper() for one in _children(accessor, "param")]
        places = [names.index(axis) if axis in names else place for place, axis in enumerate("XYZ")]
        if stride < 3 or max(places) >= stride or start + count * stride > len(array):
            refuse(self.source, "an <accessor> reaches beyond its numbers", _MEND, accessor.sourceline)
        return array[start : start + count * stride].reshape(count, stride)[:, places]

    def _whole(self, element: etree._Element, key: str, default: int) -> int:
        text = element.get(key, str(default))
        if not text.isdigit() or len(text) > 9:
            refuse(self.source, f"{key} of an <{_name(element)}> is {text[:20]!r}", _MEND, element.sourceline)
        return int(text)


def _fans(run: Ints, sizes: Ints) -> tuple[Ints, Ints]:
    """Return the triangles of polygons, and the polygon of each; `run` has all corners, `sizes` their numbers."""
    ends = np.cumsum(sizes)
    starts, cuts = ends - sizes, np.maximum(sizes - 2, 0)
    polygons = np.repeat(np.arange(len(sizes)), cuts)
    first = starts[polygons]
    place = np.arange(len(polygons)) - np.repeat(np.cumsum(cuts) - cuts, cuts) + 1
    return np.column_stack((run[first], run[first + place], run[first + place + 1])), polygons


def _name(element: etree._Element) -> str:
    return etree.QName(element).localname


def _children(element: etree._Element, *names: str) -> list[etree._Element]:
    return [child for child in element.iterchildren(etree.Element) if _name(child) in names]
