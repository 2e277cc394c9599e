"""Loads robots with loops that are not parallelograms: their passive joints and toggles become coordinates of z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pinbound.annotations import Annotations
from pinbound.exceptions import Problems, name_hint
from pinbound.loops.closures import close
from pinbound.loops.lift import Lift
from pinbound.loops.loop_coupling import lifted, toggle_limits
from pinbound.loops.parallelograms import Settled
from pinbound.model.coupling import Coupling, GuardedLimit, LinearLimit
from pinbound.model.tree import Tree
from pinbound.tolerances import HOME
from pinbound.typing import Array

__all__ = ["home_of_loops", "opened_loops", "toggles"]


def opened_loops(tree: Tree, settled: Settled, marks: Annotations, problems: Problems) -> tuple[Settled, Lift]:
    """Return the coupling whose coordinates include passive joints of loops that are no parallelograms; and F."""
    coupling, lift = lifted(settled.coupling, settled.linkages)
    closures = tuple(close(tree, coupling, one.mark) for one in settled.closures)
    name = settled.linkages[0].name
    for one in closures:
        if not one.is_exact:
            message = f"closure {one.name!r} has sides that differ, and loop {name!r} is not a parallelogram"
            remedy = f"Give closure {one.name!r} equal sides, or couple loop {name!r} by <mimic>"
            source = marks.sources.get(f"closure {one.name}")
            said = f"{message}: the effect of one loop's error on the other has no bound"
            problems.add(said, remedy, one.mark.line, source)
    if marks.axes:
        message = (
            f"the file defines axes, and loop {name!r} is not a parallelogram: its closed form needs the "
            "joints themselves as coordinates"
        )
        source = marks.sources.get(f"closure {marks.closures[0].name}")
        problems.add(message, "Remove the axes, or couple the loop by <mimic>", marks.closures[0].line, source)
    problems.raise_if_any()
    linked = tuple(close(tree, coupling, one.mark) for one in settled.linked)
    return replace(settled, coupling=coupling, closures=closures, linked=linked), lift


def toggles(lift: Lift, marks: Annotations) -> tuple[LinearLimit, ...]:
    """Return the toggles of the loops as limits, with home on the allowed side."""
    return toggle_limits(lift, lift(_marked_home(lift, marks)))


def _marked_home(lift: Lift, marks: Annotations) -> Array:
    """Return q from the marked home; coordinates that it does not name are zero."""
    return np.array([marks.home.get(name, 0.0) for name in lift.coordinates], dtype=np.float64)


def home_of_loops(
    tree: Tree,
    coupling: Coupling,
    lift: Lift,
    marks: Annotations,
    limits: Sequence[LinearLimit],
    guarded: Sequence[GuardedLimit],
    problems: Problems,
) -> tuple[Array, list[str]]:
    """Return home (n + k,): q as marked, zero where it is not marked; passive joints computed from the loops."""
    home = lift(_marked_home(lift, marks))
    joints = dict(zip(lift.names, home.tolist(), strict=True))
    line, source = marks.home_line, marks.sources.get("home")
    own = {joint.name for joint in tree.moving_joints if joint.mimic is None}
    for name, value in marks.home.items():
        if name in joints:
            continue
        if name not in own:
            hint = name_hint(name, [one for one in lift.names if one in own])
            problems.add(f"home names {name!r}, which is not a free joint", hint, line, source)
            continue
        coefficients, offset = coupling.row(name)
        expected = float(coefficients @ home) + offset
        if abs(value - expected) > HOME:
            message = f"home has {name!r} at {value:.9g}, but the closed loops put it at {expected:.9g}"
            problems.add(message, f"Give {name!r} the value {expected:.9g}", line, source)
    for limit in limits:
        if not limit.holds(home[None])[0]:
            value, ends = float(limit.values(home[None])[0]), f"[{limit.lower:.6g}, {limit.upper:.6g}]"
            message = f"home is outside the limits of {limit.joint!r}: {value:.6g} is not in {ends}"
            problems.add(message, "Choose a home inside all limits; angles are in radians", line, source)
    for one in guarded:
        if not one.holds(home[None])[0]:
            remedy = "Choose a home that keeps the rule; angles are in radians"
            problems.add(f"rule {one.rule!r} forbids home", remedy, line, source)
    notes: list[str] = []
    for one in lift.linkages:
        for name in (lift.names[index] for index in one.passive):
            given = marks.home.get(name, 0.0)
            if abs(joints[name] - given) > HOME:
                what = f"home gives {given:.6g}, which picks the assembly" if name in marks.home else "from zero"
                notes.append(f"loop {one.name!r} puts {name!r} at {joints[name]:.9g} at home ({what})")
    home.flags.writeable = False
    return home, notes
