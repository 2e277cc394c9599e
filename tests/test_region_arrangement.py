"""Places that cannot be resolved are told, with both readings; and a curve at the rim of the window is not lost."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.path.chain import Chain
from pinbound.region.arrangement import _BEYOND  # pyright: ignore[reportPrivateUsage]
from pinbound.region.contours import BUMP, ContactFunction, trace
from pinbound.region.outlines import _INSET  # pyright: ignore[reportPrivateUsage]
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]


def reacher(load_text: Load, post: float, radius: float, home: str = 'q1="2.4" q2="0.2"', more: str = "") -> pb.Robot:
    """Links of 1 and 0.5 m; the post is on the x axis. At q = 0 the tip is furthest out, at 1.5 m."""
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 0 1"),
        joint("q2", "revolute", "a", "b", axis="0 0 1", xyz="1 0 0"),
    ]
    text = f'<pinbound:home {home}/><pinbound:point name="t" link="b" xyz="0.5 0 0"/>'
    text += f'<pinbound:point name="o" link="base" xyz="{post} 0 0" radius="{radius!r}"/>'
    return load_text(robot_xml(joints, {}, [], text + '<pinbound:boundary name="beta" a="t" b="o"/>' + more))


def test_at_an_exact_saddle_both_readings_are_given(load_text: Load) -> None:
    """|r| has a saddle at q = 0, where it is exactly the threshold: two free parts meet in one point of contact."""
    robot = reacher(load_text, 0.75, 0.75)
    assert robot.boundaries.clearances([0.0, 0.0]) == [0.0]
    region = pb.feasible_region(robot)
    apart = pb.feasible_region(reacher(load_text, 0.75, 0.75 + 1e-9))
    joined = pb.feasible_region(reacher(load_text, 0.75, 0.75 - 1e-9))
    assert (len(region.components), len(apart.components), len(joined.components)) == (2, 2, 1)
    assert apart.unresolved == joined.unresolved == ()
    assert apart.joined_area == apart.area
    assert region.area == pytest.approx(apart.area, abs=1e-6)
    assert region.joined_area == pytest.approx(joined.area, abs=1e-6)
    assert region.joined_area == pytest.approx(sum(part.area for part in region.components))
    (place,) = region.unresolved
    assert (place.name, place.joins) == ("beta", True)
    assert np.abs(place.point).max() < 1e-6
    assert place.width < 1e-5
    assert not region.contains([0.0, 0.0])
    for part in region.components:
        assert part.unresolved == (place,)
        assert part.joined_area == pytest.approx(region.joined_area)
    assert region.contains([2.4, 0.2])
    assert region.components[1].contains([-2.4, -0.2])
    text = repr(region)
    assert "UNDECIDED" in text
    assert "beta at (q1 = " in text
    assert f"not joined, area {region.area:.6g} rad^2; joined, {region.joined_area:.6g}" in text


@pytest.mark.parametrize(("post", "radius"), [(1.25, 0.25), (1.0, 0.5)])
def test_a_start_far_from_a_saddle_is_not_refused(load_text: Load, post: float, radius: float) -> None:
    robot = reacher(load_text, post, radius)
    region = pb.feasible_region(robot)
    nearly = pb.feasible_region(reacher(load_text, post, radius + 1e-9))
    assert region.area == pytest.approx(nearly.area, abs=1e-5)
    assert any(np.abs(place.point).max() < 1e-6 for place in region.unresolved)
    assert region.contains(robot.home)


def test_a_region_away_from_the_saddle_says_nothing_of_it(load_text: Load) -> None:
    """Far from the start the same saddle, but a wall between: it is on no contour of the region."""
    wall = '<pinbound:point name="w" link="a" xyz="0.3 0 0" radius="0.02"/>'
    wall += '<pinbound:point name="v" link="base" xyz="-0.05 0.29 0" radius="0.02"/>'
    wall += '<pinbound:boundary name="wall" a="w" b="v"/>'
    region = pb.feasible_region(reacher(load_text, 0.75, 0.75, more=wall))
    assert "wall" in {edge.name for edge in region.edges}
    assert region.unresolved == ()
    assert region.joined_area == region.area
    assert any(part.unresolved for part in region.components)


def test_a_contact_that_only_touches_is_told(load_text: Load) -> None:
    """The post's rim is exactly where the outstretched tip passes: one point of contact, no area."""
    region = pb.feasible_region(reacher(load_text, 1.75, 0.25))
    assert region.area == pytest.approx(36.0, abs=1e-4)
    assert not region.contains([0.0, 0.0])
    assert all(place.name == "beta" for place in region.unresolved)
    assert any(abs(place.point[1]) < 1e-6 for place in region.unresolved)


def test_starts_nearer_to_contact_than_the_accuracy_get_a_finer_one(load_text: Load) -> None:
    robot = reacher(load_text, 1.2, 0.2)
    edge = max((e for e in pb.feasible_region(robot).edges if e.is_contact), key=lambda e: len(e.points))
    for index in (len(edge.points) // 3, len(edge.points) // 2):
        q = edge.points[index]
        slope = robot.boundaries["beta"].gradient(q)
        for gap in (1e-6, 1e-8):
            near = q + slope / (slope @ slope) * (gap - robot.boundaries["beta"].clearance(q))
            if robot.boundaries["beta"].clearance(near) <= 0.0:
                continue
            region = pb.feasible_region(robot, at=near, accuracy=1e-3)
            assert region.contains(near)


def test_a_bump_that_no_corner_sees_stays_in_the_rim() -> None:
    """The written proof: a bump is at most tan(20 deg) / 2 of a box's side; rim and frame lie on either side of it."""
    side = 1.0 + 2.0 * _BEYOND
    assert BUMP == pytest.approx(0.18199 / 16, rel=1e-4)
    assert BUMP * side < _INSET * side < _BEYOND


def test_a_curve_that_bulges_in_over_the_rim_is_within_the_bound() -> None:
    """Discs that enter the traced window between two corners: what is missed is never deeper than the bound."""
    rng = np.random.default_rng(0)
    window = np.array([[-1.0, -1.0], [1.0, 1.0]])
    missed = 0.0
    slides = np.zeros((1, 3, 2))
    slides[0, :2] = np.eye(2)
    for _ in range(150):
        radius = float(np.exp(rng.uniform(np.log(0.02), np.log(6.0))))
        depth = float(rng.uniform(0.0, 0.2)) * min(0.125, 0.125**2 / radius)
        offsets = np.zeros((1, 3))
        offsets[0, :2] = -np.array([1.0 + radius - depth, rng.uniform(-0.9, 0.9)])
        chain = Chain(offsets, slides, np.empty((0, 3)), np.empty((0, 2)), radius + 2.0)
        found = trace(ContactFunction.over(chain, radius, window), window, 1e-6)
        if found.lines:
            assert abs(1.0 - min(line[:, 0].min() for line in found.lines) - depth) <= 2.0 * BUMP
        else:
            missed = max(missed, depth)
    assert 0.0 < missed <= 2.0 * BUMP
