"""Certify a polytope of two coordinates by Drake's C-IRIS, beside `certified_polytope`: a planar arm and a post.

    python benchmarks/c_iris.py pinbound       # with pinbound: area, time
    python benchmarks/c_iris.py drake          # with Drake: bilinear alternation from a small box, Clarabel

The arm has two joints about one axis, spheres at its elbow and tip, and a post beside it. C-IRIS works in tan(q / 2);
the share of its set is of the box of q, by the same two million samples.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np

POST, ELBOW, TIP = ((0.5, 0.0, 0.3), 0.1), ((0.0, 0.0, 0.4), 0.05), ((0.0, 0.0, 0.35), 0.05)
LIMIT = 2.5


def xml(with_bodies: bool, more: str = "") -> str:
    """Return the arm's URDF."""

    def link(name: str, *spheres: Any) -> str:
        bodies = "".join(
            f'<collision name="{name}{k}"><origin xyz="{" ".join(map(str, xyz))}"/>'
            f'<geometry><sphere radius="{radius}"/></geometry></collision>'
            for k, (xyz, radius) in enumerate(spheres)
        )
        return f'<link name="{name}">{bodies if with_bodies else ""}</link>'

    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{up}"/><child link="{down}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="0 1 0"/><limit lower="{-LIMIT}" upper="{LIMIT}" effort="1" velocity="1"/></joint>'
        for name, up, down, xyz in (("q1", "base", "a", "0 0 0.1"), ("q2", "a", "b", "0 0 0.4"))
    )
    links = link("base", POST) + link("a", ELBOW) + link("b", TIP)
    return f'<robot name="arm" xmlns:pinbound="urn:pinbound:1">{links}{joints}{more}</robot>'


def samples() -> np.ndarray:
    """Return configurations of the box of limits."""
    return np.random.default_rng(0).uniform(-LIMIT, LIMIT, (2_000_000, 2))


def by_pinbound() -> None:
    """Print what certified_polytope and free_volume find."""
    import pinbound as pb

    marks = "".join(
        f'<pinbound:point name="{name}" link="{at}" xyz="{" ".join(map(str, xyz))}" radius="{radius}"/>'
        for name, at, (xyz, radius) in (("w", "base", POST), ("e", "a", ELBOW), ("t", "b", TIP))
    )
    pairs = '<pinbound:boundary name="we" a="w" b="e"/><pinbound:boundary name="wt" a="w" b="t"/>'
    robot = pb.load(xml(False, f"<pinbound:annotations>{marks}{pairs}</pinbound:annotations>"))
    Q = samples()
    print(f"{100 * np.mean(robot.boundaries.free(Q)):.2f} % of the box is free")
    pb.certified_polytope(robot, [-0.5, 0.0], budget=pb.Budget(10, 60.0))  # imports
    start = time.process_time()
    found = pb.certified_polytope(robot, [-0.5, 0.0], budget=pb.Budget(10**9, 60.0))
    used = time.process_time() - start
    print(f"certified_polytope: {found.verdict.value}, {100 * np.mean(found.contains(Q)):.2f} %, {used:.2f} s")
    start = time.process_time()
    volume = pb.free_volume(robot, ("q1", "q2"), decided=0.999)
    print(f"free_volume: {100 * volume.decided:.2f} % decided, {time.process_time() - start:.2f} s")


def by_drake() -> None:
    """Print what C-IRIS finds."""
    from pydrake.geometry.optimization import CspaceFreePolytope, SeparatingPlaneOrder
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.solvers import ClarabelSolver
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
    plant.set_adjacent_bodies_collision_filters(False)
    Parser(plant).AddModelsFromString(xml(True), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    diagram = builder.Build()
    start = time.process_time()
    search = CspaceFreePolytope(plant, scene, SeparatingPlaneOrder.kAffine, np.zeros(2))
    of = {name: plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))[0] for name in ("base", "a", "b")}
    ignored = {(min(of["a"], of["b"]), max(of["a"], of["b"]))}
    q, half = np.array([-0.5, 0.0]), 0.05
    C = np.vstack([np.eye(2), -np.eye(2), [[1, 1], [1, -1], [-1, 1], [-1, -1]]]) * 1.0
    C /= np.linalg.norm(C, axis=1)[:, None]
    d = C @ np.tan(q / 2) + half
    options = CspaceFreePolytope.BilinearAlternationOptions()
    options.max_iter = 100
    options.find_polytope_options.solver_id = ClarabelSolver.id()
    options.find_lagrangian_options.solver_id = ClarabelSolver.id()
    found = search.SearchWithBilinearAlternation(ignored, C, d, options)
    used, S = time.process_time() - start, np.tan(samples() / 2)
    for number in sorted({0, len(found) // 2, len(found) - 1}):
        one = found[number]
        share = np.mean(np.all(S @ one.C().T <= one.d(), axis=1))
        print(f"iteration {number} of {len(found)}: {100 * share:.2f} % of the box", flush=True)
    print(f"{used:.1f} s of processor; a diagram of {diagram.num_continuous_states()} states")


if __name__ == "__main__":
    chosen = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    chosen.add_argument("run", choices=["pinbound", "drake"])
    by_drake() if chosen.parse_args().run == "drake" else by_pinbound()
    sys.exit(0)
