"""Optimal control with constraints of pinbound, solved by IPOPT and certified: `python examples/04_casadi.py`.

Needs casadi (extra `bridges`). Prints:
    straight: VIOLATED
    IPOPT: Solve_Succeeded
    optimised: CERTIFIED, 1.4 times as long
"""

import casadi
import numpy as np

import pinbound as pb

URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="3"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2.6" upper="2.6" effort="1" velocity="3"/></joint></robot>"""

marks = [
    pb.Segment("post", "base", (0.4, 0.623, -0.2), (0.4, 0.623, 0.2), 0.03),
    pb.Segment("fore", "fore", (0.0, 0.0, 0.0), (0.35, 0.0, 0.0), 0.03),
]
robot = pb.load(URDF, annotations=pb.Annotations.of(marks, [pb.BoundaryMark("fore_post", "fore", "post")]))
start, goal, knots = np.array([0.0, 0.0]), np.array([2.0, 0.0]), 81
print("straight:", pb.certify(robot, np.stack((start, goal))).verdict.name)

h = robot.boundaries.to_casadi("h")
problem = casadi.Opti()
q = problem.variable(2, knots)
problem.minimize(casadi.sumsqr(q[:, 1:] - q[:, :-1]))
problem.subject_to(casadi.vec(q[:, 1:] - q[:, :-1]) <= 0.06)  # or the way would jump over the post between two knots
problem.subject_to(casadi.vec(q[:, 1:] - q[:, :-1]) >= -0.06)
problem.subject_to(q[:, 0] == start)
problem.subject_to(q[:, -1] == goal)
for k in range(1, knots - 1):
    problem.subject_to(h(q[:, k]) >= 0.015)  # the way between two knots may come nearer
line = start[:, None] + (goal - start)[:, None] * np.linspace(0, 1, knots)
problem.set_initial(q, line + np.array([[0.0], [-1.4]]) * np.sin(np.pi * np.linspace(0, 1, knots)))
problem.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
found = problem.solve()
print("IPOPT:", found.stats()["return_status"])

way = found.value(q).T
certificate = pb.certify(robot, way)
length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum() / np.linalg.norm(goal - start)
print(f"optimised: {certificate.verdict.name}, {length:.1f} times as long")
