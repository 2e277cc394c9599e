"""theta = S q + o: chains of followers, whatever the order of declaration and the kinds of joints."""

from collections.abc import Callable

import numpy as np

import pinbound as pb
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

CHAIN = [
    joint("z_last", "continuous", "b", "c", mimic="m_middle -2 0.5"),
    joint("m_middle", "prismatic", "a", "b", mimic="a_first 0.1 -0.2", limit="-0.3 0.1"),
    joint("a_first", "revolute", "base", "a", limit="-1 1"),
    joint("free", "revolute", "base", "d", limit="-1 1"),
    joint("float", "floating", "d", "e"),
]


def test_chains_are_flattened_and_noted_whatever_the_order(load_text: Load) -> None:
    for order in (CHAIN, CHAIN[::-1]):
        robot = load_text(robot_xml(order, {}, []))
        assert robot.coordinates == ("a_first", "free")
        assert robot.coupling.joints == ("a_first", "m_middle", "z_last", "free")
        assert robot.coupling.S.tolist() == [[1, 0], [0.1, 0], [-0.2, 0], [0, 1]]
        assert np.allclose(robot.coupling.offset, [0, -0.2, 0.9, 0], atol=1e-16)
        assert any("'z_last' follows 'm_middle', which is itself a mimic joint" in note for note in robot.notes)
        assert any("continuous joint 'z_last' follows prismatic" in note for note in robot.notes)
        assert any("floating joint 'float' is held at its origin" in note for note in robot.notes)


def test_a_followers_limit_is_a_limit_of_its_primary(load_text: Load) -> None:
    robot = load_text(robot_xml(CHAIN, {}, []))
    found = robot.boundaries.limits("a_first", [0.0, 0.0])
    assert np.allclose([found.lower, found.upper], [-1.0, 1.0])
    assert (found.lower_stop, found.upper_stop) == ("m_middle", "a_first")


def test_a_boundary_across_a_floating_joint_is_refused(load_text: Load) -> None:
    points = {"p": ("base", "1 0 0"), "s": ("e", "0 0 1")}
    try:
        load_text(robot_xml(CHAIN, points, [("p", "s")]))
    except pb.InputError as error:
        assert "'float' is floating and lies between" in str(error)
    else:
        raise AssertionError("a floating joint cannot be on a path")


def test_expand_of_one_and_of_many(minerva: pb.Robot) -> None:
    q = [0.1, 0.2, 0.3]
    assert np.array_equal(minerva.coupling.expand([q, q])[0], minerva.coupling.expand(q))
    assert dict(zip(minerva.coupling.joints, minerva.coupling.expand(q), strict=True))["q3_wrist"] == -0.3
