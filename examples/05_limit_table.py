"""A table of coupled limits for a controller without pinbound: `python examples/05_limit_table.py`.

Prints:
    89 entries of 0.903 deg, q2 from -9.524 to 69.981 deg
    at q2 = 20 deg, q3 may go from -8.462041 to 52.429119 deg
    at most 0.000 deg are lost; with entries at whole degrees 0.247 deg
"""

import numpy as np

import pinbound as pb

robot = pb.load("minervabot_v3")
table = pb.limit_table(robot, target="q2", dependent="q3")
angles, lower, upper = table.in_degrees()
spacing = np.diff(angles).mean()
print(f"{len(angles)} entries of {spacing:.3f} deg, q2 from {angles[0]:.3f} to {angles[-1]:.3f} deg")
low, high = (np.interp(20.0, angles, ends) for ends in (lower, upper))  # as a reader interpolates
print(f"at q2 = 20 deg, q3 may go from {low:.6f} to {high:.6f} deg")
whole = pb.limit_table(robot, "q2", "q3", grid="multiples")  # as jskeus and hrpsys hold
lost, more = np.degrees([table.loss, whole.loss])
print(f"at most {lost:.3f} deg are lost; with entries at whole degrees {more:.3f} deg")
text = table.text("skrobot")  # or csv, json; of whole.text jskeus, hrpsys: write it to a file
