"""Pink in closed loop towards places that it must not reach, with step-safe rows; coal counts penetrations.

    python -m benchmarks.bridges_campaign --steps 2000

Robots: MinervaBotV3 (stops), panda_collision and a1 with the marks that `propose_marks` makes of their bodies. dt runs
from 1 ms to 0.2 s. After each step coal is asked for every pair of bodies on links that a boundary watches. Where
there are no bodies (MinervaBotV3) `free` is asked. Then the cost of a step's rows is measured beside Pink's
`SelfCollisionBarrier` on the same pairs of bodies, in the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pink
import pinocchio as pin
from lxml import etree

import pinbound as pb
from benchmarks.robots import PANDA, SHARE
from pinbound.adapters.pink import StepLimit

DTS = (1e-3, 1e-2, 0.05, 0.2)
A1 = SHARE / "example-robot-data/robots/a1_description/urdf/a1.urdf"


@dataclass
class Case:
    name: str
    robot: pb.Robot
    model: Any
    geometry: Any
    frames: tuple[str, ...]


def bodies(path: Any, frames: tuple[str, ...], name: str) -> Case:
    bare = pb.load(path, package_dirs=[str(SHARE)])
    robot = pb.load(path, annotations=pb.propose_marks(bare).annotations, package_dirs=[str(SHARE)])
    model = pin.buildModelFromXML(etree.tostring(robot.document.root).decode(), mimic=True)
    geometry = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(SHARE)])
    watched = {frozenset((b.point_a.link, b.point_b.link)) for b in robot.boundaries}
    links = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    for i, a in enumerate(links):
        for j in range(i + 1, len(links)):
            if frozenset((a, links[j])) in watched:
                geometry.addCollisionPair(pin.CollisionPair(i, j))
    return Case(name, robot, model, geometry, frames)


def minervabot() -> Case:
    robot = pb.load("minervabot_v3")
    model = pin.buildModelFromXML(etree.tostring(robot.document.root).decode(), mimic=True)
    return Case("MinervaBotV3", robot, model, None, ("link_3",))


def touches(case: Case) -> Callable[[Any], bool]:
    if case.geometry is None:
        view = case.robot.on(case.model)
        return lambda q: not view.free(q, limits=False)
    data, places = case.model.createData(), pin.GeometryData(case.geometry)
    return lambda q: bool(pin.computeCollisions(case.model, data, case.geometry, places, q, True))


def drive(case: Case, steps: int, seed: int) -> dict[str, Any]:
    robot, rng, hit = case.robot, np.random.default_rng(seed), touches(case)
    counts = {"steps": 0, "penetrations": 0, "infeasible": 0, "blocked": 0}
    smallest, view = np.inf, robot.on(case.model)
    for dt in DTS:
        limit = StepLimit(robot, case.model, velocity=2.0)
        configuration = pink.Configuration(
            case.model, case.model.createData(), robot.to_pinocchio(case.model, robot.home)
        )
        for index in range(steps // len(DTS)):
            if index % 40 == 0:
                frame = case.frames[int(rng.integers(len(case.frames)))]
                task = pink.FrameTask(frame, position_cost=1.0, orientation_cost=0.0, gain=0.6)
                task.set_target(pin.SE3(np.eye(3), rng.uniform(-0.5, 0.5, 3)))
            before = configuration.q
            try:
                v = pink.solve_ik(
                    configuration, [task], dt, "quadprog", damping=1e-6, limits=[limit], safety_break=False
                )
            except pink.exceptions.NoSolutionFound:
                counts["infeasible"] += 1
                v = np.zeros(case.model.nv)
            for share in (0.5, 1.0):
                counts["penetrations"] += hit(pin.integrate(case.model, before, share * v * dt))
            configuration.update(pin.integrate(case.model, before, v * dt))
            counts["steps"] += 1
            counts["blocked"] += bool(limit.steps.last and limit.steps.last.blocked)
            smallest = min(smallest, float(view.clearances(configuration.q).min()))
    return counts | {"smallest [mm]": round(1e3 * smallest, 3)}


def seconds(call: Callable[[Any], Any], way: list[Any]) -> float:
    """Return the median time of a call along a way of configurations."""
    took: list[float] = []
    for q in way:
        start = time.perf_counter()
        call(q)
        took.append(time.perf_counter() - start)
    return float(np.median(took))


def cost(case: Case) -> dict[str, float]:
    """Return microseconds a step: our rows, and Pink's distances and rows on the same pairs of bodies."""
    robot, rng = case.robot, np.random.default_rng(1)
    limit = StepLimit(robot, case.model, velocity=2.0)
    steps = np.cumsum(rng.uniform(-1e-3, 1e-3, (40, len(robot.home))), axis=0)
    way = [robot.to_pinocchio(case.model, robot.home + step) for step in steps]
    plain = pink.Configuration(case.model, case.model.createData(), way[0])

    def ours(q: Any) -> None:
        plain.q = q
        limit.compute_qp_inequalities(plain, 1e-3)

    mine = seconds(ours, way)
    if case.geometry is None:
        return {"rows [us]": 1e6 * mine}
    both = pink.Configuration(case.model, case.model.createData(), way[0], collision_model=case.geometry)
    count = len(case.geometry.collisionPairs)
    barrier = pink.barriers.SelfCollisionBarrier(count, safe_displacement_gain=0.0, d_min=0.0)

    def theirs(q: Any) -> None:
        both.update(q)
        barrier.compute_jacobian(both)
        barrier.compute_barrier(both)

    other = seconds(theirs, way[:20]) - seconds(plain.update, way)
    return {"rows [us]": 1e6 * mine, "Pink's barrier [us]": 1e6 * other, "ratio": other / mine}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="name of one robot")
    options = parser.parse_args()
    feet = tuple(f"{side}_calf" for side in ("FR", "FL", "RR", "RL"))
    cases = {
        "MinervaBotV3": minervabot,
        "panda_collision": lambda: bodies(PANDA, ("panda_hand",), "panda_collision"),
        "a1": lambda: bodies(A1, feet, "a1"),
    }
    for name, make in cases.items():
        if options.only not in (None, name):
            continue
        case = make()
        pairs = 0 if case.geometry is None else len(case.geometry.collisionPairs)
        print(f"{case.name}: {len(case.robot.boundaries)} boundaries, {pairs} pairs of bodies", flush=True)
        print("  cost", {key: round(value, 1) for key, value in cost(case).items()}, flush=True)
        print("  drive", drive(case, options.steps, options.seed), flush=True)


if __name__ == "__main__":
    main()
