"""Pink is sent through a post, and stops before it at every step size: `python examples/03_pink.py`.

Needs pin-pink and qpsolvers with quadprog (extra `bridges`). Prints:
    dt 0.001 s: free at every step, never infeasible
    dt 0.05 s: free at every step, never infeasible
    dt 0.2 s: free at every step, never infeasible
"""

import numpy as np
import pink
import pinocchio as pin

import pinbound as pb
from pinbound.adapters.pink import StepLimit

URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
<joint name="j1" type="continuous"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/>
<axis xyz="0 0 1"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2.6" upper="2.6" effort="1" velocity="3"/></joint></robot>"""

marks = [
    pb.Segment("post", "base", (0.45, 0.3, 0.0), (0.45, 0.3, 0.5), 0.05),
    pb.Segment("upper", "upper", (0.0, 0.0, 0.0), (0.4, 0.0, 0.0), 0.04),
    pb.Segment("fore", "fore", (0.0, 0.0, 0.0), (0.35, 0.0, 0.0), 0.03),
]
pairs = [pb.BoundaryMark("upper_post", "upper", "post"), pb.BoundaryMark("fore_post", "fore", "post")]
robot = pb.load(URDF, annotations=pb.Annotations.of(marks, pairs))
model = pin.buildModelFromXML(URDF)
limit = StepLimit(robot, model, velocity=3.0)
view = robot.on(model)

for dt in (0.001, 0.05, 0.2):
    configuration = pink.Configuration(model, model.createData(), robot.to_pinocchio(model, [0.0, 0.0]))
    task = pink.FrameTask("fore", position_cost=1.0, orientation_cost=0.0, gain=0.5)
    task.set_target(pin.SE3(np.eye(3), np.array([0.1, 0.39, 0.2])))  # the elbow has to pass the post
    free = feasible = True
    for _ in range(60):
        v = pink.solve_ik(configuration, [task], dt, "quadprog", damping=1e-6, limits=[limit], safety_break=False)
        configuration.update(pin.integrate(model, configuration.q, v * dt))
        free &= view.free(configuration.q)
        feasible &= not limit.steps.last.blocked
    said = "free at every step" if free else "in contact"
    print(f"dt {dt} s: {said}, {'never' if feasible else 'sometimes'} infeasible")
