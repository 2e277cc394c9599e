"""Controllers in closed loop towards places that they must not reach, with step-safe rows; coal counts penetrations.

    python -m benchmarks.bridges_campaign --steps 2000 --solver pink
    python -m benchmarks.bridges_campaign --cost

Robots: MinervaBotV3 (stops), panda_collision and a1 with the marks that `propose_marks` makes of their bodies. Solvers:
`pink` and `mink`, as their users call them, a frame sent to places all around; `plain`, the same rows in a QP of our
own, `min |d - d*|^2`, d* towards joint values of which most are forbidden. dt runs from 1 ms to 0.2 s, speeds are
2 rad/s. Of every step its half and its end are kept, and counted in bulk: coal is asked for every pair of bodies on
links that a boundary watches; where there are no bodies (MinervaBotV3) `free` is asked. Slices are printed as they end,
so that a campaign can be stopped: the sum of its slices is its result.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

import pinbound as pb
from benchmarks.robots import PANDA, SHARE
from pinbound.adapters.shared import SafeSteps

DTS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2)
A1 = SHARE / "example-robot-data/robots/a1_description/urdf/a1.urdf"
SPEED = 2.0
SLICE = 1000
GOAL = 40  # steps towards one goal


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


CASES: dict[str, Callable[[], Case]] = {
    "MinervaBotV3": minervabot,
    "panda_collision": lambda: bodies(PANDA, ("panda_hand",), "panda_collision"),
    "a1": lambda: bodies(A1, tuple(f"{side}_calf" for side in ("FR", "FL", "RR", "RL")), "a1"),
}


def penetrations(case: Case, Q: Any) -> int:
    """Count the configurations (N, n) in which two bodies meet."""
    if case.geometry is None:
        return int(np.count_nonzero(~case.robot.boundaries.free(Q, limits=False)))
    data, places = case.model.createData(), pin.GeometryData(case.geometry)
    return sum(
        bool(pin.computeCollisions(case.model, data, case.geometry, places, q, True))
        for q in case.robot.to_pinocchio(case.model, Q)
    )


@dataclass
class Answer:
    """A step d of the robot's coordinates; None if the program is infeasible."""

    d: Any
    blocked: bool


class Plain:
    """The rows of `SafeSteps` in a QP of our own: the step nearest to the way towards joint values."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        import quadprog

        self.solve, self.rng, self.n = quadprog.solve_qp, rng, len(case.robot.home)
        self.bounds = pb.StepBounds(case.robot)
        self.bounds.prepare()
        lower, upper = (np.clip(end, -np.pi, np.pi) for end in (case.robot.lower, case.robot.upper))
        goals = rng.uniform(lower, upper, (400, self.n))
        forbidden = goals[~case.robot.boundaries.free(goals, limits=False)]
        self.goals = np.concatenate((forbidden[:70], goals[:30]))

    def aim(self) -> None:
        self.goal = self.goals[int(self.rng.integers(len(self.goals)))]

    def step(self, q: Any, dt: float) -> Answer:
        rows = self.bounds.rows(q, SPEED * dt)
        A, b = rows.half_spaces
        wanted = np.clip(self.goal - q, -SPEED * dt, SPEED * dt)
        # In units of the step, or quadprog's tolerance for a constraint that is kept would be many steps of 1 ms.
        size = SPEED * dt
        try:
            d = size * self.solve(np.eye(self.n), wanted / size, -A.T * size, -b)[0]
        except ValueError:  # constraints are inconsistent
            d = None
        return Answer(d, bool(rows.blocked))


class Pink:
    """Pink, as its users call it."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        import pink

        from pinbound.adapters.pink import StepLimit

        self.pink, self.case, self.rng = pink, case, rng
        self.limit = StepLimit(case.robot, case.model, velocity=SPEED)
        home = case.robot.to_pinocchio(case.model, case.robot.home)
        self.configuration = pink.Configuration(case.model, case.model.createData(), home)

    def aim(self) -> None:
        frame = self.case.frames[int(self.rng.integers(len(self.case.frames)))]
        self.task = self.pink.FrameTask(frame, position_cost=1.0, orientation_cost=0.0, gain=0.6)
        self.task.set_target(pin.SE3(np.eye(3), self.rng.uniform(-0.5, 0.5, 3)))

    def step(self, q: Any, dt: float) -> Answer:
        given = self.case.robot.to_pinocchio(self.case.model, q)
        self.configuration.update(given)
        options = {"damping": 1e-6, "limits": [self.limit], "safety_break": False}
        try:
            v = self.pink.solve_ik(self.configuration, [self.task], dt, "quadprog", **options)
        except self.pink.exceptions.NoSolutionFound:
            return Answer(None, bool(self.limit.steps.last.blocked))
        return Answer(self.limit.steps.view.E @ v * dt, bool(self.limit.steps.last.blocked))


class Mink:
    """mink, as its users call it, with a MuJoCo model of the same URDF."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        import mink
        import mujoco

        from pinbound.adapters.mink import StepLimit

        self.mink, self.case, self.rng = mink, case, rng
        model = mujoco.MjModel.from_xml_string(_for_mujoco(case.robot))
        self.limit = StepLimit(case.robot, model, velocity=dict.fromkeys(case.robot.coordinates, SPEED))
        self.configuration = mink.Configuration(model)
        self.places = [model.joint(name).qposadr[0] for name in case.robot.coupling.joints]

    def aim(self) -> None:
        frame = self.case.frames[int(self.rng.integers(len(self.case.frames)))]
        self.task = self.mink.FrameTask(frame, "body", position_cost=1.0, orientation_cost=0.0, gain=0.6)
        self.task.set_target(self.mink.SE3.from_translation(self.rng.uniform(-0.5, 0.5, 3)))

    def step(self, q: Any, dt: float) -> Answer:
        full = np.array(self.configuration.q)
        full[self.places] = self.case.robot.coupling.expand(q)
        self.configuration.update(full)
        try:
            v = self.mink.solve_ik(self.configuration, [self.task], dt, "quadprog", damping=1e-6, limits=[self.limit])
        except self.mink.exceptions.NoSolutionFound:
            return Answer(None, bool(self.limit.steps.last.blocked))
        return Answer(self.limit.steps.view.E @ v * dt, bool(self.limit.steps.last.blocked))


def _for_mujoco(robot: pb.Robot) -> str:
    """Return the URDF without geometry, every link with an inertia: MuJoCo keeps all bodies by name."""
    root = etree.fromstring(etree.tostring(robot.document.root))
    for link in root.iterchildren("link"):
        for child in [*link]:
            if child.tag in ("visual", "collision", "inertial"):
                link.remove(child)
        inertial = etree.SubElement(link, "inertial")
        etree.SubElement(inertial, "mass", value="1")
        etree.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    head = etree.SubElement(root, "mujoco")
    etree.SubElement(head, "compiler", fusestatic="false", balanceinertia="true")
    return etree.tostring(root).decode()


SOLVERS: dict[str, Callable[[Case, np.random.Generator], Any]] = {"pink": Pink, "mink": Mink, "plain": Plain}


def drive(case: Case, solver: str, steps: int, seed: int) -> dict[str, Any]:
    """Return the counts of one slice, from home."""
    rng = np.random.default_rng([seed, *map(ord, solver + case.name)])
    loop, q = SOLVERS[solver](case, rng), np.array(case.robot.home)
    infeasible = blocked = 0
    took, kept = 0.0, []
    for index in range(steps):
        if index % GOAL == 0:
            loop.aim()
            dt = DTS[int(rng.integers(len(DTS)))]
        start = time.process_time()
        found = loop.step(q, dt)
        took += time.process_time() - start
        infeasible += found.d is None
        blocked += found.blocked
        d = np.zeros_like(q) if found.d is None else found.d
        kept += [q + 0.5 * d, q + d]
        q = kept[-1]
    Q = np.array(kept)
    smallest = float(case.robot.boundaries.smallest(Q).clearance.min())
    return {
        "robot": case.name,
        "solver": solver,
        "seed": seed,
        "steps": steps,
        "penetrations": penetrations(case, Q),
        "infeasible": infeasible,
        "blocked": blocked,
        "smallest [mm]": round(1e3 * smallest, 6),
        "way [rad]": round(float(np.abs(np.diff(Q[1::2], axis=0)).max(axis=1).sum()), 1),
        "CPU a step [ms]": round(1e3 * took / steps, 3),
    }


def seconds(call: Callable[[Any], Any], way: list[Any]) -> float:
    """Return the median time of a call along a way of configurations."""
    took: list[float] = []
    for q in way:
        start = time.process_time()
        call(q)
        took.append(time.process_time() - start)
    return float(np.median(took))


def cost(case: Case) -> dict[str, float]:
    """Return microseconds a step: our rows by dt, and Pink's distances and rows on the same pairs of bodies."""
    import pink

    robot, rng = case.robot, np.random.default_rng(1)
    steps = np.cumsum(rng.uniform(-1e-3, 1e-3, (200, len(robot.home))), axis=0)
    way = [robot.to_pinocchio(case.model, robot.home + step) for step in steps]
    mine: dict[str, float] = {}
    for dt in (1e-3, 1e-2, 0.05, 0.2):
        rows = SafeSteps(robot, robot.on(case.model), SPEED)
        found = seconds(lambda q, rows=rows, dt=dt: rows.half_spaces(q, dt), way)
        mine[f"rows at {1e3 * dt:g} ms [us]"] = 1e6 * found
    if case.geometry is None:
        return mine
    plain = pink.Configuration(case.model, case.model.createData(), way[0])
    both = pink.Configuration(case.model, case.model.createData(), way[0], collision_model=case.geometry)
    count = len(case.geometry.collisionPairs)
    barrier = pink.barriers.SelfCollisionBarrier(count, safe_displacement_gain=0.0, d_min=0.0)

    def theirs(q: Any) -> None:
        both.update(q)
        barrier.compute_jacobian(both)
        barrier.compute_barrier(both)

    other = 1e6 * (seconds(theirs, way[:20]) - seconds(plain.update, way))
    return mine | {"Pink's barrier [us]": other, "smallest ratio": other / max(mine.values())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=SLICE)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=CASES, help="name of one robot")
    parser.add_argument("--solver", choices=SOLVERS, default="pink")
    parser.add_argument("--cost", action="store_true", help="measure what rows cost, instead")
    options = parser.parse_args()
    for name, make in CASES.items():
        if options.only not in (None, name):
            continue
        case = make()
        pairs = 0 if case.geometry is None else len(case.geometry.collisionPairs)
        print(f"# {case.name}: {len(case.robot.boundaries)} boundaries, {pairs} pairs of bodies", flush=True)
        if options.cost:
            print(json.dumps({key: round(value, 1) for key, value in cost(case).items()}), flush=True)
            continue
        for number in range(-(-options.steps // SLICE)):
            count = min(SLICE, options.steps - number * SLICE)
            print(json.dumps(drive(case, options.solver, count, options.seed + number)), flush=True)


if __name__ == "__main__":
    main()
