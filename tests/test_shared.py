"""Points of all links as chains that share their beginnings are where absolute chains put them; load traces no path."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from mechanisms import mechanism, write
from pinbound.evaluate import numeric
from pinbound.kernel.balls import BallTree, _Builder
from pinbound.path.relative import absolute_chain
from pinbound.path.shared import link_spots, moved

# name, type, parent, child, xyz, rpy, axis, what follows
DEGENERATE = (
    ("q1", "revolute", "base", "a", "0 0 0.3", "0 0 0", "0 0 1", ""),
    ("back", "revolute", "a", "level", "0 0 0.2", "0 0 0", "0 0 1", '<mimic joint="q1" multiplier="-1"/>'),
    ("q2", "revolute", "level", "b", "0.1 0 0", "0 0.3 0", "0 1 0", ""),
    ("again", "revolute", "b", "c", "0 0.2 0", "0 0 0", "0 -1 0", '<mimic joint="q2" multiplier="0.5" offset="0.4"/>'),
    ("q3", "prismatic", "c", "d", "0 0 0.1", "0 0 0", "0.6 0 0.8", ""),
    ("out", "prismatic", "d", "e", "0 0 0", "0 0 0", "0 1 0", '<mimic joint="q3" multiplier="2" offset="0.05"/>'),
    ("q4", "revolute", "e", "f", "0 0.1 0", "0 0 0", "0 1 0", ""),
    ("fixed", "fixed", "f", "g", "0 0 0.1", "0.1 0.2 0.3", "1 0 0", ""),
    ("q5", "continuous", "g", "h", "0 0 0", "0 0 0", "0 0 1", '<mimic joint="q4" multiplier="0"/>'),
)


def degenerate() -> str:
    """Return turns that cancel, that add up, that slides lie between, a joint that stands still; points on axes."""
    text = ['<robot name="odd"><link name="base"/>']
    for name, kind, parent, child, xyz, rpy, axis, more in DEGENERATE:
        limit = "" if kind in ("continuous", "fixed") else '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
        text.append(
            f'<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
        )
    return "".join([*text, "</robot>"])


@pytest.mark.parametrize("case", range(9))
def test_spots_are_where_absolute_chains_are(case: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(case)
    urdf = degenerate() if case == 0 else mechanism(rng, ("planar", "spatial")[case % 2], 3 + case % 3, case % 4 == 1)
    robot = pb.load(write(tmp_path, urdf))
    links = [link for link in robot.tree.links for _ in range(3)]
    points = [
        np.zeros(3) if i % 3 == 0 else [0.0, 0.0, 0.2] if i % 3 == 1 else rng.normal(size=3) for i in range(len(links))
    ]
    spots = link_spots(robot.tree, robot.coupling, links)
    builder = _Builder(BallTree(len(robot.coordinates)))
    for link, xyz in zip(links, points, strict=True):
        builder.tree.balls.append(builder.ball(moved(spots[link], np.array(xyz))))
    Q = rng.uniform(-3.0, 3.0, (20, len(robot.coordinates)))
    found = builder.tree.places(Q)
    for place, link, xyz in zip(found, links, points, strict=True):
        wanted = numeric.positions(absolute_chain(robot.tree, robot.coupling, link, xyz), Q)
        assert np.abs(place.T - wanted).max() < 1e-13 * 30.0  # of paths of some metres, slides of 3 units twice


def test_turns_about_one_axis_at_one_place_are_one_step(tmp_path: Path) -> None:
    robot = pb.load(write(tmp_path, degenerate()))
    spots = link_spots(robot.tree, robot.coupling, robot.tree.links)
    assert spots["level"].step is None  # q1 - q1: nothing turns it
    c = spots["c"].step
    assert c is not None
    assert c.above is None
    assert c.terms == ((1, 0.5),)  # q2 about y, less half of it
    on_axis = moved(spots["b"], np.array([0.0, 0.7, 0.0]))
    assert on_axis.step is None
    assert spots["h"].step is spots["f"].step  # a joint times zero turns nothing


def chain(links: int) -> tuple[str, str]:
    """Return a chain of links and a sidecar that marks pairs of it, far apart at home."""
    text, marks, pairs = ['<robot name="long"><link name="l0"/>'], ["points:"], ["boundaries:"]
    for i in range(links):
        text.append(
            f'<link name="l{i + 1}"/><joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="0.1 0 0.02"/><axis xyz="{("1 0 0", "0 1 0", "0 0 1")[i % 3]}"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    for i in range(links + 1):
        marks.append(f"- {{name: p{i}, link: l{i}, xyz: [0.0, 0.01, 0.0], radius: 0.01}}")
        if i > 1:
            pairs.append(f"- {{name: b{i}, a: p0, b: p{i}}}")
    return "".join([*text, "</robot>"]), "\n".join([*marks, *pairs]) + "\n"


def test_load_and_tables_trace_no_path_between_two_points(tmp_path: Path) -> None:
    robot = pb.load(write(tmp_path, *chain(80)))
    B = robot.boundaries
    q = np.random.default_rng(0).uniform(-0.3, 0.3, 80)
    found = B.signed_clearances(q)
    assert not any("difference" in b.path.__dict__ for b in B)
    some = [b.signed_clearance(q) for b in list(B)[::13]]
    assert np.allclose(found[::13], some, rtol=0.0, atol=1e-12)
    assert "difference" in B[0].path.__dict__


def test_points_in_contact_at_home_are_found_without_their_path(tmp_path: Path) -> None:
    urdf, marks = chain(6)
    near = marks.replace("name: p6, link: l6, xyz: [0.0, 0.01, 0.0]", "name: p6, link: l6, xyz: [-0.6, 0.01, -0.12]")
    with pytest.raises(pb.InputError, match=r"'b6' has a distance of .* above its threshold of 20 mm"):
        pb.load(write(tmp_path, urdf, near))
    just = marks.replace("name: p6, link: l6, xyz: [0.0, 0.01, 0.0]", "name: p6, link: l6, xyz: [-0.581, 0.01, -0.12]")
    with pytest.raises(pb.InputError, match="a distance of 19 mm, which is not above"):
        pb.load(write(tmp_path, urdf, just, "just"))
