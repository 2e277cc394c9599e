"""Balls about links: no configuration brings marks nearer than `least_gaps` says, and none could say more of a line."""

import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from pinbound.annotations import Mark, Point, Segment
from pinbound.marking import propose_marks
from pinbound.marking.broad import least_gaps
from pinbound.robot.robot import Robot
from robots import joint, robot_xml

Load = Callable[[str], Robot]


def random_tree(rng: np.random.Generator, links: int) -> str:
    """Return a robot whose links hang on each other at random, by joints of all kinds."""
    names, joints, mimicked = ["base"], list[str](), "j0"
    for i in range(links):
        kind = ("revolute", "continuous", "revolute", "fixed", "prismatic")[rng.integers(0, 5) if i else 0]
        xyz, rpy, axis = (" ".join(map(str, rng.normal(scale=s, size=3))) for s in (0.6, 1.0, 1.0))
        more = {"mimic": f"{mimicked} -1 0.3"} if kind == "revolute" and i > 5 and i % 3 == 0 else {}
        if kind == "revolute" and not more:
            mimicked = f"j{i}"
        joints.append(
            joint(f"j{i}", kind, names[rng.integers(0, len(names))], f"l{i}", xyz=xyz, rpy=rpy, axis=axis, **more)
        )
        names.append(f"l{i}")
    return robot_xml(joints, {}, [])


def gaps_seen(robot: pb.Robot, marks: dict[str, list[Mark]], Q: np.ndarray) -> np.ndarray:
    """Return the least gap of the marks' end points, by Pinocchio's placements (k, k)."""
    model = robot.model
    data, least = model.createData(), np.full((len(marks), len(marks)), np.inf)
    ends = {link: [(v, m.shape.radius) for m in own for v in m.shape.vertices] for link, own in marks.items()}
    radii = np.array([r for own in ends.values() for _, r in own])
    start = np.cumsum([0, *(len(own) for own in ends.values())])[:-1]
    for theta in robot.coupling.expand(Q):
        pin.framesForwardKinematics(model, data, theta)
        placed = {link: data.oMf[model.getFrameId(link)] for link in marks}
        points = np.array([placed[link] * v for link, own in ends.items() for v, _ in own])
        apart = np.linalg.norm(points[:, None] - points, axis=2) - radii[:, None] - radii
        least = np.minimum(least, np.minimum.reduceat(np.minimum.reduceat(apart, start, axis=0), start, axis=1))
    return least


@pytest.mark.parametrize("seed", range(4))
def test_no_configuration_brings_marks_nearer_than_their_links_gap(load_text: Load, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = load_text(random_tree(rng, 14))
    marks: dict[str, list[Mark]] = {}
    for link in robot.tree.links:
        xyz = [tuple(x) for x in rng.normal(scale=0.05, size=(3, 3)).tolist()]
        marks[link] = [Point("p", link, xyz[0], 0.03), Segment("s", link, xyz[1], xyz[2], 0.01)]
    bound = least_gaps(robot.tree, marks)
    Q = np.random.default_rng(seed).uniform(-7.0, 7.0, (200, len(robot.coordinates)))
    seen = gaps_seen(robot, marks, Q)
    assert np.array_equal(bound, bound.T)
    assert np.all(np.isinf(np.diag(bound)))
    assert np.all(bound <= seen)
    assert np.count_nonzero(bound > 0.0) > 10  # it does prove something


def test_the_gap_of_two_arms_that_can_point_at_each_other_is_exact(load_text: Load) -> None:
    reach = [0.3, 0.25, 0.2]
    joints = []
    for side, place in (("l", "-1 0 0"), ("r", "1 0 0")):
        above = "base"
        for i, step in enumerate((None, *reach)):
            xyz = place if step is None else f"{step if side == 'l' else -step} 0 0"
            joints.append(
                joint(f"{side}{i}", "revolute", above, f"{side}{i}_link", xyz=xyz, axis=("0 0 1", "0 1 0")[i % 2])
            )
            above = f"{side}{i}_link"
    robot = load_text(robot_xml(joints, {}, []))
    tips: dict[str, list[Mark]] = {
        f"{side}3_link": [Point(side, f"{side}3_link", (0.1 if side == "l" else -0.1, 0.0, 0.0), 0.02)] for side in "lr"
    }
    bound = least_gaps(robot.tree, tips)
    seen = gaps_seen(robot, tips, np.zeros((1, len(robot.coordinates))))
    assert bound[0, 1] <= seen[0, 1]
    assert bound[0, 1] == pytest.approx(2.0 - 2 * (sum(reach) + 0.1 + 0.02), abs=1e-9)
    assert bound[0, 1] == pytest.approx(seen[0, 1], abs=1e-9)


def test_nothing_is_proven_of_what_slides_or_is_free_or_stands_on_one_body(load_text: Load) -> None:
    joints = [
        joint("fixed", "fixed", "base", "a", xyz="50 0 0"),
        joint("slide", "prismatic", "base", "b", xyz="0 50 0", axis="1 0 0", limit="-0.1 0.1"),
        joint("free", "floating", "base", "c", xyz="0 0 50"),
        joint("turn", "revolute", "base", "d", xyz="0 0 -50"),
    ]
    robot = load_text(robot_xml(joints, {}, []))
    marks: dict[str, list[Mark]] = {link: [Point("p", link, (0.0, 0.0, 0.0), 0.1)] for link in ("base", *"abcd")}
    bound = least_gaps(robot.tree, marks)
    proven = np.argwhere(bound > 0.0).tolist()
    assert proven == [[0, 4], [1, 4], [4, 0], [4, 1]]  # d against base and a
    assert bound[0, 4] == pytest.approx(49.8, abs=1e-9)


def test_a_hall_of_arms_is_judged_by_pairs_of_links(load_text: Load) -> None:
    body = "<collision><geometry><sphere radius='0.1'/></geometry></collision>"
    joints = []
    for arm in range(5):
        above = "base"
        for i in range(3):
            xyz = f"{3 * arm} 0 0" if i == 0 else "0 0 0.4"
            joints.append(
                joint(f"q{arm}_{i}", "revolute", above, f"l{arm}_{i}", xyz=xyz, axis=("0 0 1", "0 1 0")[i % 2])
            )
            above = f"l{arm}_{i}"
    text = robot_xml(joints, {}, [])
    for arm in range(5):
        for i in range(3):
            text = text.replace(f'<link name="l{arm}_{i}"/>', f'<link name="l{arm}_{i}">{body}</link>')
    robot = load_text(text)
    found = propose_marks(robot)
    apart = {key: count for key, count in found.left_out.items() if key[2] == "can never meet"}
    far = {key for key in apart if key[0][1] != key[1][1]}
    assert len(far) == 9 * 10  # nine pairs of links for any two of five arms
    # arms stand 3 m apart, the last link's ball is 0.4 + 0.4 + 0.1 m from its place at most
    said = found.evidence["l0_2", "l1_2", "can never meet"]
    number = float(said.text.split("more than ")[1].split(" mm")[0])
    assert said.basis == "proof"
    assert 1199.99 <= number < 1200.0
    # evidence is made when it is asked for; it is as a dict of all of it, with the keys and the order of `left_out`
    whole = dict(found.evidence)
    assert list(whole) == list(found.left_out)
    assert found.evidence == whole == dict(propose_marks(robot).evidence)
    assert said is not found.evidence["l0_2", "l1_2", "can never meet"]
    with pytest.raises(KeyError):
        found.evidence["l0_2", "l1_2", "neighbours"]
    again = pickle.loads(pickle.dumps(found.evidence))
    assert again == whole
    assert hash(again) == hash(found.evidence)
