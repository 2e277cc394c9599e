"""The robots that are measured: MinervaBotV3 with its ten boundaries, and the Panda as spheres."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import pinbound as pb

SHARE = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
HOME = {"panda_joint4": -1.5, "panda_joint6": 1.8}
PANDA = SHARE / "example-robot-data/robots/panda_description/urdf/panda_collision.urdf"


def minervabot() -> Any:
    return pb.load("minervabot_v3")


def panda(folder: Path, only: tuple[str, str] | None = None) -> Any:
    """All sphere pairs of panda_collision on links that are neither the same nor neighbours; or one pair of links.

    Pairs that overlap at home, as an SRDF would list them, are left out.
    """
    model = pin.buildModelFromUrdf(str(PANDA))
    geometry = pin.buildGeomFromUrdf(model, str(PANDA), pin.GeometryType.COLLISION, package_dirs=[str(SHARE)])
    points = []
    for index, item in enumerate(geometry.geometryObjects):
        if not hasattr(item.geometry, "radius") or hasattr(item.geometry, "halfLength"):
            continue
        frame = model.frames[item.parentFrame]
        local = frame.placement.actInv(item.placement).translation
        points.append((f"s{index}", frame.name, local, float(item.geometry.radius), item.parentJoint))
    pairs = [(a, b) for i, a in enumerate(points) for b in points[i + 1 :] if _apart(model, a[4], b[4])]
    data, q = model.createData(), pin.neutral(model)
    for name, value in HOME.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    where = {p[0]: data.oMf[model.getFrameId(p[1])].act(p[2]) for p in points}
    pairs = [(a, b) for a, b in pairs if np.linalg.norm(where[a[0]] - where[b[0]]) > a[3] + b[3]]
    if only:
        pairs = [next(p for p in pairs if {p[0][1], p[1][1]} == set(only))]
    used = {p[0] for pair in pairs for p in pair}
    sidecar = {
        "home": HOME,
        "points": [
            {"name": n, "link": link, "xyz": xyz.tolist(), "radius": r} for n, link, xyz, r, _ in points if n in used
        ],
        "boundaries": [{"name": f"{a[0]}-{b[0]}", "a": a[0], "b": b[0]} for a, b in pairs],
    }
    path = folder / ("panda_pair.yaml" if only else "panda.yaml")
    path.write_text(json.dumps(sidecar))
    return pb.load(PANDA, annotations=path)


def _apart(model: Any, a: int, b: int) -> bool:
    """Whether two joints are at least two apart in the tree; the two fingers count as neighbours."""
    return a != b and model.parents[a] != b and model.parents[b] != a and model.parents[a] != model.parents[b]


def geometry_of(robot: Any, radius: float | None = None) -> tuple[Any, Any]:
    """The same marked points as spheres of a Pinocchio model, for the peers."""
    import coal

    model = robot.model
    geometry = pin.GeometryModel()
    points = {p.name: p for b in robot.boundaries for p in (b.point_a, b.point_b)}
    where = {}
    for name, point in points.items():
        frame = model.frames[model.getFrameId(point.link)]
        placement = frame.placement * pin.SE3(np.eye(3), np.array(point.xyz))
        shape = coal.Sphere(point.radius if radius is None else radius)
        where[name] = geometry.addGeometryObject(pin.GeometryObject(name, frame.parentJoint, placement, shape))
    for boundary in robot.boundaries:
        geometry.addCollisionPair(pin.CollisionPair(where[boundary.point_a.name], where[boundary.point_b.name]))
    return model, geometry
