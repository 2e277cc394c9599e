"""The effect of different sides on a linkage: passive joints of its loops get bounded deviations from the coupling.

Each loop that is not exact is *opened* at two passive joints. They may deviate from the coupling, all other joints
respond, and the geometry of the loop bounds the deviation (`planar_loops.deviations`). Loops that share joints respond
to each other's deviations. `docs/closures.md` has the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pinbound.annotations import Annotations, ClosureMark
from pinbound.exceptions import Problems
from pinbound.loops.closures import Closure, Deviation, augmented, close
from pinbound.loops.parallelograms import Settled
from pinbound.loops.planar_loops import Parallelogram, Refusal, Side, apart_along, deviations, parallelogram
from pinbound.model.coupling import Coupling, LinearLimit, couple, linear_text
from pinbound.model.tree import Tree
from pinbound.tolerances import DEVIATION, EXACT_LOOP, LIMIT
from pinbound.typing import Array

__all__ = ["carry", "narrowed"]

_ROUNDS = 50
_GROWTH = 1.0 + 1e-6
_SUGGESTED = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0)  # degrees from flat
_COMFORTABLE = 1e-3  # radians: an error that a suggestion leaves


@dataclass
class _Opened:
    """A loop with two passive joints that may deviate.

    Attributes:
        closure: The loop, its path over q and every deviation.
        joints: The two passive joints.
        responses: (n_tree,) each, the responses of all tree joints to them.
        bounds: (2,) [rad], bounds of their deviations.
    """

    closure: Closure
    joints: tuple[str, str]
    responses: list[Array]
    bounds: Array


@dataclass(frozen=True, eq=False)
class _Shape:
    """The dependence of a loop's deviations on its shape `phi = at + coefficients @ (q, d)`.

    Attributes:
        found: The loop.
        own: Indices of its own deviations among all coordinates.
        inverse: (2, 2), from the angles between opposite sides to the deviations of the joints.
        coefficients: (N,) of the angle between the two sides that its passive joints do not rotate.
        at: [rad]; flat poses are at multiples of pi.
        swing: Largest rotation of a small side per radian between opposite sides.
    """

    found: Parallelogram
    own: list[int]
    inverse: Array
    coefficients: Array
    at: float
    swing: float

    def bounds(self, span: tuple[float, float]) -> Array | None:
        """Return bounds (2,) [rad] of the passive joints' deviations while phi is in a range; None without a bound."""
        (a, b), (c, d) = self.found.pairs
        lengths = min(a.length, b.length), min(c.length, d.length)
        small, skew = sum(side.length for side in self.found.small), np.abs(self.found.constant)
        wide = float(skew.sum())
        mismatch = self.found.mismatch
        delta = deviations(lengths, mismatch, small, self.swing, (span[0] - wide, span[1] + wide))
        return None if delta is None else np.abs(self.inverse) @ (np.array(delta) + skew)


class _Linkage:
    """All loops of a robot, and the known bounds of their deviations."""

    def __init__(self, tree: Tree, settled: Settled, annotations: Annotations, limits: Sequence[LinearLimit]) -> None:
        self.tree, self.settled, self.coupling, self.limits = tree, settled, settled.coupling, limits
        self.home = np.array([annotations.home.get(name, 0.0) for name in self.coupling.coordinates])
        self.opened: dict[str, _Opened] = {}
        self.sources = annotations.sources

    def place(self, mark: ClosureMark) -> tuple[int | None, str | None]:
        """Return line and file of a closure."""
        return mark.line, self.sources.get(f"closure {mark.name}")

    @property
    def n(self) -> int:
        return len(self.coupling.coordinates)

    def columns(self) -> list[tuple[str, Array]]:
        return [pair for one in self.opened.values() for pair in zip(one.joints, one.responses, strict=True)]

    def whole(self, more: Sequence[tuple[str, Array]] = ()) -> Coupling:
        return augmented(self.coupling, [*self.columns(), *more])

    def own(self, name: str) -> list[int]:
        start = self.n + 2 * list(self.opened).index(name)
        return [start, start + 1]

    def shape(self, closure: Closure, names: Sequence[str], own: list[int]) -> _Shape | Refusal:
        """Return the shape on which a loop's deviations depend; `own` are the indices of its two passive joints."""
        count = len(names)
        reference = np.concatenate((self.home, np.zeros(count - self.n)))
        found = parallelogram(closure, names, reference, np.eye(count)[:, : self.n])
        if isinstance(found, Refusal):
            return found
        rows = found.rows[:, own]
        if np.linalg.matrix_rank(rows) < len(own):
            return Refusal(f"{names[own[0]]!r} and {names[own[1]]!r} do not move in it", "Name other passive joints")
        inverse: Array = np.linalg.inv(rows).astype(np.float64)
        held = next((pair for pair in _adjacent(found) if _fixed(pair, own)), None)
        if held is None:
            return Refusal("its passive joints move all of its sides", "Name other passive joints")
        first, second = held
        swings = [np.abs((side.angle - first.angle)[own] @ inverse).max() for side in found.small]
        c = second.angle - first.angle
        return _Shape(found, own, inverse, c, found.shape - float(c @ reference), float(max(swings, default=0.0)))

    def open(self, closure: Closure) -> tuple[_Opened, _Shape] | Refusal:
        """Return a loop opened at the first two possible passive joints; joints furthest from the root come first."""
        name, mark = closure.name, closure.mark
        between = [j.name for j in self.tree.path_between(mark.link_a, mark.link_b) if j.moves]
        follow = [joint for joint in between if joint not in self.coupling.coordinates]
        depth = {joint.name: level for _, joint, level in self.tree.walk() if joint is not None}
        order = sorted(follow, key=lambda joint: (-depth[joint], -self.coupling.joints.index(joint)))
        given = self.settled.passive.get(name) or tuple(joint for joint in mark.passive if joint in follow)
        pairs = [given] if len(given) == 2 else list(combinations(order, 2))
        refusal = Refusal("it has no two passive joints", "Couple two joints of the loop, or leave them free")
        for pair in pairs:
            first, second = pair
            responses = self._responses(first, second)
            names = [*self.whole().coordinates, first, second]
            path = close(self.tree, self.whole(list(zip(pair, responses, strict=True))), mark)
            found = self.shape(path, names, [len(names) - 2, len(names) - 1])
            if isinstance(found, _Shape):
                return _Opened(path, (first, second), responses, np.zeros(2)), found
            refusal = found
        return refusal

    def _responses(self, first: str, second: str) -> list[Array]:
        """Return the responses of all tree joints to two deviating joints: mimic joints follow them."""
        loose = [replace(j, mimic=None) if j.name in (first, second) else j for j in self.tree.moving_joints]
        raw = couple(loose)
        return [raw.S[:, raw.coordinates.index(name)].copy() for name in (first, second)]

    def answer(self) -> str | None:
        """Let all loops respond to each other's deviations; return the name of a loop that cannot."""
        for _ in range(2 * len(self.settled.closures) + 2):
            changed = False
            for closure in self.settled.closures:
                if closure.name not in self.opened:
                    if close(self.tree, self.whole(), closure.mark).is_exact:
                        continue
                    found = self.open(closure)
                    if isinstance(found, Refusal):
                        return closure.name
                    self.opened[closure.name] = found[0]
                    changed = True
                shape = self.now(closure.name)
                if isinstance(shape, Refusal):
                    return closure.name
                changed |= self._respond(closure.name, shape)
            if not changed:
                return None
        return self.settled.closures[0].name

    def now(self, name: str) -> _Shape | Refusal:
        """Return the shape of an opened loop, when the deviations of all loops are known."""
        whole = self.whole()
        self.opened[name].closure = close(self.tree, whole, self.opened[name].closure.mark)
        return self.shape(self.opened[name].closure, whole.coordinates, self.own(name))

    def _respond(self, name: str, shape: _Shape) -> bool:
        """Let a loop's passive joints respond to the deviations of others; return whether they had to."""
        changed, mine = False, self.opened[name]
        for other, one in self.opened.items():
            if other == name:
                continue
            for place, index in enumerate(self.own(other)):
                needed = -shape.inverse @ shape.found.rows[:, index]
                if np.any(np.abs(needed) > EXACT_LOOP):
                    one.responses[place] = one.responses[place] + np.array(mine.responses).T @ needed
                    changed = True
        return changed

    def span(self, shape: _Shape) -> tuple[float, float]:
        """Return the range of a loop's shape [rad] within all joint limits, with the deviations of the other loops."""
        lower, upper = _range(shape.coefficients[: self.n], self.limits)
        others = np.concatenate([one.bounds for one in self.opened.values()]) if self.opened else np.zeros(0)
        tail = np.abs(shape.coefficients[self.n :][: len(others)])
        wide = float(tail @ others) + LIMIT * (1.0 + float(np.abs(shape.coefficients).sum()))
        return shape.at + lower - wide, shape.at + upper + wide


def _adjacent(found: Parallelogram) -> list[tuple[Side, Side]]:
    return [(first, second) for first in found.pairs[0] for second in found.pairs[1]]


def _fixed(pair: tuple[Side, Side], own: list[int]) -> bool:
    return bool(np.abs((pair[1].angle - pair[0].angle)[own]).max() <= EXACT_LOOP)


def _range(c: Array, limits: Sequence[LinearLimit]) -> tuple[float, float]:
    """Return an interval that contains `c @ q` while all limits are kept, from coordinates and from parallel limits."""
    lower = upper = 0.0
    for index in np.flatnonzero(c):
        one = np.zeros(len(c))
        one[index] = c[index]
        low, high = _parallel(one, limits)
        lower, upper = lower + low, upper + high
    low, high = _parallel(c, limits)
    return max(lower, low), min(upper, high)


def _parallel(c: Array, limits: Sequence[LinearLimit]) -> tuple[float, float]:
    lower, upper = -math.inf, math.inf
    for limit in limits:
        factor = _factor(c, limit.coefficients)
        if factor is not None:
            ends = sorted(factor * (end - limit.offset) for end in (limit.lower, limit.upper))
            lower, upper = max(lower, ends[0]), min(upper, ends[1])
    return lower, upper


def _factor(c: Array, other: Array) -> float | None:
    """Return t with `c = t other`; None if there is none, or c is zero."""
    used = np.flatnonzero(other)
    if not len(used) or not np.any(c):
        return None
    t = float(c[used[0]] / other[used[0]])
    return t if t and np.array_equal(c, t * other) else None


def carry(
    tree: Tree, settled: Settled, annotations: Annotations, limits: Sequence[LinearLimit], problems: Problems
) -> tuple[tuple[Closure, ...], list[str]]:
    """Return the closures with the deviations of their passive joints, and notes about them.

    Args:
        tree: The robot's tree.
        settled: The closures and the coupling.
        annotations: The robot's annotations; home is the assembled pose.
        limits: All joint limits, in terms of q.
        problems: Collects loops whose error cannot be bounded.
    """
    linkage, notes = _Linkage(tree, settled, annotations, limits), list[str]()
    for closure in settled.closures:
        if closure.is_exact:
            found = linkage.open(closure) if settled.passive.get(closure.name) else Refusal("", "")
            if not isinstance(found, Refusal):
                notes += _flat_note(linkage, closure, found[1])
            continue
        if not any(joint.moves for joint in tree.path_between(closure.mark.link_a, closure.mark.link_b)):
            continue  # both ends are on one rigid body: nothing can move
        found = linkage.open(closure)
        if isinstance(found, Refusal):
            message = f"closure {closure.name!r}: its ends are up to {1e3 * closure.bound:.3g} mm apart, and the error"
            said = f"{message} of its links has no bound: {found.reason}"
            problems.add(said, found.remedy, *linkage.place(closure.mark))
            return settled.closures, notes
        linkage.opened[closure.name] = found[0]
    if not linkage.opened:
        return settled.closures, notes
    lost = linkage.answer()
    if lost is not None:
        mark = next(closure.mark for closure in settled.closures if closure.name == lost)
        message = f"closure {lost!r} shares joints with loops whose sides differ, and its response to them has no bound"
        problems.add(message, "Give these loops equal sides", *linkage.place(mark))
        return settled.closures, notes
    if not _bound(linkage, problems):
        return settled.closures, notes
    closures: list[Closure] = []
    for closure in settled.closures:
        one = linkage.opened.get(closure.name)
        if one is None:
            closures.append(closure)
            continue
        rows = zip(one.joints, one.bounds.tolist(), one.responses, strict=True)
        found = tuple(Deviation(joint, bound, response.copy()) for joint, bound, response in rows)
        closures.append(replace(closure, deviations=found, apart=apart_along(one.closure.path.minimal)))
        notes.append(_note(linkage, closure.name, found))
    return tuple(closures), notes


def _bound(linkage: _Linkage, problems: Problems) -> bool:
    """Bound all deviations; if they depend on those of other loops, the bounds grow until all agree."""
    shapes = {name: linkage.now(name) for name in linkage.opened}
    for _ in range(_ROUNDS):
        settled = True
        for name, shape in shapes.items():
            if isinstance(shape, Refusal):  # `answer` has found its shape
                continue
            span = linkage.span(shape)
            bounds, one = shape.bounds(span), linkage.opened[name]
            if bounds is None or np.any(bounds > DEVIATION):
                _too_flat(linkage, name, shape, span, bounds, problems)
                return False
            if np.any(bounds > one.bounds):
                one.bounds, settled = bounds * _GROWTH, False
        if settled:
            return True
    name = next(iter(linkage.opened))
    problems.add(f"closure {name!r}: the errors of the loops have no common bound", "Give them equal sides")
    return False


def _too_flat(
    linkage: _Linkage,
    name: str,
    shape: _Shape,
    span: tuple[float, float],
    bounds: Array | None,
    problems: Problems,
) -> None:
    """Report that a loop comes too near its flat pose for the difference of its sides, and which limits would help."""
    mark, joints = linkage.opened[name].closure.mark, linkage.opened[name].joints
    flats = _flats(span)
    from_flat = min(abs(math.remainder(end, math.pi)) for end in span) if np.all(np.isfinite(span)) else 0.0
    comes = (
        "passes through its flat pose" if flats else f"comes within {math.degrees(from_flat):.3g} deg of its flat pose"
    )
    where = _where(linkage, shape, flats)
    by = f"{1e6 * shape.found.mismatch:.4g} um"
    does = "no bound of the links' error is known, and the linkage can leave the parallelogram"
    if bounds is not None:
        does = f"this moves {joints[int(np.argmax(bounds))]!r} by up to {float(bounds.max()):.3g} rad"
    message = f"closure {name!r}: the sides of its loop differ by {by} in total; within the joint limits it {comes}"
    problems.add(f"{message}{where}, where {does}", _remedy(linkage, shape), *linkage.place(mark))


def _remedy(linkage: _Linkage, shape: _Shape) -> str:
    middle = shape.at + float(shape.coefficients[: linkage.n] @ linkage.home)
    below = math.floor(middle / math.pi) * math.pi
    for degrees in _SUGGESTED:
        low, high = below + math.radians(degrees), below + math.pi - math.radians(degrees)
        bounds = shape.bounds((low, high))
        if bounds is not None and np.all(bounds <= _COMFORTABLE):
            what, ends = _as_limit(linkage, shape, (low, high))
            limit = f"{what} to {ends[0]:.6g} .. {ends[1]:.6g} rad"
            return f"Give it equal sides, or limit {limit} ({degrees:g} deg from flat)"
    return "Give it equal sides"


def _as_limit(linkage: _Linkage, shape: _Shape, span: tuple[float, float]) -> tuple[str, tuple[float, float]]:
    """Return the joint whose value is the loop's shape, and the range for it; else the shape in terms of q."""
    c = shape.coefficients[: linkage.n]
    for limit in linkage.limits:
        factor = _factor(c, limit.coefficients)
        if factor is not None:
            low, high = sorted((end - shape.at) / factor + limit.offset for end in span)
            return repr(limit.joint), (low, high)
    return linear_text(c, linkage.coupling.coordinates), (span[0] - shape.at, span[1] - shape.at)


def _flats(span: tuple[float, float]) -> list[float]:
    """Return the flat poses in a range of shapes, at most eight; for an infinite range, those within a turn."""
    low, high = (end if math.isfinite(end) else math.copysign(math.pi, end) for end in span)
    first = math.ceil(low / math.pi)
    return [k * math.pi for k in range(first, min(math.floor(high / math.pi), first + 7) + 1)]


def _where(linkage: _Linkage, shape: _Shape, flats: Sequence[float]) -> str:
    if not flats:
        return ""
    places = [_as_limit(linkage, shape, (flat, flat)) for flat in flats]
    values = ", ".join(f"{round(math.degrees(ends[0]), 6) + 0.0:.6g}" for _, ends in places)
    return f" (at {places[0][0]} = {values} deg)"


def _flat_note(linkage: _Linkage, closure: Closure, shape: _Shape) -> list[str]:
    flats = _flats(linkage.span(shape))
    if not flats:
        return []
    where = _where(linkage, shape, flats)
    return [
        f"closure {closure.name!r} passes through its flat pose within the joint limits{where}: there the linkage can "
        "change to its other assembly; the results are for the parallelogram only"
    ]


def _note(linkage: _Linkage, name: str, found: Sequence[Deviation]) -> str:
    shape = linkage.now(name)
    reasons: list[str] = []
    if not isinstance(shape, Refusal):
        if shape.found.mismatch:
            reasons.append(f"the sides of its loop differ by {1e6 * shape.found.mismatch:.4g} um in total")
        if np.any(shape.found.constant):
            off = float(np.abs(shape.found.constant).max())
            reasons.append(f"its joints' offsets are {off:.3g} rad from those that keep its sides parallel")
    if not reasons:
        return f"closure {name!r} shares joints with loops whose sides differ, and responds to them"
    moved = ", ".join(f"{one.joint!r} by up to {one.bound:.3g} rad" for one in found if one.bound)
    return (
        f"closure {name!r}: {' and '.join(reasons)}; within the joint limits the true linkage differs from the "
        f"coupling in {moved}; boundaries that this moves keep more distance (place_error), and limits of these joints "
        "are narrower by it"
    )


def narrowed(limits: Sequence[LinearLimit], coupling: Coupling, errors: Array) -> tuple[LinearLimit, ...]:
    """Return limits that hold for the true linkage if they hold for the coupling.

    Args:
        limits: All joint limits, in terms of q.
        coupling: The coupling.
        errors: (n_tree,), the largest difference of each tree joint from the coupling [rad or m].
    """
    found: list[LinearLimit] = []
    for limit in limits:
        error = float(errors[coupling.joints.index(limit.joint)])
        found.append(replace(limit, lower=limit.lower + error, upper=limit.upper - error) if error else limit)
    return tuple(found)
