"""Certify a motion between its waypoints: `python examples/02_certify_a_motion.py`.

Prints:
    lift, move, lower: CERTIFIED, at least 5.8 mm free
    straight there: VIOLATED, beta_4 first at 54 % of the way
"""

import numpy as np

import pinbound as pb

robot = pb.load("minervabot_v3")
good = pb.certify(robot, np.radians([[0, 0, 0], [0, 30, 30], [40, 60, 20]]))
print(f"lift, move, lower: {good.verdict.name}, at least {np.floor(1e4 * good.lower) / 10:.1f} mm free")
bad = pb.certify(robot, np.radians([[0, 0, 0], [0, 0, 60]]))
share = bad.first_contact.after
print(f"straight there: {bad.verdict.name}, {bad.tightest.name} first at {100 * share:.0f} % of the way")
