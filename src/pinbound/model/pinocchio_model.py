"""The robot in Pinocchio: its whole tree as a model, and a comparison of Pinocchio's reading of the file with ours."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from copy import deepcopy
from typing import Any, cast

import numpy as np
from lxml import etree

from pinbound.exceptions import DimensionError, Problems
from pinbound.geometry.rotations import rotation_matrix
from pinbound.model.coupling import couple
from pinbound.model.document import Document
from pinbound.model.kinematics import Joint, Kinematics
from pinbound.model.tree import Tree
from pinbound.model.xml_text import local_name, refusal
from pinbound.tolerances import AGREEMENT, UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["build_model", "check_model", "compare_with_pinocchio", "placements"]

_UNBOUNDED = "1e9"  # urdfdom does not read "inf"; build_model restores infinity


def check_model(model: Any) -> None:
    """Refuse what is no model of Pinocchio.

    Raises:
        DimensionError: If it is none.
    """
    import pinocchio

    if not isinstance(model, cast(Any, pinocchio).Model):
        said = f"the model is of type {type(model).__name__}"
        raise DimensionError(f"{said}; give a pinocchio.Model, e.g. robot.model, or the .model of a wrapper")


def build_model(document: Document, kinematics: Kinematics) -> Any:
    """Build the `pinocchio.Model` of the whole tree, with one coordinate for each moving joint.

    In it, mimic joints are free joints, and continuous joints are revolute ones without limits (so nq = nv). Floating
    and planar joints are fixed at their origin, because no boundary may depend on them.

    Raises:
        InputError: If Pinocchio refuses the normalised URDF.
    """
    import pinocchio

    pin = cast(Any, pinocchio)
    root = deepcopy(document.root)
    root.set("name", kinematics.name)
    for element in list(root):
        if not isinstance(element.tag, str) or element.tag not in ("link", "joint"):
            root.remove(element)
    for element in root.iter("link"):
        for child in [*element.findall("visual"), *element.findall("collision")]:
            element.remove(child)
    joints = {joint.name: joint for joint in kinematics.joints}
    for element in root.findall("joint"):
        _normalise_joint(element, joints[str(element.get("name"))])
    try:
        model = pin.buildModelFromXML(etree.tostring(root).decode())
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[0]
        raise refusal(document.label, f"Pinocchio refuses it: {reason}", "Correct the URDF") from error
    for name, joint in joints.items():
        if joint.moves:
            index = model.joints[model.getJointId(name)].idx_q
            model.lowerPositionLimit[index], model.upperPositionLimit[index] = joint.lower, joint.upper
    return model


def _normalise_joint(element: etree._Element, joint: Joint) -> None:
    limit = element.find("limit")
    said = {} if limit is None else {key: str(limit.get(key, "0")).strip() for key in ("effort", "velocity")}
    given = {key: value for key, value in said.items() if _usable(value)}
    for child in list(element):
        if local_name(child) not in ("parent", "child", "origin", "axis"):
            element.remove(child)
    if joint.type in ("floating", "planar"):
        element.set("type", "fixed")
    if joint.moves:
        element.set("type", "prismatic" if joint.type == "prismatic" else "revolute")
        bounds = {"lower": f"-{_UNBOUNDED}", "upper": _UNBOUNDED, "effort": "0", "velocity": "0"}
        etree.SubElement(element, "limit", bounds | given)


def compare_with_pinocchio(
    document: Document, tree: Tree, problems: Problems, limits: Collection[str] = (), followers: Collection[str] = ()
) -> None:
    """Build the file as a user of Pinocchio would, and refuse it if Pinocchio reads it differently.

    Limits of every joint, and the placement of every link at one random configuration, must agree to `AGREEMENT`: with
    free mimic joints, and also with `mimic=True` if Pinocchio can build that. Files that Pinocchio refuses and pinbound
    accepts with a note (a limit without effort, for example) are first rewritten for Pinocchio.

    Args:
        document: The normalised document.
        tree: Links and joints as read from it.
        problems: Collects the differences, each with joint or link and both values.
        limits: Joints whose limits annotations replace, so that those of the file do not apply.
        followers: Joints whose `<mimic>` annotations replace.
    """
    if not any(joint.type != "fixed" for joint in tree.kinematics.joints):
        return
    text = _stock_text(document, tree.kinematics)
    model = _build(text, document.label)
    _compare_limits(document, model, tree, problems, limits)
    theta = np.random.default_rng(0).uniform(-1.0, 1.0, len(tree.moving_joints))
    _compare_placements(model, tree, theta, problems, "")
    mimics = [joint for joint in tree.moving_joints if joint.mimic is not None]
    if not mimics or followers or problems.found or not _stock_mimics(tree):
        return
    coupling = couple(tree.moving_joints)
    theta = coupling.expand(np.random.default_rng(1).uniform(-1.0, 1.0, len(coupling.coordinates)))
    try:
        model = _build(text, document.label, mimic=True)
    except ValueError:
        return  # `check_mimics` reports what it refuses in mimic joints, or it is one of its own limitations
    _compare_placements(model, tree, theta, problems, ", with mimic joints")


def _build(text: str, label: str, mimic: bool = False) -> Any:
    import pinocchio

    try:
        return cast(Any, pinocchio).buildModelFromXML(text, mimic)
    except (ValueError, RuntimeError) as error:
        if mimic:
            raise ValueError(str(error)) from error
        reason = str(error).strip().splitlines()[0]
        raise refusal(label, f"Pinocchio refuses it: {reason}", "Correct the URDF") from error


def _stock_text(document: Document, kinematics: Kinematics) -> str:
    """Return the kinematics for Pinocchio: links without bodies, and joints as written.

    Only what Pinocchio refuses is changed: a robot without a name; limits without `effort`, `velocity` or any; numbers
    that are not finite, negative, or surrounded by spaces. Elements that move no link are left out (`<dynamics>`, for
    example).
    """
    joints = {joint.name: joint for joint in kinematics.joints}
    parts = [f"<robot name={_quoted(kinematics.name)}>"]
    for element in document.root.iterchildren(etree.Element):
        if element.tag == "joint":
            parts.append(_stock_joint(element, joints.get(str(element.get("name")))))
        elif element.tag == "link":
            parts.append(f"<link name={_quoted(str(element.get('name')))}/>")
    return "".join([*parts, "</robot>"])


def _quoted(name: str) -> str:
    from xml.sax.saxutils import quoteattr  # loads urllib, http and ssl

    return quoteattr(name)


_MOVES_LINKS = ("parent", "child", "origin", "axis", "limit", "mimic")


def _stock_joint(element: etree._Element, joint: Joint | None) -> str:
    element = deepcopy(element)
    for child in list(element):
        if child.tag not in _MOVES_LINKS:
            element.remove(child)
    for child in (*element.findall("limit"), *element.findall("mimic")):
        for key in child.keys():
            if key != "joint":
                child.set(key, child.get(key, "").strip())
    limit = element.find("limit")
    if joint is not None and joint.type == "continuous" and limit is not None:
        for key in ("lower", "upper"):  # they have no effect
            limit.attrib.pop(key, None)
    if joint is not None and joint.moves:
        missing = [key for key in ("effort", "velocity") if limit is None or not _usable(limit.get(key))]
        if missing and (limit is not None or joint.type != "continuous"):
            if limit is None:
                limit = etree.SubElement(element, "limit", {"lower": "0", "upper": "0"})
            for key in missing:
                limit.set(key, "0")
    return etree.tostring(element, encoding="unicode", with_tail=False)


def _usable(text: str | None) -> bool:
    try:
        return text is not None and 0.0 <= float(text) < math.inf
    except ValueError:
        return False


def _stock_mimics(tree: Tree) -> bool:
    """Return whether Pinocchio can build the mimic joints: no chains, no continuous ones, the primary read first."""
    order = [joint.name for joint in tree.moving_joints]
    joints = {joint.name: joint for joint in tree.moving_joints}
    for name, joint in joints.items():
        if joint.mimic is None:
            continue
        primary = joints[joint.mimic.primary]
        continuous = "continuous" in (joint.type, primary.type)
        if primary.mimic is not None or continuous or order.index(primary.name) > order.index(name):
            return False
    return True


def _compare_limits(document: Document, model: Any, tree: Tree, problems: Problems, replaced: Collection[str]) -> None:
    given = {str(element.get("name")): element.find("limit") for element in document.root.findall("joint")}
    names = list(model.names)
    for joint in tree.moving_joints:
        limit = given[joint.name]
        if joint.name in replaced or joint.name not in names or joint.type == "continuous" or limit is None:
            continue
        index = model.joints[names.index(joint.name)].idx_q
        theirs = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
        if theirs != (joint.lower, joint.upper):
            message = f"Pinocchio reads the limits of joint {joint.name!r} as {theirs[0]:.9g} .. {theirs[1]:.9g}, "
            message += f"not {joint.lower:.9g} .. {joint.upper:.9g}"
            problems.add(message, _REPORT, joint.line)


_REPORT = "Write the file so that all readers agree; if it already is plain URDF, report this as a bug of pinbound"


def _compare_placements(model: Any, tree: Tree, theta: Array, problems: Problems, how: str) -> None:
    import pinocchio

    pin = cast(Any, pinocchio)
    order = [joint.name for joint in tree.moving_joints]
    q = pin.neutral(model)
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if "Mimic" in joint.shortname() or int(joint.nv) != 1:
            continue
        if name not in order:
            problems.add(f"Pinocchio moves joint {name!r}, which does not move here", _REPORT)
            return
        value = float(theta[order.index(name)])
        q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (math.cos(value), math.sin(value))
    bodies = {frame.name: index for index, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY}
    names, ours = placements(tree, dict(zip(order, theta.tolist(), strict=True)))
    unseen = [name for name in names if name not in bodies]
    if unseen:
        problems.add(f"Pinocchio does not see link {unseen[0]!r}", _REPORT, tree.links[unseen[0]].line)
        return
    places = _frame_places(model, q)
    theirs = np.array([places[bodies[name]] for name in names])
    slid, turned_by = _magnitudes(tree, dict(zip(order, theta.tolist(), strict=True)))
    size = 1.0 + slid + sum(math.hypot(*joint.translation) for joint in tree.kinematics.joints)
    allowed = (AGREEMENT + 8.0 * UNIT_ROUNDOFF * turned_by) * np.array([1.0, 1.0, 1.0, size])
    wrong = np.flatnonzero(~np.all(np.abs(theirs - ours) <= allowed, axis=(1, 2)))
    if wrong.size:  # in the order of the tree: the first link that differs is below the joint that differs
        first = int(wrong[0])
        link = names[first]
        joint = tree.parent_joint.get(link)
        a, b = theirs[first], ours[first]
        turned = float(np.abs(a[:, :3] - b[:, :3]).max())
        what = "the root" if joint is None else f"joint {joint.name!r}"
        message = (
            f"Pinocchio places link {link!r} elsewhere{how}: at {_place(a[:, 3])} m, not {_place(b[:, 3])} m; its "
        )
        message += f"axes differ by up to {turned:.3g}; {what} is the first that differs"
        problems.add(message, _REPORT, joint.line if joint else tree.links[link].line)


_LARGE = 100
"""Joints beyond which Pinocchio's `Data`, with its arrays of nv^3 numbers, is not made: 1 GB each for 500 joints."""


def _frame_places(model: Any, q: Array) -> list[Array]:
    """Return Pinocchio's placements (3, 4) of all frames at q."""
    import pinocchio

    pin = cast(Any, pinocchio)
    if model.nv <= _LARGE:
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        return [place.homogeneous[:3] for place in data.oMf]
    of_joint = [pin.SE3.Identity()]
    for index in range(1, model.njoints):
        joint = model.joints[index]
        data = joint.createData()
        joint.calc(data, q)
        of_joint.append(of_joint[model.parents[index]] * model.jointPlacements[index] * data.M)
    return [(of_joint[frame.parentJoint] * frame.placement).homogeneous[:3] for frame in model.frames]


def _magnitudes(tree: Tree, theta: Mapping[str, float]) -> tuple[float, float]:
    """Return the sums of all slides [m] and of all angles [rad], each as large as the terms that it is made of.

    Both readers round the terms of a mimic joint, which may cancel: `abs(multiplier) abs(primary) + abs(offset)`.
    """
    joints = {joint.name: joint for joint in tree.moving_joints}
    known: dict[str, float] = {}

    def size(name: str) -> float:
        if name not in known:
            mimic = joints[name].mimic
            known[name] = abs(theta[name])
            if mimic is not None:
                known[name] = max(known[name], abs(mimic.multiplier) * size(mimic.primary) + abs(mimic.offset))
        return known[name]

    slid = sum(size(name) for name, joint in joints.items() if joint.type == "prismatic")
    return slid, sum(size(name) for name, joint in joints.items() if joint.type != "prismatic")


def placements(tree: Tree, theta: Mapping[str, float]) -> tuple[list[str], Array]:
    """Return the links, the root first, and (N, 3, 4) where they are at `theta`, in the root link's frame."""
    places: dict[str, tuple[Array, Array]] = {}
    for link, joint, _ in tree.walk():
        if joint is None:
            places[link.name] = np.eye(3), np.zeros(3)
            continue
        rotation, translation = joint.rotation, joint.translation
        if joint.type == "prismatic":
            translation = translation + rotation @ (joint.axis * theta[joint.name])
        elif joint.moves:
            rotation = rotation @ rotation_matrix(joint.axis, theta[joint.name])
        above, origin = places[joint.parent]
        places[link.name] = above @ rotation, origin + above @ translation
    turned, moved = zip(*places.values(), strict=True)
    return list(places), np.concatenate([np.array(turned), np.array(moved)[:, :, None]], axis=2)


def _place(vector: Array) -> str:
    return "(" + ", ".join(f"{float(part):.9g}" for part in vector) + ")"
