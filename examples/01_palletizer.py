"""A palletizer from nothing: its file, its feasible region, and a certified motion: `python examples/01_palletizer.py`.

Prints:
    wrote my_palletizer.urdf.xacro
    J1, J2, J3, J4; 3 parallelograms, proven to close
    J2 and J3: 7 corners; edges: J2 lower, J2 upper, J3 lower, J3 upper, coupling lower, coupling upper, flange_floor
    pick, lift, turn, place: CERTIFIED, at least 563 mm from flange_floor
    reach down at the pick: VIOLATED by flange_floor
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import pinbound as pb

with tempfile.TemporaryDirectory() as name:
    # the file is a commented start: edit its lengths, widths and ranges
    subprocess.run(
        [sys.executable, "-m", "pinbound", "new", "palletizer", "--out", name], check=True, stdout=subprocess.DEVNULL
    )
    (path,) = Path(name).iterdir()
    print("wrote", path.name)
    robot = pb.load(path)
print(f"{', '.join(robot.coordinates)}; {len(robot.closures)} parallelograms, proven to close")

region = pb.feasible_region(robot, ("J2", "J3"))
edges = sorted({edge.name for edge in region.edges})
print(f"J2 and J3: {len(region.vertices)} corners; edges: {', '.join(edges)}")

down, up = np.radians([0.0, 45.0, 60.0, 0.0]), np.radians([0.0, 20.0, 10.0, 0.0])
turn = np.radians([90.0, 0.0, 0.0, 90.0])
motion = pb.certify(robot, [down, up, up + turn, down + turn])
least = motion.tightest
print(f"pick, lift, turn, place: {motion.verdict.name}, at least {1e3 * motion.lower:.0f} mm from {least.name}")
deep = pb.certify(robot, [down, np.radians([0.0, 80.0, 90.0, 0.0])])
print(f"reach down at the pick: {deep.verdict.name} by {deep.tightest.name}")
