"""How fast certificates are, what closeness costs, and the ratio to sampling with coal.

    python benchmarks/certify_speed.py --out docs/certificates-speed.md --plot docs/certificates-cost.svg

1. MinervaBotV3, ten boundaries and all joint limits, 1,000 random waypoints in the region: `certify`, and in the same
   run what a sampling checker does: steps of 1e-3 rad along the same motion, every sphere pair by coal, spheres placed
   by Pinocchio. Repetitions are interleaved, medians reported.
2. UR5, elbow sphere against hand sphere, one straight motion: boxes and time while the smallest clearance shrinks.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import tempfile
import time
from importlib.metadata import distribution
from pathlib import Path
from statistics import median

import coal
import numpy as np
import pinocchio

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet

STEP = 1e-3
REPEATS = 9
SAMPLED = 2000


def minerva_motion(robot: pb.Robot, count: int) -> np.ndarray:
    """Return waypoints well inside the region, each near the one before, as a recorded motion has them."""
    rng = np.random.default_rng(0)
    vertices = pb.feasible_region(robot).scale(0.95).vertices
    corners = rng.dirichlet(np.ones(len(vertices)), 30) @ vertices
    u = np.linspace(0, len(corners) - 1, count)
    plane = [np.interp(u, np.arange(len(corners)), column) for column in corners.T]
    return np.column_stack([np.interp(u, np.arange(30), rng.uniform(-2, 2, 30)), *plane])


def sampler(robot: pb.Robot):
    """Return a function that samples as a checker with coal would: smallest distance of all pairs at each q."""
    model, data = robot.model, robot.model.createData()
    geometry = pinocchio.GeometryModel()
    frames = {frame.name: index for index, frame in enumerate(model.frames)}
    ids = {}
    for point in robot.annotations.points.values():
        frame = model.frames[frames[point.link]]
        placement = frame.placement * pinocchio.SE3(np.eye(3), np.array(point.xyz))
        body = pinocchio.GeometryObject(point.name, frame.parentJoint, placement, coal.Sphere(1e-4))
        ids[point.name] = geometry.addGeometryObject(body)
    for b in robot.boundaries:
        geometry.addCollisionPair(pinocchio.CollisionPair(ids[b.point_a.name], ids[b.point_b.name]))
    results = pinocchio.GeometryData(geometry)

    def hits(Q: np.ndarray) -> bool:
        return any(
            pinocchio.computeCollisions(model, data, geometry, results, theta, True)
            for theta in robot.coupling.expand(Q)
        )

    return hits


def speed() -> list[str]:
    robot = pb.load("minervabot_v3")
    waypoints = minerva_motion(robot, 1000)
    lengths = np.abs(np.diff(waypoints, axis=0)).max(axis=1)
    steps = int(np.ceil(lengths / STEP).sum())
    u = np.linspace(0, 999, steps)
    fine = np.column_stack([np.interp(u, np.arange(1000), column) for column in waypoints.T])[:SAMPLED]
    hits = sampler(robot)
    found = pb.certify(robot, waypoints)
    assert found.verdict is pb.Verdict.CERTIFIED
    proof, sampling, batch = [], [], []
    for _ in range(REPEATS):
        for times, work in ((proof, lambda: pb.certify(robot, waypoints)), (sampling, lambda: hits(fine)),
                            (batch, lambda: robot.boundaries.norms(fine))):  # fmt: skip
            started = time.process_time()
            work()
            times.append(time.process_time() - started)
    proven, sampled, numpy = median(proof), median(sampling) * steps / len(fine), median(batch) * steps / len(fine)
    return [
        f"MinervaBotV3, 1,000 waypoints over {lengths.sum():.0f} rad, ten boundaries, {len(found.limits)} ends of "
        f"joint limits, medians of {REPEATS} interleaved repetitions, CPU time of one thread:",
        "",
        "| method | CPU time [ms] | ratio |",
        "| --- | ---: | ---: |",
        f"| `pb.certify`: proof, bounds of the smallest clearance, {found.boxes:,} boxes | {1e3 * proven:.1f} | 1 |",
        f"| coal at steps of 1e-3 rad, {steps:,} samples, yes or no, no proof | {1e3 * sampled:,.0f} | "
        f"{sampled / proven:,.0f} |",
        f"| `boundaries.norms` at the same samples, NumPy, no proof | {1e3 * numpy:,.0f} | {numpy / proven:,.0f} |",
    ]


def many_angles(folder: Path) -> list[str]:
    """Time the same number of waypoints and boundaries where nothing is in closed form: ten sphere pairs of a Panda."""
    share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    low = [f"- {{name: a{i}, link: panda_link{i}, xyz: [0, 0, 0.05], radius: 0.08}}" for i in range(1, 3)]
    high = [f"- {{name: b{i}, link: panda_link{i}, xyz: [0, 0.02, 0.03], radius: 0.07}}" for i in range(4, 9)]
    pairs = [f"- {{name: a{i}_b{j}, a: a{i}, b: b{j}}}" for i in range(1, 3) for j in range(4, 9)]
    sidecar = folder / "panda.yaml"
    sidecar.write_text("\n".join(["points:", *low, *high, "boundaries:", *pairs]) + "\n")
    robot = pb.load(share / "example-robot-data/robots/panda_description/urdf/panda.urdf", annotations=sidecar)
    rng = np.random.default_rng(1)
    start = np.clip(np.array([0, -0.3, 0, -1.6, 0, 1.6, 0.5, 0.01]), robot.lower, robot.upper)
    corners = start + rng.normal(0, 0.15, (30, 8)) * np.array([1, 1, 1, 1, 1, 1, 1, 0])
    u = np.linspace(0, 29, 1000)
    waypoints = np.column_stack([np.interp(u, np.arange(30), column) for column in corners.T])
    found, times = pb.certify(robot, waypoints), []
    for _ in range(REPEATS):
        started = time.process_time()
        pb.certify(robot, waypoints)
        times.append(time.process_time() - started)
    return [
        f"Panda, 1,000 waypoints, ten sphere pairs of {min(len(b.coordinates) for b in robot.boundaries)} to "
        f"{max(len(b.coordinates) for b in robot.boundaries)} coordinates, nothing in closed form: "
        f"{found.verdict.value}, {1e3 * median(times):.0f} ms of CPU time, {found.boxes:,} boxes.",
    ]


def ur5(folder: Path) -> pb.Robot:
    share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    sidecar = folder / "ur5.yaml"
    sidecar.write_text(
        "points:\n- {name: shoulder, link: upper_arm_link, xyz: [0, 0.12, 0.1], radius: 0.05}\n"
        "- {name: hand, link: wrist_3_link, xyz: [0, 0.08, 0], radius: 0.01}\n"
        "boundaries:\n- {name: hand_shoulder, a: shoulder, b: hand}\n"
    )
    return pb.load(share / "example-robot-data/robots/ur_description/urdf/ur5_robot.urdf", annotations=sidecar)


def closeness(folder: Path) -> tuple[list[str], list[tuple[float, int, float, str]]]:
    robot = ur5(folder)
    b = robot.boundaries[0]
    ends = np.array([[0.0, -1.0, 1.0, -0.5, 0.3, 0.0], [0.5, -0.6, 2.7, 1.2, -0.6, 0.4]])
    u = np.linspace(0, 1, 200_001)
    norms = b.norm(ends[0] + u[:, None] * (ends[1] - ends[0]))
    near = int(np.argmin(norms))
    fine = np.linspace(u[max(near - 1, 0)], u[min(near + 1, len(u) - 1)], 20_001)
    least = float(b.norm(ends[0] + fine[:, None] * (ends[1] - ends[0])).min())
    rows = []
    for exponent in np.arange(-1.5, -12.1, -0.5):
        for side in (1.0, -1.0):
            gap = side * 10.0**exponent
            size = least - gap - b.point_a.radius - b.point_b.radius
            changed = dataclasses.replace(b, min_distance=size)
            one = dataclasses.replace(robot, boundaries=BoundarySet([changed], robot.coordinates, robot.linear_limits))
            times = []
            for _ in range(3):
                started = time.process_time()
                found = pb.certify(one, ends, limits=False, precision=math.inf)
                times.append(time.process_time() - started)
            rows.append((gap, found.boxes, median(times), found.verdict.value))
    lines = [
        f"UR5, hand against upper arm, one straight motion that comes as near as {1e3 * least:.3f} mm (centres); the "
        "spheres grow until the gap is:",
        "",
        "| gap [m] | verdict | boxes | CPU time [ms] |",
        "| ---: | --- | ---: | ---: |",
        *(f"| {gap:.1e} | {verdict} | {boxes} | {1e3 * seconds:.1f} |" for gap, boxes, seconds, verdict in rows[::4]),
        *(f"| {gap:.1e} | {verdict} | {boxes} | {1e3 * seconds:.1f} |" for gap, boxes, seconds, verdict in rows[1::4]),
    ]
    return lines, rows


def draw(rows: list[tuple[float, int, float, str]], path: Path) -> None:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = figure.add_subplot()
    styles = (("certified", "o", "#0072B2"), ("violated", "s", "#D55E00"), ("undecided", "D", "#7F6000"))
    for verdict, marker, colour in styles:
        chosen = [(abs(gap), boxes) for gap, boxes, _, found in rows if found == verdict]
        if chosen:
            label = f"{verdict}, first contact bracketed to 1e-9" if verdict == "violated" else verdict
            axes.plot(*zip(*sorted(chosen), strict=True), marker=marker, color=colour, label=label, markersize=5)
    axes.set_xscale("log")
    axes.invert_xaxis()
    axes.set_ylim(bottom=0)
    axes.set_xlabel("|smallest clearance| [m], closer to the right")
    axes.set_ylabel("boxes bounded")
    axes.set_title("Cost of a certificate against closeness of contact (UR5, one motion)", loc="left", fontsize=10)
    axes.grid(True, color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    with mpl.rc_context({"svg.hashsalt": "pinbound"}):
        figure.savefig(path, **({"metadata": {"Date": None}} if path.suffix == ".svg" else {"dpi": 150}))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    lines = speed()
    folder = Path(tempfile.mkdtemp())
    table, rows = closeness(folder)
    text = "\n".join([*lines, "", *many_angles(folder), "", *table]) + "\n"
    sys.stdout.write(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    if options.plot:
        draw(rows, options.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
