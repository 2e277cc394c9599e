"""That a path has several effective angles is proven without tracing it, and never of one that has fewer."""

import re
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from mechanisms import mechanism, write
from pinbound.path.relative import relative_path
from pinbound.path.several import has_several_angles

PLACES = ((0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.1, 0.2, 0.3))  # on axes of all kinds, on y alone, on none


@pytest.mark.parametrize("case", range(6))
def test_what_is_proven_to_turn_by_several_angles_does(case: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(case)
    sort = ("planar", "spatial")[case % 2]
    urdf = mechanism(rng, sort, 3 + case % 3, slides=case == 5, follower=case % 3 == 0)
    if case == 1:  # a wrist: all axes through one point
        urdf = re.sub('<origin xyz="[^"]*"', '<origin xyz="0 0 0"', urdf)
    robot = pb.load(write(tmp_path, urdf))
    marks = [pb.Point(f"{link}{i}", link, xyz) for link in robot.tree.links for i, xyz in enumerate(PLACES)]
    proven = 0
    for a in marks:
        for b in marks:
            if a.link != b.link and has_several_angles(robot.tree, robot.coupling, a, b):
                proven += 1
                assert relative_path(robot.tree, robot.coupling, a, b).minimal.rotations > 1
    assert proven == 0 if sort == "planar" else proven > 0
