"""A table of coupled limits for a controller without pinbound: `python examples/05_limit_table.py`.

Prints:
    81 entries, q2 from -10 to 70 deg
    at q2 = 20 deg, q3 may go from -8.462041 to 52.429119 deg
    1 deg: at most 0.247 deg are lost; 0.25 deg: 0.042
"""

import numpy as np

import pinbound as pb

robot = pb.load("minervabot_v3")
table = pb.limit_table(robot, target="q2", dependent="q3")
angles, lower, upper = table.in_degrees()
print(f"{len(angles)} entries, q2 from {angles[0]:g} to {angles[-1]:g} deg")
row = int(np.flatnonzero(angles == 20.0)[0])
print(f"at q2 = 20 deg, q3 may go from {lower[row]} to {upper[row]} deg")
fine = pb.limit_table(robot, "q2", "q3", spacing=0.25)
print(f"1 deg: at most {np.degrees(table.loss):.3f} deg are lost; 0.25 deg: {np.degrees(fine.loss):.3f}")
text = table.text("skrobot")  # or jskeus, hrpsys, csv, json: write it to a file
