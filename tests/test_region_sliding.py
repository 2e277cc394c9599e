"""Regions of robots that slide: segments, boxes and prisms over prismatic joints, against a flood fill on a grid."""

from collections.abc import Callable

import numpy as np
import pytest
import shapely
from scipy import ndimage

import pinbound as pb
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

SLIDES = [
    joint("s1", "prismatic", "base", "a", axis="1 0 0", limit="-1 1"),
    joint("s2", "prismatic", "a", "b", axis="0 1 0", limit="-0.8 0.9"),
]
SKEW_SLIDES = [
    joint("s1", "prismatic", "base", "a", axis="1 0 0", limit="-1 1"),
    joint("s2", "prismatic", "a", "b", axis="0.6 0.8 0", rpy="0.3 0 0.2", limit="-1 1"),
]
GANTRY = [
    joint("s2", "prismatic", "base", "a", axis="0 0 1", limit="-0.5 0.5"),
    joint("s1", "prismatic", "a", "b", axis="1 0 0", limit="-1 1"),
]
TURN_AND_SLIDE = [
    joint("q", "revolute", "base", "a", axis="0 0 1", limit="-3 3"),
    joint("s", "prismatic", "a", "b", axis="1 0 0", limit="0 0.8"),
]
HELD_TURN = [
    joint("q", "revolute", "base", "a0", axis="0.36 0.48 0.8", limit="-3 3"),
    *(text.replace('link="base"', 'link="a0"') for text in SLIDES),
]

MARKS = {
    "point": '<pinbound:point name="{n}" link="{l}" xyz="{x}" radius="{r}"/>',
    "segment": '<pinbound:segment name="{n}" link="{l}" xyz_a="{x}" xyz_b="{y}" radius="{r}"/>',
    "box": '<pinbound:sweep name="{n}" link="{l}" xyz="{x}" ways="{w}" radius="{r}"/>',
}


def mark(sort: str, name: str, link: str, xyz: np.ndarray, way: np.ndarray, radius: float) -> str:
    """A mark near `xyz` that reaches about `way` far; a box is turned at random by its three edge vectors."""
    edges = np.linalg.qr(np.outer(way, way) + np.diag([1.0, 2.0, 3.0]))[0] * np.linalg.norm(way)
    numbers = {"x": xyz, "y": xyz + way, "w": edges.ravel()}
    text = {key: " ".join(f"{value:.6f}" for value in array) for key, array in numbers.items()}
    return MARKS[sort].format(n=name, l=link, r=f"{radius:.6f}", **text)


def flood(region: pb.Region, count: int = 241) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points of a grid over the limits (count^2, 2), which are free, and which a flood from the start has."""
    plane = region.slice
    low, high = plane.window
    axes = [low[i] + (high[i] - low[i]) * (np.arange(count) + 0.5) / count for i in (0, 1)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    robot, Q = plane.robot, plane.lift(X)
    free = np.all(robot.boundaries.norms(Q) > [b.contact_distance for b in robot.boundaries], axis=1)
    for limit in robot.linear_limits:
        theta = Q @ limit.coefficients + limit.offset
        free &= (limit.lower <= theta) & (theta <= limit.upper)
    labels, _ = ndimage.label(free.reshape(count, count))
    cell = np.clip(((plane.start - low) / (high - low) * count).astype(int), 0, count - 1)
    near = labels[max(cell[0] - 1, 0) : cell[0] + 2, max(cell[1] - 1, 0) : cell[1] + 2]
    return X, free, labels.ravel() == (labels[tuple(cell)] or near.max())


def check(region: pb.Region) -> None:
    """The region is what the flood reaches, but within its accuracy of an edge, or where the grid is too coarse."""
    for count in (101, 401, 1601):
        X, free, flooded = flood(region, count)
        inside = region.contains(X, order="region")
        assert not np.any(inside & ~free)
        differ = np.flatnonzero(inside != flooded)
        scaled = shapely.transform(region.polygon, lambda points: points / region.slice.scales)
        away = shapely.distance(shapely.points(X[differ] / region.slice.scales), scaled.boundary)
        share = region.accuracy / np.max(region.slice.scales)
        if np.all(away <= share):
            break
    else:
        pytest.fail(f"{int(np.sum(away > share))} of {len(X)} points disagree")
    cell = float(np.prod((region.slice.window[1] - region.slice.window[0]) / count))
    length = float(scaled.length * np.prod(region.slice.scales))
    assert abs(flooded.sum() * cell - region.area) <= length * 2.0 / count + region.area_error


def on_contact(region: pb.Region) -> None:
    """Contact edges lie where the separation is the contact distance, by the exact function.

    Where pieces of one boundary meet, the place is that of their chords.
    """
    robot = region.slice.robot
    for edge in region.edges:
        if edge.is_contact:
            boundary = robot.boundaries[edge.name]
            off = boundary.norm(region.slice.lift(edge.points)) - boundary.contact_distance
            assert np.abs(off).max() < 2e-5
            assert np.median(np.abs(off)) < 1e-9


KINDS = [("segment", "segment"), ("segment", "box"), ("box", "box"), ("point", "box"), ("point", "segment")]


@pytest.mark.parametrize("joints", [SLIDES, SKEW_SLIDES, GANTRY, HELD_TURN], ids=["xy", "skew", "gantry", "held"])
@pytest.mark.parametrize("kinds", KINDS, ids=["-".join(kinds) for kinds in KINDS])
def test_bodies_that_only_slide_against_each_other(load_text: Load, joints: list[str], kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng([len(joints), *map(len, kinds)])
    curved = 0
    for _ in range(3):
        spread = np.array([0.5, 0.05, 0.5]) if joints is GANTRY else np.array([0.5, 0.5, 0.05])
        place = rng.uniform(-1, 1, 3) * spread
        other = rng.uniform(-1, 1, 3) * spread + 0.4 * spread
        ways = rng.normal(size=(2, 3)) * 0.15
        text = mark(kinds[0], "p", "b", place, ways[0], 0.01) + mark(kinds[1], "o", "base", other, ways[1], 0.02)
        try:
            robot = load_text(robot_xml(joints, {}, [], text + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
        except pb.InputError:  # home is in contact
            continue
        region = pb.feasible_region(robot, ("s1", "s2"))
        check(region)
        on_contact(region)
        curved += any(edge.is_contact for edge in region.edges)
    assert curved >= 1


def test_two_segments_over_two_slides_by_hand(load_text: Load) -> None:
    """Two parallel bars of 0.2 and 0.1 m, radii 0.03 in all: contact is a stadium, 0.3 long and 0.06 wide."""
    text = '<pinbound:segment name="p" link="b" xyz_a="0 0 0" xyz_b="0.1 0 0"/>'
    text += '<pinbound:segment name="o" link="base" xyz_a="0.3 0.4 0" xyz_b="0.5 0.4 0" radius="0.03"/>'
    robot = load_text(robot_xml(SLIDES, {}, [], text + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
    region = pb.feasible_region(robot)
    assert len(region.loops) == 2
    hole = shapely.Polygon(np.concatenate([edge.points[:-1] for edge in region.loops[1]]))
    assert hole.area == pytest.approx(0.3 * 0.06 + np.pi * 0.03**2, abs=region.area_error)
    assert hole.bounds == pytest.approx((0.17, 0.37, 0.53, 0.43), abs=1e-5)
    assert region.area == pytest.approx(2.0 * 1.7 - hole.area, abs=1e-12)
    assert [corner.polished for corner in region.corners] == [True] * 4
    assert 1e-6 < region.accuracy <= 1e-5
    chords = np.concatenate([edge.points for edge in region.loops[1]])
    middles = 0.5 * (chords[1:] + chords[:-1])
    depth = 0.03 - robot.boundaries["p_o"].norm(middles)  # a chord of a convex set is inside it
    assert -1e-12 < depth.min()
    assert 1e-6 < depth.max() <= region.accuracy


def test_boxes_that_slide_face_to_face(load_text: Load) -> None:
    """A cube of 0.2 m that slides on another at exactly the threshold: contact is the whole square of their overlap."""
    box = '<pinbound:sweep name="{}" link="{}" xyz="{}" ways="0.2 0 0  0 0.2 0  0 0 0.2" radius="{}"/>'
    text = box.format("p", "b", "0 0 0.25", 0.0) + box.format("o", "base", "0.4 0.4 0", 0.05)
    region = pb.feasible_region(
        load_text(robot_xml(SLIDES, {}, [], text + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
    )
    hole = shapely.Polygon(np.concatenate([edge.points[:-1] for edge in region.loops[1]]))
    assert hole.bounds == pytest.approx((0.2, 0.2, 0.6, 0.6), abs=1e-5)
    assert hole.area == pytest.approx(0.16, abs=1e-5)
    assert not region.contains([0.4, 0.4])
    assert region.contains([0.19, 0.4])


def test_contact_that_leaves_the_window_on_two_sides_parts_the_plane(load_text: Load) -> None:
    text = '<pinbound:segment name="o" link="base" xyz_a="0.3 -3 0" xyz_b="0.3 3 0" radius="0.1"/>'
    text += '<pinbound:segment name="p" link="b" xyz_a="0 0 0" xyz_b="0 0.2 0"/>'
    robot = load_text(robot_xml(SLIDES, {}, [], text + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
    region = pb.feasible_region(robot)
    assert [len(part.loops) for part in region.components] == [1, 1]
    assert region.area == pytest.approx(1.2 * 1.7, abs=1e-9)
    assert region.components[1].area == pytest.approx(0.6 * 1.7, abs=1e-9)


@pytest.mark.parametrize(
    "kinds", [("segment", "point"), ("point", "segment"), ("point", "point"), ("segment", "segment")]
)
def test_a_hinge_and_a_slide(load_text: Load, kinds: tuple[str, str]) -> None:
    """Across the hinge's axis, where segments of both sides are traced."""
    rng = np.random.default_rng([7, *map(len, kinds)])
    curved = 0
    for _ in range(4):
        place, other = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.7, 0.7, 3)
        ways = rng.normal(size=(2, 3)) * 0.3
        for array in (place, other, *ways):
            array[2] = 0.0
        text = mark(kinds[0], "p", "b", place, ways[0], 0.01) + mark(kinds[1], "o", "base", other, ways[1], 0.02)
        try:
            robot = load_text(robot_xml(TURN_AND_SLIDE, {}, [], text + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
        except pb.InputError:
            continue
        region = pb.feasible_region(robot)
        check(region)
        on_contact(region)
        curved += any(edge.is_contact for edge in region.edges)
    assert curved >= 1


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-5])
def test_a_small_mechanism_has_the_region_of_a_large_one(load_text: Load, scale: float) -> None:
    """Lengths times a factor: slides scale, angles stay, and so do holes, edges and corners."""
    joints = [
        joint("q", "revolute", "base", "a", axis="0 0 1", limit="-3 3"),
        joint("s", "prismatic", "a", "b", axis="1 0 0", xyz=f"{scale} 0 0", limit=f"{-scale} {scale}"),
    ]
    text = '<pinbound:home q="-1" s="0"/><pinbound:point name="p" link="b" xyz="0 0 0"/>'
    text += f'<pinbound:point name="o" link="base" xyz="{scale} {0.6 * scale} 0" radius="{0.25 * scale}"/>'
    text += f'<pinbound:point name="u" link="base" xyz="{-scale} {0.2 * scale} 0" radius="{0.1 * scale}"/>'
    text += '<pinbound:boundary name="p_o" a="p" b="o"/><pinbound:boundary name="p_u" a="p" b="u"/>'
    xml = robot_xml(joints, {}, [], text).replace(
        "<pinbound:annotations>", f'<pinbound:annotations contact_tolerance="{1e-6 * scale}">'
    )
    region = pb.feasible_region(load_text(xml))
    assert len(region.loops) == 2  # o is an island, and u a bay
    assert region.area / scale == pytest.approx(11.8047, abs=2e-4)
    check(region)  # the flood's own area
    assert region.accuracy <= 1e-5
    inset = region.inset(0.05, weights={"q": 1.0, "s": 1.0 / scale})
    assert inset.area / scale == pytest.approx(
        region.area / scale - 0.05 * region.perimeter({"q": 1, "s": 1 / scale}), rel=0.01
    )


def test_a_small_window_of_a_large_mechanism_is_resolved_relative_to_itself(load_text: Load) -> None:
    """The tip passes a post of 10 um: a hole of 2e-5 rad in a window of 1e-3 rad."""
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 0 1"),
        joint("q2", "revolute", "a", "b", axis="0 0 1", xyz="1 0 0"),
    ]
    text = '<pinbound:home q1="0.0004" q2="0.0004"/><pinbound:point name="p" link="b" xyz="0 1 0"/>'
    text += (
        '<pinbound:point name="o" link="base" xyz="1 1 0" radius="1e-5"/><pinbound:boundary name="p_o" a="p" b="o"/>'
    )
    xml = robot_xml(joints, {}, [], text).replace(
        "<pinbound:annotations>", '<pinbound:annotations contact_tolerance="1e-9">'
    )
    region = pb.feasible_region(load_text(xml), window={"q1": (-5e-4, 5e-4), "q2": (-5e-4, 5e-4)})
    assert len(region.loops) == 2
    hole = shapely.Polygon(np.concatenate([edge.points[:-1] for edge in region.loops[1]]))
    assert hole.area == pytest.approx(
        np.pi * 1e-10, rel=1e-3
    )  # |det J| = 1: q1 moves the tip by (-1, 1), q2 by (-1, 0)
