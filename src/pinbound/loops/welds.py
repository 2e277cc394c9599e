"""Closures that also fix the orientation of two frames: in a planar loop, one more linear equation of its joints.

If all joints between two links rotate about parallel axes, along u, then `R_a = R(u, phi_a) A` and `R_b = R(u, phi_b)
B`, where A and B are the orientations at zero, and phi are sums of joint angles. So `R_a = R_b` means that `K = A B^T`
is a rotation about u, by kappa, and

    phi_b - phi_a = kappa   (mod 2 pi, in the turn of the assembled pose),

which expresses one joint by the others, if possible one that rotates nothing but the pin. `docs/closures.md`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from pinbound.annotations import ClosureMark
from pinbound.loops.planar_loops import Refusal
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.tolerances import EXACT_LOOP, REDUCTION
from pinbound.typing import Array

__all__ = ["substituted", "welded"]

_TURNING = ("revolute", "continuous")
_REMEDY = "Give the pin alone (of type 3d, or without weld), or couple the joints of the loop by <mimic>"


def substituted(coupling: Coupling, rows: Array, constant: Array, passive: Sequence[int]) -> Coupling:
    """Return `theta = S q + o` with `rows q = constant` solved for the passive coordinates, one for each row."""
    n = len(coupling.coordinates)
    active = [index for index in range(n) if index not in passive]
    inverse = np.linalg.inv(rows[:, list(passive)])
    insert = np.zeros((n, len(active)))
    insert[active, range(len(active))] = 1.0
    insert[list(passive)] = _exact(-inverse @ rows[:, active])
    offset = np.zeros(n)
    offset[list(passive)] = inverse @ constant
    names = tuple(coupling.coordinates[index] for index in active)
    return Coupling(names, coupling.joints, coupling.S @ insert, coupling.S @ offset + coupling.offset)


def _exact(coefficients: Array) -> Array:
    """Return coefficients; those that differ from an integer only by rounding are set to it."""
    whole = np.round(coefficients)
    return np.where(np.abs(coefficients - whole) <= REDUCTION, whole, coefficients) + 0.0


def welded(
    tree: Tree, coupling: Coupling, mark: ClosureMark, moved: Collection[int], reference: Array, depth: Sequence[int]
) -> Coupling | Refusal:
    """Return the coupling in which the frames of a closure's two links have the same orientation, or why there is none.

    Args:
        tree: The tree of links.
        coupling: The present coupling.
        mark: The closure.
        moved: Coordinates that move the two ends of its pin relative to each other; another coordinate is preferred as
            the dependent one.
        reference: (n,) the assembled pose.
        depth: The distance of each coordinate's joint from the root (levels of links).
    """
    axis: Array | None = None
    row, offset = np.zeros(len(coupling.coordinates)), 0.0
    above_b = set(tree.lineage(mark.link_b))
    for joint in tree.path_between(mark.link_a, mark.link_b):
        if joint.type not in _TURNING:
            if joint.moves or joint.type == "fixed":
                continue
            return Refusal(f"{joint.type} joint {joint.name!r} is part of it", "Close the loop over single joints")
        coefficients, constant = coupling.row(joint.name)
        if not np.any(np.abs(coefficients) > REDUCTION) and constant == 0.0:
            continue
        line = tree.lines_at_zero[joint.name][0]
        axis = line if axis is None else axis
        if float(np.abs(np.cross(axis, line)).max()) > EXACT_LOOP:
            message = (
                f"it holds the orientation of {mark.link_a!r} and {mark.link_b!r}, and its joints turn about axes "
            )
            return Refusal(f"{message}that are not parallel ({joint.name!r} is one): it is a spatial loop", _REMEDY)
        turn = float(np.sign(axis @ line)) * (1.0 if joint.child in above_b else -1.0)
        row, offset = row + turn * coefficients, offset + turn * constant
    frames = tree.frames_at_zero
    apart = frames[mark.link_a][:, :3] @ frames[mark.link_b][:, :3].T
    tilt = apart - np.eye(3) if axis is None else (apart @ axis - axis)
    if float(np.abs(tilt).max()) > EXACT_LOOP:
        message = f"the frames of {mark.link_a!r} and {mark.link_b!r} never have the same orientation"
        return Refusal(
            f"{message}: they differ by a tilt of the joints' axis, which no joint of the loop changes", _REMEDY
        )
    if axis is None:
        return coupling
    twist = np.array([apart[2, 1] - apart[1, 2], apart[0, 2] - apart[2, 0], apart[1, 0] - apart[0, 1]])
    kappa = math.atan2(0.5 * float(twist @ axis), 0.5 * (float(np.trace(apart)) - 1.0)) - offset
    row = np.where(np.abs(row) > REDUCTION, row, 0.0)
    if not np.any(row):
        missed = math.remainder(kappa, 2.0 * math.pi)
        if abs(missed) <= EXACT_LOOP:
            return coupling
        message = (
            f"the frames of {mark.link_a!r} and {mark.link_b!r} are always {math.degrees(abs(missed)):.6g} deg apart"
        )
        return Refusal(message, _REMEDY)
    names = coupling.coordinates
    kept = {*mark.active, *mark.passive}
    free = [int(index) for index in np.flatnonzero(row) if names[int(index)] not in kept]
    if not free:
        held = ", ".join(names[int(index)] for index in np.flatnonzero(row))
        return Refusal(f"it holds an orientation, and none of {held} may follow", "Leave one out of active and passive")
    follower = min(free, key=lambda index: (index in moved, abs(row[index]) != 1.0, -depth[index], -index))
    turns = round((float(row @ reference) - kappa) / (2.0 * math.pi))
    return substituted(coupling, row[None], np.array([kappa + 2.0 * math.pi * turns]), [follower])
