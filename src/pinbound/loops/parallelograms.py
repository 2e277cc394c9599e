"""Parallelograms in open trees: passive joints become mimic joints, and the bound of the residual over all q proves it.

A closure of an open tree gives `sum_i R(g_i . q) V_i = 0` over its distinct angles. Suppose that four terms remain
whose lengths agree in two pairs, and that the terms of each pair are opposite in the assembled pose. Then opposite
sides stay parallel: the angles `g_i . q` and `g_j . q` differ by a constant. Two such equations express two passive
joints. `docs/closures.md`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.annotations import Annotations, ClosureMark
from pinbound.exceptions import Problems, UnsupportedError
from pinbound.loops.closures import Closure, close
from pinbound.loops.linkages import Linkage
from pinbound.loops.planar_loops import Refusal, parallelogram
from pinbound.loops.solving import linkage, ordered, said
from pinbound.loops.welds import substituted, welded
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Settled", "couple_parallelogram", "passive_coordinates", "settle"]

_RESIDUAL_SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class Settled(Value):
    """The result of `settle`.

    Attributes:
        coupling: The coupling in which every closure closes, to its tolerance.
        closures: The closures with their paths in this coupling.
        passive: Joints that a closure turned into mimic joints, by the closure's name.
        notes: Sentences about the joints that were coupled.
        linkages: Loops that are not parallelograms, in the order in which they are solved; their passive joints are
            among the coupling's coordinates.
        linked: The closures of these loops.
    """

    coupling: Coupling
    closures: tuple[Closure, ...]
    passive: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]
    linkages: tuple[Linkage, ...] = ()
    linked: tuple[Closure, ...] = ()


def couple_parallelogram(
    closure: Closure, coupling: Coupling, reference: Array, depth: Sequence[int]
) -> Coupling | Refusal:
    """Return the coupling in which a loop's passive joints are mimic joints, or why it is not a parallelogram.

    Args:
        closure: The closure, with its path from `coupling`.
        coupling: The present coupling; passive joints are among its coordinates.
        reference: (n,) the assembled pose.
        depth: The distance of each coordinate's joint from the root (levels of links). The furthest ones (of equals the
            later ones) become passive unless the closure names the passive joints.
    """
    found = parallelogram(closure, coupling.coordinates, reference)
    if isinstance(found, Refusal):
        return found
    passive = passive_coordinates(closure, coupling, found.rows, depth)
    if isinstance(passive, Refusal):
        return passive
    return substituted(coupling, found.rows, found.constant, passive)


def passive_coordinates(closure: Closure, coupling: Coupling, rows: Array, depth: Sequence[int]) -> list[int] | Refusal:
    """Return the two coordinates to express: those that the closure names, else the deepest possible ones."""
    names = coupling.coordinates
    for name in closure.mark.passive:
        if name not in names:
            return Refusal(f"its passive joint {name!r} is not a free joint", f"Free joints: {', '.join(names)}")
    given = [names.index(name) for name in closure.mark.passive]
    used = [
        int(index) for index in np.flatnonzero(np.any(rows, axis=0)) if names[int(index)] not in closure.mark.active
    ]
    order = given or sorted(used, key=lambda index: (-depth[index], -index))
    chosen: list[int] = []
    for index in order:
        if len(chosen) < len(rows) and np.linalg.matrix_rank(rows[:, [*chosen, index]]) == len(chosen) + 1:
            chosen.append(index)
    if len(chosen) < len(rows):
        free = ", ".join(names[index] for index in used)
        return Refusal("two of its joints must be passive, and they cannot be expressed", f"Joints of the loop: {free}")
    return chosen


def settle(tree: Tree, coupling: Coupling, annotations: Annotations, problems: Problems) -> Settled:
    """Return the coupling in which every closure closes, the closures, and notes about what was coupled.

    A closure that already closes is proven. A closure of an open tree counts as a parallelogram if its geometry shows
    this. Other planar ones with two passive joints are solved in closed form (`solving`). All others are faults.
    Closures may depend on each other, so these steps are repeated while something changes.
    """
    notes: list[str] = []
    passive: dict[str, tuple[str, ...]] = {}
    coupling, refused = _welded(tree, coupling, annotations, notes)
    tilted = [mark for mark in annotations.closures if mark.name in refused]
    pending = [mark for mark in annotations.closures if mark not in tilted]
    while pending:
        rest: list[ClosureMark] = []
        for mark in pending:
            found = _settle_one(tree, coupling, annotations, mark)
            if isinstance(found, Refusal):
                refused[mark.name] = found
                rest.append(mark)
                continue
            notes += _followers(mark, coupling, found)
            passive[mark.name] = tuple(name for name in coupling.coordinates if name not in found.coordinates)
            coupling = found
        if len(rest) == len(pending):
            break
        pending = rest
    reference, depth = _reference(tree, coupling, annotations)
    linked: dict[str, tuple[Linkage, Closure]] = {}
    for mark in pending:
        if not refused[mark.name].is_other:
            continue
        closure = close(tree, coupling, mark)
        taken = [index for one, _ in linked.values() for index in one.passive]
        found = linkage(closure, coupling.coordinates, reference, depth, taken)
        if isinstance(found, Refusal):
            refused[mark.name] = Refusal(f"{refused[mark.name].reason}; {found.reason}", found.remedy)
            continue
        linked[mark.name] = found, closure
    pending = [mark for mark in pending if mark.name not in linked]
    order = ordered([one for one, _ in linked.values()])
    if isinstance(order, str):
        message = f"closure {order!r} cannot be solved: its passive joints move a loop that moves its own input"
        problems.add(message, "Name other passive joints", None, annotations.sources.get(f"closure {order}"))
        order = ()
    for one in order:
        passive[one.name] = tuple(coupling.coordinates[index] for index in one.passive)
        why = refused[one.name].reason.split(", and ", 1)[-1]
        notes.append(f"closure {one.name!r}: {said(one, coupling.coordinates)}; no parallelogram: {why}")
    for mark in (pending := [*pending, *tilted]):
        message = f"closure {mark.name!r} does not close: {refused[mark.name].reason}"
        problems.add(message, refused[mark.name].remedy, mark.line, annotations.sources.get(f"closure {mark.name}"))
    left = [mark for mark in annotations.closures if mark not in pending and mark.name not in linked]
    closures = [close(tree, coupling, mark) for mark in left]
    _refuse_carried_welds(closures, annotations, problems)
    return Settled(
        coupling, tuple(closures), passive, tuple(notes), tuple(order), tuple(linked[one.name][1] for one in order)
    )


def _refuse_carried_welds(closures: Sequence[Closure], annotations: Annotations, problems: Problems) -> None:
    """Refuse loops with different sides beside closures that fix an orientation: these do not include their errors."""
    welds = [mark.name for mark in annotations.closures if mark.weld]
    for one in closures if welds else ():
        if not one.is_exact:
            message = f"closure {one.name!r} has sides that differ, and closure {welds[0]!r} holds an orientation"
            remedy = f"Give closure {one.name!r} equal sides, or {welds[0]!r} the pin alone (without weld)"
            message += ": the effect of one loop's error on the other's orientation has no bound"
            source = annotations.sources.get(f"closure {one.name}")
            problems.add(message, remedy, one.mark.line, source)


def _reference(tree: Tree, coupling: Coupling, annotations: Annotations) -> tuple[Array, list[int]]:
    """Return the pose of home (n,), and the depth of each coordinate's joint below the root."""
    reference = np.array([annotations.home.get(name, 0.0) for name in coupling.coordinates])
    depth = {joint.name: level for _, joint, level in tree.walk() if joint is not None}
    return reference, [depth[name] for name in coupling.coordinates]


def _followers(mark: ClosureMark, before: Coupling, after: Coupling) -> list[str]:
    """Return sentences about the joints that a closure turned into mimic joints."""
    lost = [name for name in before.coordinates if name not in after.coordinates]
    return [f"closure {mark.name!r}: joint {name!r} follows {after.text(name)}" for name in lost]


def _welded(
    tree: Tree, coupling: Coupling, annotations: Annotations, notes: list[str]
) -> tuple[Coupling, dict[str, Refusal]]:
    """Return the coupling in which the frames of welds have the same orientation, and reasons why others have none."""
    refused: dict[str, Refusal] = {}
    for mark in (one for one in annotations.closures if one.weld):
        try:
            moved = close(tree, coupling, mark).path.minimal.coordinates
            found = welded(tree, coupling, mark, moved, *_reference(tree, coupling, annotations))
        except UnsupportedError as error:
            found = Refusal(str(error), "Close the loop over single joints")
        if isinstance(found, Refusal):
            refused[mark.name] = found
            continue
        notes += _followers(mark, coupling, found)
        coupling = found
    return coupling, refused


def _settle_one(tree: Tree, coupling: Coupling, annotations: Annotations, mark: ClosureMark) -> Coupling | Refusal:
    try:
        closure = close(tree, coupling, mark)
    except UnsupportedError as error:
        return Refusal(str(error), "Close the loop over single joints")
    if closure.closes:
        return coupling
    found = couple_parallelogram(closure, coupling, *_reference(tree, coupling, annotations))
    if isinstance(found, Refusal):
        residual, q = _worst_residual(closure, tree, coupling)
        pose = ", ".join(f"{name} = {value:.4g}" for name, value in zip(coupling.coordinates, q, strict=True))
        reason = f"its ends are {1e3 * residual:.6g} mm apart at {pose or 'every pose'}, and {found.reason}"
        return Refusal(reason, found.remedy, found.is_other)
    again = close(tree, found, mark)
    if not again.closes:
        message = f"coupled as a parallelogram its ends are still up to {1e3 * again.bound:.6g} mm apart"
        return Refusal(message, "Couple the joints of the loop by <mimic>, or correct its pins")
    return found


def _worst_residual(closure: Closure, tree: Tree, coupling: Coupling) -> tuple[float, Array]:
    joints = {joint.name: joint for joint in tree.moving_joints}
    ends = np.array([(joints[name].lower, joints[name].upper) for name in coupling.coordinates]).reshape(-1, 2)
    ends = np.clip(ends, -np.pi, np.pi)
    Q = np.random.default_rng(0).uniform(ends[:, 0], ends[:, 1], (_RESIDUAL_SAMPLES, len(ends)))
    residuals = closure.residuals(Q)
    worst = int(np.argmax(residuals))
    return float(residuals[worst]), Q[worst]
