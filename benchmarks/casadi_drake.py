"""CasADi and Drake, peers that are measured where they are installed. Each is checked before it is timed."""

from __future__ import annotations

import importlib.util
import logging
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.peers import Call, compiler

NEAR = 1e-12
"""How closely a peer's norms agree [m]."""

SMALL = 1e-6
"""Radius of a marked point's sphere [m], where only the distance counts."""


def has(name: str) -> bool:
    return importlib.util.find_spec(name) is not None


def casadi_norms(robot: Any, Q: Any) -> dict[str, Call]:
    """All norms as one CasADi function, mapped over the rows: in its virtual machine, and as its generated C."""
    import casadi
    import sympy

    q, norms = casadi.SX.sym("q", len(robot.coordinates)), []
    for boundary in robot.boundaries:
        r = boundary.expression()
        symbols = sorted(r.free_symbols, key=str)
        columns = [robot.coordinates.index(str(symbol)) for symbol in symbols]
        components = sympy.lambdify(symbols, list(r), modules=[casadi])(*[q[j] for j in columns])
        norms.append(casadi.norm_2(casadi.vertcat(*components)))
    one = casadi.Function("norms", [q], [casadi.cse(casadi.vertcat(*norms))])
    many = one.map("mapped_norms", "serial", len(Q), [], [])
    functions = {"generated C": _generated(many), "virtual machine": many}
    return {name: _buffered(function, robot, Q) for name, function in functions.items() if function}


def _generated(function: Any) -> Any:
    """Return a CasADi function as its generated C, where a compiler is found."""
    import casadi

    found = compiler()
    if found is None:
        return None
    folder = Path(tempfile.mkdtemp())
    source, library = folder / "generated.c", folder / "generated.so"
    generator = casadi.CodeGenerator(source.name)
    generator.add(function)
    source.write_text(generator.dump())
    flags = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"]
    subprocess.run([found, *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
    return casadi.external(function.name(), str(library))


def _buffered(function: Any, robot: Any, Q: Any) -> Call:
    """Call a CasADi function on NumPy's own memory, without a copy."""
    out = np.empty((len(Q), len(robot.boundaries)))
    buffer, trigger = function.buffer()
    buffer.set_arg(0, memoryview(Q))
    buffer.set_res(0, memoryview(out))
    trigger()
    if not np.allclose(out, robot.boundaries.norms(Q, backend="numpy"), rtol=0.0, atol=NEAR):
        raise RuntimeError(f"{function} computes something else")
    return lambda: (trigger(), buffer, function, Q, out)


def drake_distances(robot: Any, Q: Any) -> Call:
    """Drake's signed distances of the same pairs, of spheres as small as the other peers'."""
    theta = robot.coupling.expand(Q)
    diagram, pairs = _diagram(robot, SMALL)
    place, query = _posed(diagram)

    def run() -> Any:
        out = np.empty((len(theta), len(pairs)))
        for i, q in enumerate(theta):
            place(q)
            found = query()
            out[i] = [found.ComputeSignedDistancePairClosestPoints(a, b).distance for a, b in pairs]
        return out

    _same(run(), robot.boundaries.norms(Q, backend="numpy") - 2.0 * SMALL)
    return run


def drake_checker(robot: Any, Q: Any) -> Call:
    """Drake's batch checker, on all pairs of spheres of two bodies of which pinbound has one: it filters no finer."""
    from pydrake.common import Parallelism
    from pydrake.planning import SceneGraphCollisionChecker

    diagram, _ = _diagram(robot, SMALL)
    plant, model = diagram.plant(), robot.model
    bodies = [plant.world_body(), *(plant.GetBodyByName(name) for name in list(model.names)[1:])]
    checker = SceneGraphCollisionChecker(
        model=diagram, robot_model_instances=[bodies[1].model_instance()], edge_step_size=1.0
    )
    links = [(b.point_a.link, b.point_b.link) for b in robot.boundaries]
    wanted = {frozenset(model.frames[model.getFrameId(link)].parentJoint for link in pair) for pair in links}
    for i, body in enumerate(bodies[1:], 1):  # the world is not the robot's: its filters are fixed
        for j in range(1, i):
            checker.SetCollisionFilteredBetween(body, bodies[j], frozenset((i, j)) not in wanted)
    rows, serial = list(robot.coupling.expand(Q)), Parallelism(False)
    _same(checker.CheckConfigsCollisionFree(rows, serial), robot.boundaries.norms(Q).min(axis=1) > 2.0 * SMALL)
    return lambda: checker.CheckConfigsCollisionFree(rows, serial)


def drake_collisions(robot: Any, Q: Any) -> Call:
    """Drake's yes or no with the robot's own radii, on exactly the same pairs of spheres."""
    from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

    theta = robot.coupling.expand(Q)
    diagram, pairs = _diagram(robot, None)
    filters = diagram.scene_graph().collision_filter_manager()
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(list({g for pair in pairs for g in pair}))))
    for a, b in pairs:
        filters.Apply(CollisionFilterDeclaration().AllowBetween(GeometrySet(a), GeometrySet(b)))
    place, query = _posed(diagram)

    def run() -> Any:
        out = np.empty(len(theta), dtype=bool)
        for i, q in enumerate(theta):
            place(q)
            out[i] = query().HasCollisions()
        return out

    _same(run(), ~robot.boundaries.free(Q))
    return run


def _same(found: Any, expected: Any) -> None:
    if not np.allclose(found, expected, rtol=0.0, atol=NEAR):
        raise RuntimeError("Drake computes something else")


def _posed(diagram: Any) -> tuple[Any, Any]:
    """Return how to set the joints of one context, and how to ask it."""
    context = diagram.CreateDefaultContext()
    plant, scene = diagram.plant(), diagram.scene_graph()
    state, at = plant.GetMyContextFromRoot(context), scene.GetMyContextFromRoot(context)
    port = scene.get_query_output_port()
    return lambda q: plant.SetPositions(state, q), lambda: (port.Eval(at), context, diagram)[0]


def _diagram(robot: Any, radius: float | None) -> tuple[Any, list[Any]]:
    """Build the robot's joints, and its marked points as spheres; return also the pairs of spheres."""
    from pydrake.geometry import Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import CoulombFriction
    from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia
    from pydrake.planning import RobotDiagramBuilder

    logging.getLogger("drake").setLevel(logging.WARNING)
    model = robot.model
    builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    bodies = [plant.world_body()]
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        line = np.asarray(data.S).ravel()
        body = plant.AddRigidBody(name, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        place = RigidTransform(model.jointPlacements[index].homogeneous)
        frame = plant.AddFrame(FixedOffsetFrame(f"{name}_place", bodies[model.parents[index]].body_frame(), place))
        kind, axis = (RevoluteJoint, line[3:]) if np.any(line[3:]) else (PrismaticJoint, line[:3])
        plant.AddJoint(kind(name, frame, body.body_frame(), axis))
        bodies.append(body)
    spheres = {}
    for point in {p.name: p for b in robot.boundaries for p in (b.point_a, b.point_b)}.values():
        frame = model.frames[model.getFrameId(point.link)]
        place = RigidTransform((frame.placement * pin.SE3(np.eye(3), np.array(point.xyz))).homogeneous)
        shape = Sphere(point.radius if radius is None else radius)
        body = bodies[frame.parentJoint]
        spheres[point.name] = plant.RegisterCollisionGeometry(body, place, shape, point.name, CoulombFriction())
    plant.Finalize()
    return builder.Build(), [(spheres[b.point_a.name], spheres[b.point_b.name]) for b in robot.boundaries]
