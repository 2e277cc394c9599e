"""Kinds, ancestors and helper links on trees made to tell them apart."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.path.chain import Chain
from pinbound.path.frames import _coordinates_between
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

TREE = [
    joint("q1", "revolute", "base", "a", axis="0 0 1"),
    joint("q2", "revolute", "a", "level", xyz="0 0 0.4"),
    joint("q3", "revolute", "level", "b"),
    joint("q4", "revolute", "b", "c", xyz="0.3 0 0"),
    joint("q5", "revolute", "a", "d", xyz="0 0 0.4"),
    joint("q6", "revolute", "a", "e", xyz="0 0.1 0.4"),
    joint("mount", "fixed", "a", "f", xyz="0 0 0.4"),
]
BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
SPOTS = {name: (name, f"0.{index + 1} 0 0.05") for index, name in enumerate("abcdef")} | {"base": ("base", "0.9 0 0")}


@pytest.mark.parametrize(
    ("a", "b", "kind", "ancestor"),
    [
        ("a", "b", pb.Kind.CONSECUTIVE, "a"),
        ("b", "a", pb.Kind.CONSECUTIVE, "a"),
        ("base", "a", pb.Kind.CONSECUTIVE, "base"),
        ("base", "b", pb.Kind.NON_CONSECUTIVE, "base"),
        ("a", "c", pb.Kind.NON_CONSECUTIVE, "a"),
        ("b", "d", pb.Kind.COINCIDENT_BRANCHED, "a"),
        ("c", "d", pb.Kind.COINCIDENT_BRANCHED, "a"),
        ("b", "e", pb.Kind.BRANCHED, "a"),
        ("d", "f", pb.Kind.COINCIDENT_BRANCHED, "a"),
        ("e", "f", pb.Kind.BRANCHED, "a"),
    ],
)
def test_kind_and_ancestor(load_text: Load, a: str, b: str, kind: pb.Kind, ancestor: str) -> None:
    boundary = load_text(robot_xml(TREE, SPOTS, [(a, b)])).boundaries[0]
    assert (boundary.kind, boundary.ancestor) == (kind, ancestor)


def test_a_link_with_a_body_or_a_mark_is_no_helper(load_text: Load) -> None:
    text = robot_xml(TREE, SPOTS, [("a", "b")])
    assert load_text(text).tree.helpers == {"level"}
    heavy = load_text(text.replace('<link name="level"/>', f'<link name="level">{BODY}</link>'))
    assert heavy.tree.helpers == set()
    assert heavy.boundaries[0].kind is pb.Kind.NON_CONSECUTIVE
    marked = load_text(robot_xml(TREE, SPOTS | {"m": ("level", "0 0.2 0")}, [("a", "b")]))
    assert marked.tree.helpers == set()
    joined = '<parent link="level"/><child link="b"/><origin xyz="0 0 0'
    moved = load_text(text.replace(joined, joined + ".1"))
    assert moved.tree.helpers == set()


def test_an_elbow_of_two_joints_is_one_rotation(load_text: Load) -> None:
    boundary = load_text(robot_xml(TREE, SPOTS, [("a", "b")])).boundaries[0]
    assert boundary.path.minimal.rotations == 1
    assert boundary.contact is not None
    assert boundary.contact.text == "q2 + q3"


def test_a_point_on_the_joint_axis_takes_the_joint_out(load_text: Load) -> None:
    spots = {"p": ("base", "0 0 0.7"), "s": ("d", "0 0.3 0"), "t": ("a", "0.2 0 0.1")}
    robot = load_text(robot_xml(TREE, spots, [("p", "s"), ("p", "t")]))
    assert robot.boundaries["p_s"].coordinates == ()
    assert robot.boundaries["p_t"].coordinates == ()
    assert robot.boundaries["p_t"].norm([1.0] * 6) == pytest.approx((0.2**2 + 0.6**2) ** 0.5)


def between_by_walking(chain: Chain) -> np.ndarray:
    """Count coordinates between all positions one by one: turns about one axis add up, others begin anew."""
    k = chain.rotations
    counts = np.zeros((k + 1, k + 1), dtype=int)
    for start in range(k):
        runs = [[start, chain.coefficients[start]]]
        counts[start, start + 1] = np.count_nonzero(runs[-1][1])
        for position in range(start + 1, k):
            first, total = runs[-1]
            u, v = chain.axes[first], chain.axes[position]
            if np.linalg.norm(np.cross(u, v)) < 1e-12:
                runs[-1][1] = total + np.sign(u @ v) * chain.coefficients[position]
            else:
                runs.append([position, chain.coefficients[position]])
            counts[start, position + 1] = sum(np.count_nonzero(np.abs(total) > 1e-12) for _, total in runs)
    return counts + counts.T


@pytest.mark.parametrize("seed", range(12))
def test_coordinates_between_positions_are_counted_as_by_walking(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, n = int(rng.integers(0, 14)), 4
    units = np.vstack((np.eye(3), [[0.6, 0.0, 0.8]]))
    axes = units[rng.integers(0, 1 + seed % 4, k)] * rng.choice([-1.0, 1.0], (k, 1))
    chain = Chain(
        rng.normal(size=(k + 1, 3)), np.zeros((k + 1, 3, n)), axes, rng.integers(-1, 2, (k, n)).astype(float), 1.0
    )
    assert np.array_equal(_coordinates_between(chain), between_by_walking(chain))
