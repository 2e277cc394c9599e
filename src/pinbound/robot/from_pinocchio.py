"""A robot from a `pinocchio.Model` and its `GeometryModel`, without a URDF.

Frames give the links and how they are connected, joints give the motions, and geometry objects give the bodies. All
this becomes the text of a URDF, which `load` reads and checks like any other. Then the robot is compared with the
model, link by link (`Robot.on`). Anything that the model and the geometry do not determine is refused by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from lxml import etree

from pinbound.exceptions import UnsupportedError
from pinbound.model.pinocchio_model import check_model
from pinbound.robot.loading import AnnotationSource, load
from pinbound.robot.robot import Robot
from pinbound.tolerances import SAME_ROBOT

__all__ = ["from_pinocchio", "urdf_text"]

_FLYING = "JointModelFreeFlyer"


def from_pinocchio(
    model: Any,
    geometry: Any = None,
    annotations: AnnotationSource | Sequence[AnnotationSource] | None = None,
    package_dirs: Sequence[str | Path] = (),
) -> Robot:
    """Return the robot of a Pinocchio model, with its bodies if a geometry model is given.

    A free flyer at the root is left out, because boundaries do not depend on it. Locked joints of a reduced model
    become fixed joints. Masses are not read, because nothing depends on them.

    Args:
        model: A `pinocchio.Model`; it is not changed.
        geometry: A `pinocchio.GeometryModel` of this model.
        annotations: As for `load`.
        package_dirs: As for `load`.

    Raises:
        UnsupportedError: If the model and its geometry do not determine the robot: a joint has several degrees of
            freedom, a frame belongs to no link, or a body is neither a primitive nor a mesh with its file.
        InputError: If the annotations or the model have faults.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> again = pb.from_pinocchio(robot.model, annotations=robot.annotations)
        >>> again.boundaries.names == robot.boundaries.names
        True
    """
    given = () if annotations is None else annotations
    robot = load(urdf_text(model, geometry), annotations=given, package_dirs=package_dirs)
    robot.on(model)
    return robot


def urdf_text(model: Any, geometry: Any = None) -> str:
    """Return the URDF that a Pinocchio model and its geometry model determine.

    Raises:
        UnsupportedError: As `from_pinocchio`.
    """
    import pinocchio

    check_model(model)
    pin = cast(Any, pinocchio)
    root = etree.Element("robot", name=str(model.name) or "robot")
    links: dict[int, etree._Element] = {}
    kinds = pin.FrameType
    for index, frame in enumerate(model.frames):
        if frame.type == kinds.BODY:
            links[index] = etree.SubElement(root, "link", name=str(frame.name))
    if not links:
        raise _undetermined("the model has no body frames, and so no links")
    above = [int(model.frames[index].parentFrame) for index in links]
    for index, one in zip(links, above, strict=True):
        if one and above.count(one) > 1:
            twice = [str(model.frames[k].name) for k, other in zip(links, above, strict=True) if other == one]
            raise _undetermined(f"body frames {', '.join(map(repr, twice))} hang on one joint")
        _hang(pin, model, index, root)
    for one in () if geometry is None else geometry.geometryObjects:
        _body(pin, model, one, links)
    return etree.tostring(root).decode()


def _hang(pin: Any, model: Any, index: int, root: etree._Element) -> None:
    """Write the joint above a link, if there is one."""
    frame = model.frames[index]
    above = int(frame.parentFrame)
    if above == 0:
        return  # the root link, fixed to the world
    via = model.frames[above]
    kinds = pin.FrameType
    if via.type not in (kinds.JOINT, kinds.FIXED_JOINT):
        raise _undetermined(f"body frame {frame.name!r} hangs on {via.name!r}, which is no joint")
    joint = model.joints[int(via.parentJoint)] if via.type == kinds.JOINT else None
    placed = model.jointPlacements[int(via.parentJoint)] if joint is not None else via.placement
    between = frame.placement if joint is not None else via.placement.actInv(frame.placement)
    if np.abs(between.homogeneous - np.eye(4)).max() > SAME_ROBOT:
        raise _undetermined(f"body frame {frame.name!r} is not where its joint {via.name!r} is")
    parent = model.frames[int(via.parentFrame)]
    if joint is None and int(via.parentFrame) == above:  # a locked joint of a reduced model: its link is missing
        same = [one for one in model.frames if one.type == kinds.BODY and one.parentJoint == via.parentJoint]
        parent = same[0]
    if joint is not None and joint.shortname() == _FLYING and int(via.parentFrame) == 0:
        return
    if parent.type != kinds.BODY:
        raise _undetermined(f"joint {via.name!r} hangs on {parent.name!r}, which is not a body frame")
    made = etree.SubElement(root, "joint", name=str(via.name), type="fixed")
    etree.SubElement(made, "parent", link=str(parent.name))
    etree.SubElement(made, "child", link=str(frame.name))
    _origin(pin, made, parent.placement.actInv(placed))
    if joint is not None:
        _moving(pin, model, str(via.name), joint, made)


def _moving(pin: Any, model: Any, name: str, joint: Any, made: etree._Element) -> None:
    kind, own = joint.shortname(), joint.extract()
    mimics = kind == "JointModelMimic"
    if not mimics and int(joint.nv) != 1:
        raise _undetermined(f"joint {name!r} is a {kind}, of {int(joint.nv)} degrees of freedom")
    scale = 1.0
    if mimics:
        position = list(model.mimicking_joints).index(int(joint.id))
        primary = str(model.names[int(model.mimicked_joints[position])])
        scale = float(own.scaling)
        etree.SubElement(made, "mimic", joint=primary, multiplier=repr(scale), offset=repr(float(own.offset)))
        if scale == 0.0:
            raise _undetermined(f"joint {name!r} follows {primary!r} by a factor of zero, and its axis is not known")
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    line = np.asarray(data.S, dtype=np.float64).ravel() / scale
    slides = not np.any(line[3:])
    if np.any(line[3:]) and np.any(line[:3]):
        raise _undetermined(f"joint {name!r} is a {kind}, which turns and slides")
    etree.SubElement(made, "axis", xyz=_numbers(line[:3] if slides else line[3:]))
    endless = not mimics and int(joint.nq) == 2
    made.set("type", "prismatic" if slides else "continuous" if endless else "revolute")
    if endless:
        return
    # The model does not keep the limits of a mimic joint, so they are unknown, and the URDF gets none.
    ends = (-np.inf, np.inf) if mimics else _limits(model, joint)
    said = {"lower": ends[0], "upper": ends[1]}
    if not slides and not all(map(np.isfinite, said.values())):
        made.set("type", "continuous")
        return
    given = {key: repr(float(value)) for key, value in said.items() if np.isfinite(value)}
    if slides and len(given) < 2:
        given = {key: repr(float(np.clip(value, -_UNBOUNDED, _UNBOUNDED))) for key, value in said.items()}
    etree.SubElement(made, "limit", {"effort": "0", "velocity": "0"} | given)


_UNBOUNDED = 1e16
"""The value that SDF and URDF exporters write for a joint without limits; `load` reads it as no limit."""


def _limits(model: Any, joint: Any) -> tuple[float, float]:
    at = int(joint.idx_q)
    return float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at])


def _body(pin: Any, model: Any, one: Any, links: dict[int, etree._Element]) -> None:
    """Write the collision bodies of one geometry object."""
    frame = int(one.parentFrame)
    if frame not in links:
        name = model.frames[frame].name if frame < len(model.frames) else str(frame)
        raise _undetermined(f"geometry object {one.name!r} stands on {name!r}, which is not a body frame")
    place = model.frames[frame].placement.actInv(one.placement)
    shape = one.geometry
    kind = type(shape).__name__
    if kind == "Sphere":
        _collision(pin, links[frame], one.name, place, "sphere", radius=repr(float(shape.radius)))
    elif kind == "Box":
        _collision(pin, links[frame], one.name, place, "box", size=_numbers(2.0 * np.asarray(shape.halfSide)))
    elif kind in ("Cylinder", "Capsule"):
        radius, half = float(shape.radius), float(shape.halfLength)
        _collision(pin, links[frame], one.name, place, "cylinder", radius=repr(radius), length=repr(2.0 * half))
        for sign in (-1.0, 1.0) if kind == "Capsule" else ():
            end = place * pin.SE3(np.eye(3), np.array([0.0, 0.0, sign * half]))
            _collision(
                pin, links[frame], f"{one.name}_{'upper' if sign > 0 else 'lower'}", end, "sphere", radius=repr(radius)
            )
    elif kind.startswith("BVH") and Path(str(one.meshPath)).is_file():
        scale = _numbers(np.asarray(one.meshScale).ravel())
        _collision(pin, links[frame], one.name, place, "mesh", filename=str(one.meshPath), scale=scale)
    else:
        file = f", and its file {str(one.meshPath)!r} is not there" if kind.startswith("BVH") else ""
        raise _undetermined(f"geometry object {one.name!r} is a {kind}{file}")


def _collision(pin: Any, link: etree._Element, name: str, place: Any, tag: str, **said: str) -> None:
    made = etree.SubElement(link, "collision", name=str(name))
    _origin(pin, made, place)
    etree.SubElement(etree.SubElement(made, "geometry"), tag, said)


def _origin(pin: Any, above: etree._Element, place: Any) -> None:
    rpy = pin.rpy.matrixToRpy(place.rotation)
    etree.SubElement(above, "origin", xyz=_numbers(place.translation), rpy=_numbers(rpy))


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values).ravel())


def _undetermined(said: str) -> UnsupportedError:
    return UnsupportedError(f"{said}: the model does not say what the robot is; load() its URDF instead")
