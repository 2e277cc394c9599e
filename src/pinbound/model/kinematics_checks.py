"""Checks of links and joints together: one tree, mimic joints with a moving primary, nearly parallel axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from pinbound.exceptions import Problems, name_hint
from pinbound.model.kinematics import Joint, Link
from pinbound.tolerances import PARALLEL, REDUCTION

__all__ = [
    "check_mimics",
    "check_tree",
    "like_degrees",
    "listed",
    "note_degrees",
    "note_nearly_parallel",
    "said_of_degrees",
]

_NAMED = 4


def listed(names: Iterable[str]) -> str:
    """Return the first names and the number of the others.

    Example:
        >>> listed(["a", "b", "c", "d", "e", "f"])
        'a, b, c, d and 2 more'
    """
    every = list(names)
    return ", ".join(every[:_NAMED]) + (f" and {len(every) - _NAMED} more" if len(every) > _NAMED else "")


def check_mimics(
    joints: Mapping[str, Joint], problems: Problems, places: Mapping[str, tuple[int | None, str | None]]
) -> list[str]:
    """Refuse mimic joints that follow themselves or no moving joint; return notes on what other readers get wrong.

    `places` has line and file of mimic joints that are not declared in the URDF.
    """
    notes, still = list[str](), list[str]()
    moving = {name: joint for name, joint in joints.items() if joint.moves}
    for name, joint in joints.items():
        if joint.mimic is None:
            continue
        if name not in moving:
            still.append(repr(name))
            continue
        primary = joint.mimic.primary
        if primary in moving:
            _note_follower(joint, moving[primary], notes)
            continue
        kind = f"a {joints[primary].type} joint" if primary in joints else "no joint of this robot"
        message = f"joint {name!r} follows {primary!r}, which is {kind}"
        problems.add(message, name_hint(primary, moving), *places.get(name, (joint.line, None)))
    if still:
        notes.append(f"a <mimic> of a joint that is fixed, floating or planar does nothing: {listed(still)}")
    for name, joint in joints.items():
        if name in _followed(joint, joints):
            message = f"joint {name!r} follows itself, through other mimic joints"
            problems.add(message, "Remove the <mimic> of one joint of the cycle", *places.get(name, (joint.line, None)))
    return notes


def _note_follower(joint: Joint, primary: Joint, notes: list[str]) -> None:
    """Note properties of a mimic joint that other readers refuse or get wrong, and pinbound does not."""
    if primary.mimic is not None:
        notes.append(
            f"joint {joint.name!r} follows {primary.name!r}, which is itself a mimic joint: the chain is flattened"
        )
    if (joint.type == "continuous") != (primary.type == "continuous"):
        notes.append(f"{joint.type} joint {joint.name!r} follows {primary.type} joint {primary.name!r}")
    if joint.mimic is not None and joint.mimic.multiplier == 0.0:
        notes.append(f"joint {joint.name!r} follows {primary.name!r} times 0: it does not move")


def _followed(joint: Joint, joints: Mapping[str, Joint]) -> set[str]:
    """Return every joint that this one follows, directly or through others."""
    names: set[str] = set()
    step: Joint | None = joint
    while step is not None and step.mimic is not None and step.mimic.primary not in names:
        names.add(step.mimic.primary)
        step = joints.get(step.mimic.primary)
    return names


def check_tree(links: Mapping[str, Link], joints: Mapping[str, Joint], problems: Problems) -> None:
    """Refuse links that do not form one tree."""
    parent_joint: dict[str, Joint] = {}
    for joint in joints.values():
        first = parent_joint.setdefault(joint.child, joint)
        if first is not joint:
            message = f"link {joint.child!r} is the child of two joints, {first.name!r} and {joint.name!r}"
            remedy = "A URDF is a tree: keep one, and write the other as <pinbound:closure>"
            problems.add(message, remedy, joint.line)
    roots = [name for name in links if name not in parent_joint]
    if links and len(roots) != 1:
        found = ", ".join(map(repr, roots)) or "none: the joints form a cycle"
        message = f"the robot needs one root link, and has {len(roots)} ({found})"
        problems.add(message, "Connect all links by joints into one tree", 1)
        return
    for link in links.values():
        seen, name = {link.name}, link.name
        while name in parent_joint:
            name = parent_joint[name].parent
            if name in seen:
                problems.add(
                    f"link {link.name!r} is part of a cycle of joints, or below one", "Cut the cycle", link.line
                )
                break
            seen.add(name)


def note_nearly_parallel(joints: Mapping[str, Joint]) -> list[str]:
    """Name successive axes that are nearly parallel: they are used as written."""
    below = {joint.child: joint for joint in joints.values()}
    found: list[str] = []
    for joint in joints.values():
        if not joint.moves:
            continue
        direction, step = joint.rotation @ joint.axis, below.get(joint.parent)
        for _ in range(len(joints)):
            if step is None or step.moves:
                break
            direction, step = step.rotation @ direction, below.get(step.parent)
        if step is None or not step.moves:
            continue
        (ax, ay, az), (bx, by, bz) = step.axis.tolist(), direction.tolist()
        angle = math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        if REDUCTION < angle < PARALLEL:
            found.append(f"{step.name!r} and {joint.name!r} ({angle:.2g} rad)")
    if found:
        return [f"axes that are nearly parallel are taken as written: {listed(found)}"]
    return []


_FEWEST_DEGREES, _MOST_DEGREES = 10.0, 720.0


def note_degrees(joints: Mapping[str, Joint], turned: Mapping[str, tuple[float, ...]]) -> list[str]:
    """Name angles that look like degrees: whole numbers from 10 to 720 as limits of revolute joints, or as rpy.

    `turned` holds the rpy of the origins by joint.

    Example:
        >>> note_degrees({}, {"q1": (0.0, 90.0, 0.0), "q2": (0.0, 1.5, 0.0), "q3": (0.0, 0.0, 31.4)})
        ["angles are read as radians, and these look like degrees: rpy 0 90 0 of 'q1'"]
    """
    found = [
        f"limits {joint.lower:g} .. {joint.upper:g} of {name!r}"
        for name, joint in joints.items()
        if joint.type == "revolute" and like_degrees((joint.lower, joint.upper))
    ]
    found += [f"rpy {' '.join(f'{a:g}' for a in rpy)} of {name!r}" for name, rpy in turned.items() if like_degrees(rpy)]
    return said_of_degrees(found)


def said_of_degrees(found: Sequence[str]) -> list[str]:
    """Return the note on angles that look like degrees, if there are any."""
    return [f"angles are read as radians, and these look like degrees: {listed(found)}"] if found else []


def like_degrees(angles: Iterable[float]) -> bool:
    """Return whether angles, at least one, look like degrees: whole numbers, the largest from 10 to 720."""
    sizes = [abs(angle) for angle in angles]
    return all(size.is_integer() for size in sizes) and _FEWEST_DEGREES <= max(sizes) <= _MOST_DEGREES
