"""Planar loops that are not parallelograms: the two joints that close them, the closed form, and the assembly.

Once around the loop, every term of `sum_k (V_k + L_k z) e^(i g_k . z) = 0` is before the first passive joint, between
the two, or after both. One of these groups may move: it is X of `linkages`. `docs/loops.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.loops.closures import Closure
from pinbound.loops.jets import Jet
from pinbound.loops.linkages import Form, Linkage
from pinbound.loops.planar_loops import Refusal, apart_along
from pinbound.model.coupling import linear_text
from pinbound.path.chain import Chain
from pinbound.tolerances import FLAT, REDUCTION
from pinbound.typing import Array, Flags

__all__ = ["Toggles", "linkage", "ordered", "said", "toggles"]

Complex = NDArray[np.complex128]

_PASSIVES = 2
_PINS = "Correct xyz_a or xyz_b of the pin (in the frame of its link), or the joints' origins"
_SPATIAL = "Couple its joints by <mimic> if they are proportional; else a robot with this loop cannot be loaded"
_REMEDY = 'Name two other joints of the loop, passive="...", or couple its joints by <mimic>'


@dataclass(frozen=True, eq=False)
class _Terms:
    """`sum_k (vectors_k + slides_k . z) e^(i angles_k . z)`: complex vectors (m), slides (m, n), angles (m, n)."""

    angles: Array
    vectors: Complex
    slides: Complex

    def take(self, rows: Flags) -> _Terms:
        return _Terms(self.angles[rows], self.vectors[rows], self.slides[rows])

    def seen(self, row: Array, unit: complex) -> _Terms:
        """Return the terms, rotated back by `row . z` and by a unit number."""
        return _Terms(self.angles - row, self.vectors / unit, self.slides / unit)

    @property
    def is_fixed(self) -> bool:
        """Whether the length of the sum is constant."""
        return not np.any(self.slides) and bool(np.abs(self.angles - self.angles[:1]).max(initial=0.0) <= REDUCTION)


def linkage(
    closure: Closure, names: Sequence[str], guess: Array, depth: Sequence[int], taken: Sequence[int] = ()
) -> Linkage | Refusal:
    """Return a planar loop, solved for two of its joints, or why this is not possible.

    Args:
        closure: The closure, with its path over the coordinates `names`.
        names: Names of the coordinates (n).
        guess: (n,) home; the values of passive joints select the assembly and the turn.
        depth: The distance of each coordinate's joint from the root (levels of links). The furthest ones (of equals the
            later ones) become passive unless the closure names the passive joints.
        taken: Coordinates that other loops determine already.
    """
    chain = closure.path.minimal
    moving = [names[index] for index in chain.coordinates]
    if not chain.rotations or not chain.is_planar:
        return Refusal(f"it is a spatial loop ({', '.join(moving)}), which has no known closed form", _SPATIAL)
    axis = chain.axes[0]
    if apart_along(chain) > closure.tolerance or np.any(np.abs(axis @ chain.slides) > REDUCTION):
        return Refusal("its pins do not stay in one plane across the axis of its joints", _PINS)
    terms = _terms(chain)
    for name in closure.mark.passive:
        if name not in moving:
            message = f"its passive joint {name!r} is not a free joint of the loop"
            return Refusal(message, f"Free joints: {', '.join(moving)}")
    given = [names.index(name) for name in closure.mark.passive]
    if given and len(given) != _PASSIVES:
        return Refusal(f"it names {len(given)} passive joints; a pin in the plane determines two", _REMEDY)
    order = given or sorted(chain.coordinates, key=lambda index: (-depth[index], -index))
    order = [index for index in order if index not in taken and names[index] not in closure.mark.active]
    first: Refusal | None = None
    for pair in combinations(order, _PASSIVES):
        found = _solved(closure, terms, pair, names, guess)
        if isinstance(found, Linkage):
            return found
        first = first or found
    return first or Refusal(f"only {', '.join(moving)} moves it, and a pin in the plane determines two joints", _REMEDY)


def ordered(linkages: Sequence[Linkage]) -> tuple[Linkage, ...] | str:
    """Return linkages in an order in which each follows those that move it; or the name of one that moves itself."""
    left, found = list(linkages), list[Linkage]()
    while left:
        passive = {index for one in left for index in one.passive}
        ready = [one for one in left if not passive & set(one.inputs)]
        if not ready:
            return left[0].name
        found += ready
        left = [one for one in left if one not in ready]
    return tuple(found)


def said(found: Linkage, names: Sequence[str]) -> str:
    """Return as text which joints follow, and where the loop toggles."""
    passive = " and ".join(repr(names[index]) for index in found.passive)
    moved = ", ".join(names[index] for index in found.inputs)
    text = f"joints {passive} follow {moved} by {found.form.value}, no linear function"
    at = toggles(found)
    if at is None:
        return f"{text}; where it toggles is a limit of its transmission"
    if not at.angles:
        return f"{text}; it never toggles"
    row, angles = at.positive
    where = ", ".join(f"{angle:.9g}" for angle in angles)
    return f"{text}; it toggles at {linear_text(row, names)} = {where} (every turn)"


def _terms(chain: Chain) -> _Terms:
    axis = chain.axes[0]
    beside: Any = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    one: Array = beside / np.linalg.norm(beside)
    across: Any = np.cross(axis, one)
    other: Array = across
    signs = np.sign(chain.axes @ axis)
    start = np.zeros((1, chain.coefficients.shape[1]))
    angles = np.vstack((start, np.cumsum(signs[:, None] * chain.coefficients, axis=0)))
    vectors = chain.offsets @ one + 1j * (chain.offsets @ other)
    slides = np.einsum("i,kin->kn", one, chain.slides) + 1j * np.einsum("i,kin->kn", other, chain.slides)
    kept = (np.abs(vectors) > REDUCTION * chain.scale) | np.any(np.abs(slides) > REDUCTION, axis=1)
    return _Terms(angles[kept], vectors[kept], np.where(np.abs(slides) > REDUCTION, slides, 0.0)[kept])


def _solved(
    closure: Closure, terms: _Terms, pair: tuple[int, ...], names: Sequence[str], guess: Array
) -> Linkage | Refusal:
    """Return the loop solved for two coordinates, or why these two do not close it."""
    said = f"{names[pair[0]]!r} and {names[pair[1]]!r}"
    slid = [bool(np.any(terms.slides[:, index])) for index in pair]
    turned = [bool(np.any(np.abs(terms.angles[:, index]) > REDUCTION)) for index in pair]
    if any(a == b for a, b in zip(slid, turned, strict=True)):
        return Refusal(f"{said} are not each revolute or prismatic in it", _REMEDY)
    if all(slid):
        return Refusal(f"{said} are both prismatic: a revolute arm must close it", _REMEDY)
    for index, slides in zip(pair, slid, strict=True):
        found = {float(c) for c in terms.angles[:, index] if c}
        if not slides and found not in ({1.0}, {-1.0}):
            return Refusal(f"{names[index]!r} moves other joints of the loop with it (<mimic>)", _REMEDY)
    if any(slid):
        turning, sliding = pair if slid[1] else pair[::-1]
        found = _with_slide(terms, turning, sliding)
    else:
        found = _with_arms(terms, *pair)
    if isinstance(found, Refusal):
        return Refusal(f"{said} do not close it: {found.reason}", found.remedy)
    return _assembled(closure, found, names, guess)


@dataclass(frozen=True, eq=False)
class _Closed:
    """X and the part that closes it; `alpha = turns @ p + rows @ z + angles` for the two passive coordinates p."""

    form: Form
    moved: _Terms
    lengths: tuple[float, float]
    passive: tuple[int, int]
    turns: Array
    rows: Array
    angles: Array


def _with_arms(terms: _Terms, i: int, j: int) -> _Closed | Refusal:
    p, r = terms.angles[:, i], terms.angles[:, j]
    if np.count_nonzero(p) < np.count_nonzero(r):
        (i, j), (p, r) = (j, i), (r, p)
    groups = [(p == 0.0) & (r == 0.0), (p != 0.0) & (r == 0.0), (p != 0.0) & (r != 0.0)]
    if not all(np.any(g) for g in groups) or np.any((p == 0.0) & (r != 0.0)):
        return Refusal("they are not two joints apart from each other and from the pin", _REMEDY)
    s_p, s_r = (float(row[row != 0.0][0]) for row in (p, r))
    bare = _without(terms, i, j)
    parts = [bare.take(g) for g in groups]
    moved = [k for k, part in enumerate(parts) if not part.is_fixed] or [0]
    if len(moved) > 1:
        return Refusal("more than one of the parts between them and the pin changes its length", _REMEDY)
    still = [k for k in range(3) if k != moved[0]]
    turn = np.array([[0.0, 0.0], [s_p, 0.0], [s_p, s_r]])
    arms = [(complex(parts[k].vectors.sum()), parts[k].angles[0]) for k in still]
    if min(abs(arm) for arm, _ in arms) == 0.0:
        return Refusal("an arm between them has no length", _REMEDY)
    return _Closed(
        Form.ARMS,
        parts[moved[0]],
        (abs(arms[0][0]), abs(arms[1][0])),
        (i, j),
        turn[still] - turn[moved[0]],
        np.array([row for _, row in arms]),
        np.array([math.atan2(arm.imag, arm.real) for arm, _ in arms]),
    )


def _with_slide(terms: _Terms, turning: int, sliding: int) -> _Closed | Refusal:
    p, along = terms.angles[:, turning], terms.slides[:, sliding]
    (places,) = np.nonzero(along)
    if len(places) != 1 or abs(abs(along[places[0]]) - 1.0) > REDUCTION:
        return Refusal("the prismatic joint moves other joints of the loop with it (<mimic>)", _REMEDY)
    unit, own = complex(along[places[0]]), (p != 0.0) == (p[places[0]] != 0.0)
    if np.all(own):
        return Refusal("the revolute joint is at the pin, or at the prismatic joint", _REMEDY)
    sign = float(p[p != 0.0][0])
    bare = _without(terms, turning, sliding)
    base, here, there = bare.angles[places[0]], bare.take(own), bare.take(~own)
    behind = sign if p[places[0]] == 0.0 else -sign  # the rotation of the others, relative to the slide
    if there.is_fixed and abs(complex(there.vectors.sum())) > 0.0:
        arm = complex(there.vectors.sum())
        return _Closed(
            Form.SLIDE,
            here.seen(base, unit),
            (abs(arm), 0.0),
            (turning, sliding),
            np.array([[behind, 0.0], [0.0, 1.0]]),
            np.array([there.angles[0] - base, np.zeros_like(base)]),
            np.array([math.atan2(arm.imag, arm.real) - math.atan2(unit.imag, unit.real), 0.0]),
        )
    if here.is_fixed:
        beside = complex(here.vectors.sum()) / unit
        return _Closed(
            Form.TELESCOPE,
            there,
            (beside.imag, 0.0),
            (turning, sliding),
            np.array([[-behind, 0.0], [0.0, 1.0]]),
            np.array([base, np.zeros_like(base)]),
            np.array([math.atan2(unit.imag, unit.real), beside.real]),
        )
    return Refusal("more than one of the parts between them and the pin changes its length", _REMEDY)


def _without(terms: _Terms, i: int, j: int) -> _Terms:
    angles, slides = terms.angles.copy(), terms.slides.copy()
    angles[:, [i, j]] = 0.0
    slides[:, [i, j]] = 0.0
    return _Terms(angles, terms.vectors, slides)


def _assembled(closure: Closure, closed: _Closed, names: Sequence[str], guess: Array) -> Linkage | Refusal:
    """Return the linkage in the assembly that is nearest to home."""
    moved = _merged(closed.moved)
    if not np.any(moved.angles) and not np.any(moved.slides):
        return Refusal("nothing but its passive joints moves it", _REMEDY)
    p = guess[list(closed.passive)]
    alpha = closed.turns @ p + closed.rows @ guess + closed.angles
    lead = {
        Form.ARMS: math.sin(alpha[1] - alpha[0]),
        Form.SLIDE: math.cos(alpha[0]),
        Form.TELESCOPE: float(alpha[1]) / max(abs(moved.vectors).sum(), abs(closed.lengths[0])),
    }[closed.form]
    passive = ", ".join(repr(names[index]) for index in closed.passive)
    if abs(lead) <= FLAT:
        message = f"at home {passive} are equally near to both of its assemblies"
        return Refusal(message, f"Let home name values of {passive} (roughly) in the assembly that is meant")
    inverse = np.linalg.inv(closed.turns)
    sizes = np.abs(moved.vectors)
    far = int(np.argmax(sizes))
    is_ahead = not np.any(moved.slides) and sizes[far] > (1.0 + 1e-9) * (sizes.sum() - sizes[far])
    at_home = complex(np.sum((moved.vectors + moved.slides @ guess) * np.exp(1j * (moved.angles @ guess))))
    found = Linkage(
        name=closure.name,
        form=closed.form,
        angles=moved.angles,
        vectors=np.stack((moved.vectors.real, moved.vectors.imag), axis=1),
        slides=np.stack((moved.slides.real, moved.slides.imag), axis=1),
        lengths=closed.lengths,
        sign=math.copysign(1.0, lead),
        passive=closed.passive,
        mix=np.round(inverse).astype(np.float64),
        rows=-inverse @ closed.rows + 0.0,
        offset=-inverse @ closed.angles + 0.0,
        ahead=far if is_ahead or closed.form is Form.SLIDE else -1,  # SLIDE does not need the angle of X
        reference=math.atan2(at_home.imag, at_home.real),
    )
    solved = found.solve([Jet(np.array([value]), np.zeros(1), np.zeros(1)) for value in guess.tolist()])
    w, (low, high) = float(solved.transmission.value[0]), found.transmission_range
    if not low <= w <= high:
        message = f"it does not close in the pose that home gives: {_reach(found, w)}"
        return Refusal(message, "Let home name a pose in which it closes")
    values = np.array([solved.first.value[0], solved.second.value[0]])
    whole = np.round((p - values) / (2.0 * math.pi)) * (np.array([True, closed.form is Form.ARMS]))
    return replace(found, offset=found.offset + 2.0 * math.pi * whole)


def _reach(found: Linkage, w: float) -> str:
    first, second = found.lengths
    if found.form is Form.ARMS:
        far = math.sqrt(max(0.0, first**2 + second**2 + 2.0 * first * second * w))
        return f"arms of {1e3 * first:.6g} and {1e3 * second:.6g} mm do not span {1e3 * far:.6g} mm"
    if found.form is Form.SLIDE:
        return (
            f"its arm of {1e3 * first:.6g} mm is {1e3 * abs(w * first):.6g} mm away from the line of its "
            "prismatic joint"
        )
    return (
        f"the prismatic joint passes its pivot at {1e3 * abs(first):.6g} mm, more than {1e3 * math.sqrt(w):.6g} mm away"
    )


def _merged(terms: _Terms) -> _Terms:
    """Return the terms, with those of equal angle added."""
    rows: list[Array] = []
    vectors: list[complex] = []
    slides: list[Complex] = []
    for row, vector, slide in zip(terms.angles, terms.vectors.tolist(), terms.slides, strict=True):
        same = [k for k, other in enumerate(rows) if np.abs(other - row).max() <= REDUCTION]
        if same:
            vectors[same[0]] += vector
            slides[same[0]] = slides[same[0]] + slide
        else:
            rows.append(row)
            vectors.append(vector)
            slides.append(slide)
    return _Terms(np.array(rows), np.array(vectors), np.array(slides))


@dataclass(frozen=True, eq=False)
class Toggles:
    """The angles at which a loop of one input angle toggles.

    Attributes:
        row: (n,) of the input angle `x = row . z`.
        angles: [rad], in order within [0, 2 pi): the x at which both assemblies meet; empty if it closes for all x.
        kept: [rad], the same minus the distance kept from them, as pairs (first, last) of the arcs that close.
    """

    row: Array
    angles: tuple[float, ...]
    kept: tuple[tuple[float, float], ...]

    @property
    def positive(self) -> tuple[Array, list[float]]:
        """The row with a positive first coefficient, and the angles for it, in order within [0, 2 pi): for people."""
        sign = float(np.sign(self.row[np.flatnonzero(self.row)[0]]))
        return sign * self.row + 0.0, sorted((sign * angle) % (2.0 * math.pi) for angle in self.angles)


def toggles(found: Linkage) -> Toggles | None:
    """Return where a loop toggles, in closed form; None if X has no single angle, or has a prismatic joint.

    `D^2` (for SLIDE the height y) is `m + r cos(x + d)`: it is at an end of its range at two x or none.
    """
    angles, vectors = found.angles, found.vectors[:, 0] + 1j * found.vectors[:, 1]
    if np.any(found.slides):
        return None
    if found.form is Form.SLIDE:
        moving = [k for k in range(len(angles)) if np.any(angles[k])]
        if len(moving) != 1:
            return None
        row, start = angles[moving[0]], vectors[moving[0]]
        middle = float(sum(vectors[k].imag for k in range(len(angles)) if k not in moving))
        radius, shift = abs(start), math.atan2(start.imag, start.real) - 0.5 * math.pi
        ends, kept = (
            (-found.lengths[0], found.lengths[0]),
            tuple(found.lengths[0] * w for w in found.transmission_range),
        )
    else:
        if len(angles) != 2:
            return None
        row, turned = angles[1] - angles[0], vectors[1] * np.conj(vectors[0])
        middle, radius = float(np.sum(np.abs(vectors) ** 2)), 2.0 * abs(turned)
        shift = math.atan2(turned.imag, turned.real)
        Y, Z = found.lengths
        if found.form is Form.ARMS:
            ends = (Y - Z) ** 2, (Y + Z) ** 2
            kept = tuple(Y * Y + Z * Z + 2.0 * Y * Z * w for w in found.transmission_range)
        else:
            ends, kept = (Y * Y, math.inf), found.transmission_range
    exact = [x for end, _ in zip(ends, kept, strict=True) for x in _reached(middle, radius, shift, end)]
    inner = sorted(x for end in kept for x in _reached(middle, radius, shift, end))
    arcs: list[tuple[float, float]] = []
    for k, x in enumerate(inner):
        after = inner[(k + 1) % len(inner)] + (2.0 * math.pi if k + 1 == len(inner) else 0.0)
        level = middle + radius * math.cos(0.5 * (x + after) + shift)
        if kept[0] < level < kept[1]:
            arcs.append((x, after))
    return Toggles(row, tuple(sorted(exact)), tuple(arcs))


def _reached(middle: float, radius: float, shift: float, level: float) -> list[float]:
    """Return the x in [0, 2 pi) at which `middle + radius cos(x + shift)` is `level`, by tan of the half angle."""
    above, below = middle + radius - level, level - (middle - radius)
    if above < 0.0 or below < 0.0 or not math.isfinite(level):
        return []
    half = 2.0 * math.atan2(math.sqrt(above), math.sqrt(below))
    return sorted({(side * half - shift) % (2.0 * math.pi) for side in (1.0, -1.0)})
