"""One validator for all formats: raw items become records, and every fault is reported with its line."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from pinbound.annotations.marks import Box, Cylinder, Hull, Line, Mark, Plane, Point, Segment, Sweep, Vector
from pinbound.annotations.mesh_hulls import HullFiles, mesh_vertices
from pinbound.annotations.records import (
    FIELDS,
    FROM_FILE,
    KINDS,
    Axis,
    BoundaryMark,
    ClosureMark,
    FollowerMark,
    LeftOutMark,
    LimitMark,
    RawItem,
    Rule,
)
from pinbound.annotations.rules import read_axis, read_rule
from pinbound.exceptions import Problems, name_hint, printable
from pinbound.model.document import parse_floats
from pinbound.tolerances import CLOSURE, CONTACT, LONGEST

__all__ = ["sound_fields"]

_SEEN = "Use letters, digits and signs; no control or formatting characters"
_MOST_VERTICES = 100_000  # largest number of vertices of a hull; Qhull finds the extreme ones
_MOST_WAYS = 9  # largest number of edge vectors of a sweep, because each of its 2^k corners is used


def sound_fields(
    items: Collection[RawItem],
    problems: Problems,
    links: Collection[str] | None = None,
    joints: Collection[str] | None = None,
    files: HullFiles | None = None,
) -> dict[str, Any]:
    """Return the fields of `Annotations` from the valid items; every fault of the others goes to `problems`.

    Args:
        items: Raw items, inline ones and a sidecar's together.
        problems: Collects the faults.
        links: The robot's links; None: do not check the names.
        joints: The robot's joints; None: do not check the names.
        files: Reads the meshes that hulls name.
    """
    return _Validator(problems, links, joints, files or HullFiles()).fields(items)


class _Validator:
    """Converts raw items to annotations, one kind after the other, so that references can be checked."""

    def __init__(
        self, problems: Problems, links: Collection[str] | None, joints: Collection[str] | None, files: HullFiles
    ) -> None:
        self.problems, self.names, self.files = problems, {"link": links, "joint": joints}, files
        self.item = RawItem("", {}, problems.source, None)

    def fields(self, items: Collection[RawItem]) -> dict[str, Any]:
        by_kind: dict[str, list[RawItem]] = {}
        for item in items:
            by_kind.setdefault(item.kind, []).append(item)
        settings = self._once([*by_kind.get("settings", [])], "contact_tolerance")
        homes = by_kind.get("home", [])
        for extra in homes[1:]:
            self.item = extra
            self._fault("home is given twice", f"Keep one (the first is on line {homes[0].line})")
        marked = [item for kind in KINDS.values() for item in by_kind.get(kind, [])]
        marks = {mark.name: mark for mark in map(self._mark, self._unique(marked)) if mark}
        names = {str(item.fields.get("name")) for item in marked}
        boundaries = [self._boundary(i, marks, names) for i in self._unique(by_kind.get("boundary", []))]
        closures = [self._closure(item) for item in self._unique(by_kind.get("closure", []))]
        followers = [self._follower(item) for item in self._unique(by_kind.get("follower", []))]
        limits = [self._limit(item) for item in self._unique(by_kind.get("limit", []))]
        axes = [self._axis(item) for item in self._unique(by_kind.get("axis", []))]
        rules = [self._rule(item) for item in self._unique(by_kind.get("rule", []))]
        left_out = [self._left_out(item) for item in by_kind.get("left_out", []) if self._complete(item)]
        return {
            "contact_tolerance": settings,
            "home": self._home(homes[0]) if homes else {},
            "marks": marks,
            "boundaries": tuple(boundary for boundary in boundaries if boundary),
            "closures": tuple(closure for closure in closures if closure),
            "followers": tuple(follower for follower in followers if follower),
            "limits": tuple(limit for limit in limits if limit),
            "left_out": tuple(pair for pair in left_out if pair),
            "rules": tuple(rule for rule in rules if rule),
            "axes": tuple(axis for axis in axes if axis),
            "assumptions": tuple(
                printable(" ".join(str(item.fields["text"]).split()))
                for item in by_kind.get("assumption", [])
                if self._complete(item)
            ),
            "home_line": homes[0].line if homes else None,
            "sources": {self._known_as(item): item.source for item in items},
        }

    def _fault(self, message: str, remedy: str) -> None:
        self.problems.add(message, remedy, self.item.line, self.item.source)

    def _once(self, settings: list[RawItem], key: str) -> float:
        given = [item for item in settings if self._complete(item) and key in item.fields]
        for extra in given[1:]:
            if parse_floats(str(extra.fields[key]), 1) == parse_floats(str(given[0].fields[key]), 1):
                continue  # a sidecar may repeat a value of the URDF
            self.item = extra
            self._fault(f"{key} is given twice", f"Keep one (the first is on line {given[0].line})")
        if not given:
            return CONTACT
        self.item = given[0]
        return self._length(key, CONTACT)

    def _unique(self, items: list[RawItem]) -> list[RawItem]:
        first: dict[str, RawItem] = {}
        kept: list[RawItem] = []
        for item in items:
            self.item = item
            if not self._complete(item):
                continue
            name = self._name(item)
            if name in first:
                message = f"{item.kind} {name!r} is declared twice (first on line {first[name].line})"
                self._fault(message, "Rename one, or remove it")
                continue
            first[name] = item
            kept.append(item)
        return kept

    def _complete(self, item: RawItem) -> bool:
        """Report missing and unknown fields; return whether all required fields are given."""
        self.item = item
        required, optional = (FROM_FILE if "mesh" in item.fields else FIELDS).get(item.kind, FIELDS[item.kind])
        what = f"{item.kind} {self._name(item)!r}" if self._name(item) else f"a {item.kind}"
        either = item.kind in FROM_FILE and "mesh" in item.fields and "vertices" in item.fields
        if either:
            self._fault(f"{what} has vertices and a mesh", "Keep one of the two: a mesh has its own vertices")
        valid = (*required, *optional, *(["mesh"] if item.kind in FROM_FILE and "mesh" not in item.fields else []))
        for key in item.fields:
            if key not in valid and not (either and key == "vertices"):
                self._fault(f"{what} has the unknown attribute {key!r}", name_hint(key, valid))
        for key, value in item.fields.items():
            if key != "text" and printable(f"{key} {value}") != f"{key} {value}":
                self._fault(f"{what} has {key!r} = {value!r}, which holds invisible characters", _SEEN)
        missing = [key for key in required if not str(item.fields.get(key, "")).strip()]
        if missing:
            needs = f"{', '.join(required)}{' (or mesh)' if required[-1] == 'vertices' else ''}"
            self._fault(f"{what} has no {', no '.join(missing)}", f"It needs {needs}")
        return not missing and not either

    def _numbers(self, key: str, count: int) -> tuple[float, ...] | None:
        numbers = parse_floats(str(self.item.fields[key]), count)
        if isinstance(numbers, str):
            name = self._name(self.item)
            what = f"{self.item.kind} {name!r}" if name else self.item.kind
            self._fault(f"{key} of {what}: {numbers}", "Write finite numbers, metres or radians")
            return None
        return numbers

    def _vector(self, key: str) -> Vector | None:
        numbers = self._numbers(key, 3)
        return None if numbers is None else (numbers[0], numbers[1], numbers[2])

    def _length(self, key: str, default: float) -> float:
        """Return a length, which may be missing and must not be negative."""
        if key not in self.item.fields:
            return default
        numbers = self._numbers(key, 1)
        if numbers is None:
            return default
        if numbers[0] < 0.0:
            self._fault(f"{key} = {numbers[0]:g} is negative", "Give a length in metres, zero or more")
        return numbers[0]

    @staticmethod
    def _name(item: RawItem) -> str:
        """Return what identifies an item: its name, its joint, or its two links."""
        if item.kind == "left_out":
            return "-".join(str(item.fields[key]) for key in ("a", "b") if item.fields.get(key))
        return str(item.fields.get("name") or item.fields.get("joint") or "")

    def _known_as(self, item: RawItem) -> str:
        """Return the key of an item in `Annotations.sources`."""
        return item.kind if item.kind in ("home", "settings") else f"{item.kind} {self._name(item)}"

    def _known(self, thing: str, name: str) -> str | None:
        """Return the name of a link or joint, if the robot has it."""
        valid = self.names[thing]
        if valid is None or name in valid:
            return name
        what = f"{self.item.kind} {self._name(self.item)!r}"
        self._fault(f"{what} names the {thing} {name!r}, which does not exist", name_hint(name, valid))
        return None

    def _link(self, key: str) -> str | None:
        return self._known("link", str(self.item.fields[key]))

    def _joint(self, key: str) -> str | None:
        return self._known("joint", str(self.item.fields[key]))

    def _mark(self, item: RawItem) -> Mark | None:
        self.item = item
        name, link, radius = str(item.fields["name"]), self._link("link"), self._length("radius", 0.0)
        if item.kind == "sweep":
            return self._sweep(name, link, radius)
        if item.kind == "hull":
            return self._hull(name, link, radius)
        if item.kind in ("box", "cylinder"):
            return self._sized(item.kind, name, link, radius)
        vectors = [self._vector(key) for key in FIELDS[item.kind][0][2:]]
        if item.kind in ("line", "plane") and vectors[1] is not None and not any(vectors[1]):
            key = FIELDS[item.kind][0][3]
            self._fault(f"{key} of {item.kind} {name!r} is zero", "Give a vector of any length but zero")
            return None
        given = [vector for vector in vectors if vector is not None]
        if link is None or len(given) < len(vectors):
            return None
        first, *others = given
        if item.kind == "point":
            return Point(name, link, first, radius, item.line)
        if item.kind == "segment":
            return Segment(name, link, first, others[0], radius, item.line)
        if item.kind == "line":
            return Line(name, link, first, others[0], radius, item.line)
        return Plane(name, link, first, others[0], item.line)

    def _sweep(self, name: str, link: str | None, radius: float) -> Sweep | None:
        xyz, words = self._vector("xyz"), str(self.item.fields["ways"]).split()
        if len(words) % 3 or len(words) > 3 * _MOST_WAYS:
            said = f"ways of sweep {name!r} are {len(words)} numbers"
            self._fault(said, f"Give three numbers for each way (edge vector), up to {_MOST_WAYS} ways")
            return None
        numbers = self._numbers("ways", len(words))
        if link is None or xyz is None or numbers is None:
            return None
        ways = [(numbers[i], numbers[i + 1], numbers[i + 2]) for i in range(0, len(numbers), 3)]
        if not all(map(any, ways)):
            self._fault(f"a way of sweep {name!r} is zero", "Leave it out")
            return None
        return Sweep(name, link, xyz, tuple(ways), radius, self.item.line)

    def _within(self, hull: Hull) -> Hull | None:
        """Return a hull whose vertices are not too far from its link."""
        longest = max(abs(x) for vertex in hull.vertices for x in vertex)
        if longest > LONGEST:
            said = f"a vertex of hull {hull.name!r} is {longest:.3g} m from the origin of its link"
            self._fault(said, f"Give metres; lengths up to {LONGEST:.0e} m can be measured")
            return None
        return hull

    def _hull(self, name: str, link: str | None, radius: float) -> Hull | None:
        if "mesh" in self.item.fields:
            found = mesh_vertices(self.item, self.files, self._vector, self._fault)
            if link is None or found is None:
                return None
            return self._within(Hull(name, link, tuple(map(tuple, found.tolist())), radius, self.item.line))
        words = str(self.item.fields["vertices"]).split()
        if len(words) % 3 or len(words) > 3 * _MOST_VERTICES:
            said = f"vertices of hull {name!r} are {len(words)} numbers"
            self._fault(said, f"Give three numbers for each vertex, up to {_MOST_VERTICES} vertices")
            return None
        numbers = self._numbers("vertices", len(words))
        if link is None or numbers is None:
            return None
        vertices = tuple((numbers[i], numbers[i + 1], numbers[i + 2]) for i in range(0, len(numbers), 3))
        return self._within(Hull(name, link, vertices, radius, self.item.line))

    def _sized(self, kind: str, name: str, link: str | None, radius: float) -> Box | Cylinder | None:
        keys = ("xyz", "rpy", "size") if kind == "box" else ("xyz_a", "xyz_b")
        vectors = [vector for vector in map(self._vector, keys) if vector is not None]
        if link is None or len(vectors) < len(keys):
            return None
        if kind == "box":
            xyz, rpy, size = vectors
            if min(size) < 0.0:
                self._fault(f"size of box {name!r} holds {min(size):g}", "Give lengths in metres, zero or more")
                return None
            return Box(name, link, xyz, rpy, size, radius, self.item.line)
        if max(radius, *(abs(x) for vector in vectors for x in vector)) > LONGEST:
            self._fault(f"cylinder {name!r} is longer than {LONGEST:.0e} m", "Give metres")
            return None
        if vectors[0] == vectors[1]:
            self._fault(f"cylinder {name!r} has no length: xyz_a and xyz_b are equal", "Give its two ends")
            return None
        return Cylinder(name, link, vectors[0], vectors[1], radius, self.item.line)

    def _boundary(self, item: RawItem, marks: dict[str, Mark], marked: set[str]) -> BoundaryMark | None:
        self.item = item
        name, a, b = (str(item.fields[key]) for key in ("name", "a", "b"))
        for end in (a, b):
            if end not in marked:
                self._fault(f"boundary {name!r} names {end!r}, which is not marked", name_hint(end, marks))
        distance = self._length("min_distance", 0.0)
        if a not in marks or b not in marks:
            return None
        if marks[a].link == marks[b].link:
            self._fault(
                f"boundary {name!r}: both marks are on link {marks[a].link!r}, so their distance never changes",
                "Name marks of two different links",
            )
            return None
        if marks[a].shape.is_unbounded and marks[b].shape.is_unbounded:
            self._fault(
                f"boundary {name!r}: {a!r} and {b!r} are infinite lines or planes, which intersect in almost "
                "every configuration",
                "Make one of the two marks a point, a segment or a body",
            )
            return None
        return BoundaryMark(name, a, b, distance, self._stop(name, (marks[a], marks[b]), distance), item.line)

    def _stop(self, name: str, ends: tuple[Mark, Mark], distance: float) -> bool:
        """Return whether a boundary is declared as a stop; only two points of zero threshold can be one."""
        if not self._said("stop", f"boundary {name!r}"):
            return False
        bodies = [mark.name for mark in ends if not mark.shape.is_point]
        round_ones = [mark.name for mark in ends if mark.shape.is_point and mark.shape.radius > 0.0]
        why = ""
        if bodies:
            why = f"{' and '.join(bodies)} {'is no point' if len(bodies) == 1 else 'are no points'}"
        elif round_ones:
            why = f"{' and '.join(round_ones)} {'has a radius' if len(round_ones) == 1 else 'have radii'}"
        elif distance > 0.0:
            why = f"min_distance is {distance:g}"
        if why:
            self._fault(
                f"boundary {name!r} is declared as a stop, but {why}",
                "A stop is two points of radius 0, without min_distance, whose lever arms align at contact. "
                "Give it such points, or remove stop: "
                "other boundaries are in contact where their distance is the threshold",
            )
        return not why

    def _closure(self, item: RawItem) -> ClosureMark | None:
        self.item = item
        link_a, link_b = self._link("link_a"), self._link("link_b")
        xyz_a, xyz_b = self._vector("xyz_a"), self._vector("xyz_b")
        if link_a is None or link_b is None or xyz_a is None or xyz_b is None:
            return None
        if link_a == link_b:
            self._fault(f"closure {item.fields['name']!r} joins link {link_a!r} to itself", "Name two links")
            return None
        tolerance = self._length("tolerance", CLOSURE)
        name, passive, active = str(item.fields["name"]), self._joints("passive"), self._joints("active")
        for both in set(passive) & set(active):
            self._fault(f"closure {name!r} names {both!r} as passive and as active", "Name it once")
        weld = self._said("weld", f"closure {name!r}")
        return ClosureMark(name, link_a, xyz_a, link_b, xyz_b, passive, tolerance, item.line, active, weld)

    def _said(self, key: str, what: str) -> bool:
        """Return a field that is true or false; false if it is missing."""
        said = str(self.item.fields.get(key, "false"))
        if said not in ("true", "false"):
            self._fault(f"{key} of {what} is {said!r}", "Write true or false")
        return said == "true"

    def _joints(self, key: str) -> tuple[str, ...]:
        """Return the joints of a list or a text; names in a text may contain spaces if only one reading is known."""
        given: str | tuple[str, ...] = self.item.fields.get(key, ())
        if isinstance(given, str):
            words = given.split()
            readings = _readings(words, self.names["joint"] or ())
            if len(readings) > 1:
                said = f"{key} = {given!r} of closure {self._name(self.item)!r} can be read as "
                said += " or ".join(repr(list(one)) for one in readings)
                self._fault(said, "Name the joints in a list, in a YAML sidecar")
                return ()
            given = readings[0] if readings else tuple(words)
        return tuple(name for name in given if self._known("joint", name) is not None)

    def _follower(self, item: RawItem) -> FollowerMark | None:
        self.item = item
        joint, primary = self._joint("joint"), self._joint("primary")
        multiplier = self._numbers("multiplier", 1) if "multiplier" in item.fields else (1.0,)
        offset = self._numbers("offset", 1) if "offset" in item.fields else (0.0,)
        if joint is None or primary is None or multiplier is None or offset is None:
            return None
        return FollowerMark(joint, primary, multiplier[0], offset[0], item.line)

    def _limit(self, item: RawItem) -> LimitMark | None:
        self.item = item
        joint, lower, upper = self._joint("joint"), self._numbers("lower", 1), self._numbers("upper", 1)
        if joint is None or lower is None or upper is None:
            return None
        if lower[0] > upper[0]:
            self._fault(f"limit of {joint!r} has lower {lower[0]:g} above upper {upper[0]:g}", "Swap them")
            return None
        return LimitMark(joint, lower[0], upper[0], item.line)

    def _rule(self, item: RawItem) -> Rule | None:
        self.item = item
        name = str(item.fields["name"])
        if name in (self.names["joint"] or ()):
            self._fault(f"rule {name!r} has the name of a joint", "Give it a name of its own, e.g. 'coupling'")
        return read_rule(item, self._fault, lambda joint: self._known("joint", joint) is not None)

    def _axis(self, item: RawItem) -> Axis | None:
        self.item = item
        if item.fields["name"] in (self.names["joint"] or ()):
            self._fault(f"axis {item.fields['name']!r} has the name of a joint", "Give it a name of its own")
        return read_axis(item, self._fault, lambda joint: self._known("joint", joint) is not None)

    def _left_out(self, item: RawItem) -> LeftOutMark | None:
        self.item = item
        a, b, reason = (str(item.fields[key]).strip() for key in ("a", "b", "reason"))
        if a == b:
            self._fault(f"left_out {self._name(item)!r} names one link twice", "Name two links")
            return None
        # An SRDF may name links of a larger robot; `robot.coverage.notes` lists these links.
        if not item.source.endswith(".srdf") and None in [self._link(key) for key in ("a", "b")]:
            return None
        return LeftOutMark(a, b, reason, item.source, item.line)

    def _home(self, item: RawItem) -> dict[str, float]:
        self.item = item
        home: dict[str, float] = {}
        for name in item.fields:
            if printable(name) != name:
                self._fault(f"home has the name {name!r}, which holds invisible characters", _SEEN)
            numbers = self._numbers(name, 1)
            if numbers is not None:
                home[name] = numbers[0]
        return home


def _readings(words: Sequence[str], names: Collection[str]) -> list[tuple[str, ...]]:
    """Return every way (at most three) to read words as names, which may contain spaces."""
    if not words:
        return [()]
    found: list[tuple[str, ...]] = []
    for count in range(1, len(words) + 1):
        name = " ".join(words[:count])
        if name in names:
            found += [(name, *rest) for rest in _readings(words[count:], names)]
        if len(found) > 2:
            break
    return found[:3]
