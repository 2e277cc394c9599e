"""Parallelograms in open trees: passive joints become followers, and the residual over all q proves it.

A closure of an open tree leaves `sum_i R(g_i . q) V_i = 0` over its distinct angles. If four terms are left whose
lengths agree in two pairs, and each pair is opposite in the assembled pose, opposite sides stay parallel: the angles
`g_i . q` and `g_j . q` differ by a constant. Two such equations express two passive joints. `docs/closures.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Annotations, ClosureMark
from pinbound.chain import Chain
from pinbound.closures import Closure, close
from pinbound.coupling import Coupling
from pinbound.exceptions import Problems, UnsupportedError
from pinbound.tolerances import CLOSURE, REDUCTION
from pinbound.tree import Tree

__all__ = ["Refusal", "Side", "couple_parallelogram", "settle"]

Array = NDArray[np.float64]

_SIDES = 4
_RESIDUAL_SAMPLES = 2000
_PAIRINGS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))


@dataclass(frozen=True)
class Side:
    """One side of a planar loop: `R(angle . q) vector`.

    Attributes:
        angle: (n,) coefficients.
        vector: (3,) [m], across the axis, in the frame of the loop at zero angle.
    """

    angle: Array
    vector: Array

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.vector))


@dataclass(frozen=True)
class Refusal:
    """Why a loop is not taken for a parallelogram, and what to do."""

    reason: str
    remedy: str


def couple_parallelogram(
    closure: Closure, coupling: Coupling, reference: Array, depth: Sequence[int]
) -> Coupling | Refusal:
    """Return the coupling in which a loop's passive joints follow, or why it is no parallelogram.

    Args:
        closure: The closure, its path derived with `coupling`.
        coupling: Today's coupling; passive joints are among its coordinates.
        reference: (n,) the assembled pose.
        depth: How far each coordinate's joint is from the root; the furthest, and of equals the later ones, become
            passive unless the closure names them.
    """
    chain = closure.path.minimal
    names = [coupling.coordinates[index] for index in chain.coordinates]
    if not chain.rotations or not chain.is_planar or np.any(chain.slides):
        return Refusal(f"it is no planar loop of revolute joints ({', '.join(names) or 'nothing moves in it'})", _MEND)
    apart = abs(float(chain.offsets[0] @ chain.axes[0]))  # the reduction has moved all of it into the first offset
    if apart > CLOSURE:
        return Refusal(f"its two pins are {1e3 * apart:.6g} mm apart along the axis of its joints", _MEND)
    sides = _sides(chain)
    lengths = ", ".join(f"{1e3 * side.length:.6g}" for side in sides)
    if len(sides) != _SIDES:
        return Refusal(f"it has {len(sides)} sides of {lengths} mm, a parallelogram has 4", _MEND)
    across = [pairing for pairing in _PAIRINGS if _equal_sides(sides, pairing)]
    if not across:
        return Refusal(f"its sides of {lengths} mm are not equal in two pairs", _MEND)
    axis = chain.axes[0]
    turned = [_turn(axis, float(side.angle @ reference), side.vector) for side in sides]
    gap = float(np.linalg.norm(np.sum(turned, axis=0)))
    if gap > CLOSURE:
        message = f"it is open by {1e3 * gap:.6g} mm in the pose that home gives, so its assembly is not known"
        return Refusal(f"{message} (sides of {lengths} mm)", f"Let home name an assembled pose of {', '.join(names)}")
    opposite = [p for p in across if all(np.linalg.norm(turned[i] + turned[j]) <= CLOSURE for i, j in p)]
    if not opposite:
        message = f"it is assembled as an anti-parallelogram (sides of {lengths} mm): its opposite sides cross"
        return Refusal(message, "Its motion is not affine in the joints: mend the pose, or couple it by hand")
    if len(opposite) > 1:
        message = f"it is flat in the pose that home gives, so both assemblies fit (sides of {lengths} mm)"
        return Refusal(message, f"Let home name a pose of {', '.join(names)} in which it is not flat")
    rows = np.array([sides[i].angle - sides[j].angle for i, j in opposite[0]])
    constant = np.array([_apart(axis, sides[i].vector, -sides[j].vector) for i, j in opposite[0]])
    turns = np.round((rows @ reference - constant) / (2 * math.pi))
    passive = _passive(closure, coupling, rows, depth)
    if isinstance(passive, Refusal):
        return passive
    return _substitute(coupling, rows, constant + 2 * math.pi * turns, passive)


_MEND = "Couple the joints of the loop by <mimic>, or mend its pins"


def _sides(chain: Chain) -> list[Side]:
    """Return the terms of a planar chain by distinct cumulative angle; the chain is reduced, so none is zero."""
    signs = np.sign(chain.axes @ chain.axes[0]) if chain.rotations else np.zeros(0)
    cumulative = np.vstack(
        (np.zeros(chain.coefficients.shape[1]), np.cumsum(signs[:, None] * chain.coefficients, axis=0))
    )
    sides = [Side(angle, offset) for angle, offset in zip(cumulative, chain.offsets, strict=True)]
    return [side for side in sides if side.length > CLOSURE]


def _equal_sides(sides: Sequence[Side], pairing: tuple[tuple[int, int], ...]) -> bool:
    return all(abs(sides[i].length - sides[j].length) <= CLOSURE for i, j in pairing)


def _turn(axis: Array, angle: float, vector: Array) -> Array:
    return vector * math.cos(angle) + np.cross(axis, vector) * math.sin(angle)


def _apart(axis: Array, v: Array, w: Array) -> float:
    """Return the angle about the axis that turns v towards w, exactly zero if rounding alone keeps it from that."""
    angle = math.atan2(float(axis @ np.cross(v, w)), float(v @ w))
    return 0.0 if abs(angle) <= REDUCTION else angle


def _passive(closure: Closure, coupling: Coupling, rows: Array, depth: Sequence[int]) -> list[int] | Refusal:
    """Return the two coordinates to express: those that the closure names, else the deepest ones that can be."""
    names = coupling.coordinates
    for name in closure.mark.passive:
        if name not in names:
            return Refusal(f"its passive joint {name!r} is no free joint", f"Free joints: {', '.join(names)}")
    given = [names.index(name) for name in closure.mark.passive]
    used = [int(index) for index in np.flatnonzero(np.any(rows, axis=0))]
    order = given or sorted(used, key=lambda index: (-depth[index], -index))
    chosen: list[int] = []
    for index in order:
        if len(chosen) < len(rows) and np.linalg.matrix_rank(rows[:, [*chosen, index]]) == len(chosen) + 1:
            chosen.append(index)
    if len(chosen) < len(rows):
        free = ", ".join(names[index] for index in used)
        return Refusal("two of its joints must be passive, and they cannot be expressed", f"Joints of the loop: {free}")
    return chosen


def _substitute(coupling: Coupling, rows: Array, constant: Array, passive: list[int]) -> Coupling:
    """Solve `rows q = constant` for the passive coordinates and put them into `theta = S q + o`."""
    n = len(coupling.coordinates)
    active = [index for index in range(n) if index not in passive]
    inverse = np.linalg.inv(rows[:, passive])
    insert = np.zeros((n, len(active)))
    insert[active, range(len(active))] = 1.0
    insert[passive] = _exact(-inverse @ rows[:, active])
    offset = np.zeros(n)
    offset[passive] = inverse @ constant
    names = tuple(coupling.coordinates[index] for index in active)
    return Coupling(names, coupling.joints, coupling.S @ insert, coupling.S @ offset + coupling.offset)


def _exact(coefficients: Array) -> Array:
    """Return coefficients with those that miss an integer by rounding alone set to it."""
    whole = np.round(coefficients)
    return np.where(np.abs(coefficients - whole) <= REDUCTION, whole, coefficients) + 0.0


def settle(
    tree: Tree, coupling: Coupling, annotations: Annotations, problems: Problems
) -> tuple[Coupling, tuple[Closure, ...], list[str]]:
    """Return the coupling in which every closure closes, the closures with their proof, and what was coupled.

    A closure that already closes is proven; one of an open tree is taken for a parallelogram if its geometry says so;
    any other is a fault. Closures may depend on each other, so this goes on while something is gained.
    """
    notes: list[str] = []
    pending = list(annotations.closures)
    refused: dict[str, Refusal] = {}
    while pending:
        rest: list[ClosureMark] = []
        for mark in pending:
            found = _settle_one(tree, coupling, annotations, mark)
            if isinstance(found, Refusal):
                refused[mark.name] = found
                rest.append(mark)
                continue
            lost = [name for name in coupling.coordinates if name not in found.coordinates]
            notes += [f"closure {mark.name!r}: joint {name!r} follows {found.text(name)}" for name in lost]
            coupling = found
        if len(rest) == len(pending):
            break
        pending = rest
    for mark in pending:
        message = f"closure {mark.name!r} does not close: {refused[mark.name].reason}"
        problems.add(message, refused[mark.name].remedy, mark.line, annotations.sources.get(f"closure {mark.name}"))
    settled = [mark for mark in annotations.closures if mark not in pending]
    return coupling, tuple(close(tree, coupling, mark) for mark in settled), notes


def _settle_one(tree: Tree, coupling: Coupling, annotations: Annotations, mark: ClosureMark) -> Coupling | Refusal:
    try:
        closure = close(tree, coupling, mark)
    except UnsupportedError as error:
        return Refusal(str(error), "Close the loop over single joints")
    if closure.closes:
        return coupling
    reference = np.array([annotations.home.get(name, 0.0) for name in coupling.coordinates])
    depth = {joint.name: level for _, joint, level in tree.walk() if joint is not None}
    found = couple_parallelogram(closure, coupling, reference, [depth[name] for name in coupling.coordinates])
    if isinstance(found, Refusal):
        residual, q = _worst_residual(closure, tree, coupling)
        pose = ", ".join(f"{name} = {value:.4g}" for name, value in zip(coupling.coordinates, q, strict=True))
        reason = f"its ends are {1e3 * residual:.6g} mm apart at {pose or 'every pose'}, and {found.reason}"
        return Refusal(reason, found.remedy)
    again = close(tree, found, mark)
    if not again.closes:
        return Refusal(f"coupled as a parallelogram its ends are still up to {1e3 * again.bound:.6g} mm apart", _MEND)
    return found


def _worst_residual(closure: Closure, tree: Tree, coupling: Coupling) -> tuple[float, Array]:
    joints = {joint.name: joint for joint in tree.moving_joints}
    ends = np.array([(joints[name].lower, joints[name].upper) for name in coupling.coordinates]).reshape(-1, 2)
    ends = np.clip(ends, -np.pi, np.pi)
    Q = np.random.default_rng(0).uniform(ends[:, 0], ends[:, 1], (_RESIDUAL_SAMPLES, len(ends)))
    residuals = closure.residuals(Q)
    worst = int(np.argmax(residuals))
    return float(residuals[worst]), Q[worst]
