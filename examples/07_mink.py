"""mink and a MuJoCo model of the same robot: `python examples/07_mink.py`.

Needs mink, mujoco and qpsolvers with quadprog (extra `bridges`). Prints:
    free at every one of 80 steps of 0.1 s
    fore_floor stops it
"""

import mink
import mujoco
import numpy as np

import pinbound as pb
from pinbound.adapters.mink import StepLimit

INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco>
<link name="base">{INERTIA}</link><link name="upper">{INERTIA}</link><link name="fore">{INERTIA}</link>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="3"/></joint></robot>"""

marks = [
    pb.Plane("floor", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    pb.Segment("fore", "fore", (0.0, 0.0, 0.0), (0.35, 0.0, 0.0), 0.03),
]
robot = pb.load(URDF, annotations=pb.Annotations.of(marks, [pb.BoundaryMark("fore_floor", "fore", "floor")]))
model = mujoco.MjModel.from_xml_string(URDF)
limit = StepLimit(robot, model, velocity={"j1": 2.0, "j2": 2.0})
configuration = mink.Configuration(model)
task = mink.FrameTask("fore", "body", position_cost=1.0, orientation_cost=0.0, gain=0.5)
task.set_target(mink.SE3.from_translation(np.array([0.3, 0.0, -0.5])))  # below the floor

free = True
for _ in range(80):
    v = mink.solve_ik(configuration, [task], 0.1, "quadprog", damping=1e-6, limits=[limit])
    configuration.integrate_inplace(v, 0.1)
    free &= limit.steps.view.free(configuration.q)
print(f"{'free' if free else 'in contact'} at every one of 80 steps of 0.1 s")
print(f"{', '.join(sorted(set(limit.steps.last.names)))} stops it")
