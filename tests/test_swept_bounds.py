"""Proofs about hulls: bounds over pieces and boxes hold every sample, verdicts are right where the answer is known."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pinbound as pb
from pinbound.bounds import swept_bounds
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.swept_bounds import along_motion, over_box
from pinbound.certificates.constraints import families
from robots import ARM, HEAD, joint

Load = Callable[..., pb.Robot]

MARKS = """
hulls:
- {name: gem, link: base, vertices: [[0.3, 0.3, 0.2], [0.5, 0.3, 0.3], [0.4, 0.5, 0.2], [0.4, 0.4, 0.6]]}
- {name: wedge, link: d, vertices: [[0, 0, 0], [0.2, 0, 0], [0, 0.15, 0], [0, 0, 0.3], [0.1, 0.1, 0.25]], radius: 0.01}
- {name: sliver, link: b, vertices: [[0, 0.1, 0], [0.001, 0.1, 0.3], [0, 0.101, 0.1], [0, 0.3, 0.2]]}
- {name: tile, link: c, vertices: [[0.1, 0, 0], [0.1, 0.2, 0], [0.1, 0.2, 0.2], [0.1, 0, 0.2], [0.1, 0.3, 0.1]]}
- {name: far, link: d, vertices: [[9, 9, 9], [9.2, 9, 9], [9, 9.2, 9], [9, 9, 9.2]]}
boxes: [{name: crate, link: base, xyz: [-0.4, 0.2, 0.3], rpy: [0.3, 0.2, 0.1], size: [0.2, 0.3, 0.2]}]
cylinders: [{name: drum, link: b, xyz_a: [0, 0, 0.1], xyz_b: [0, 0.2, 0.3], radius: 0.05}]
segments: [{name: rod, link: d, xyz_a: [0, 0, 0], xyz_b: [0.1, 0.2, 0.3], radius: 0.01}]
points: [{name: tip, link: d, xyz: [0.1, 0, 0.3]}]
lines: [{name: pole, link: base, xyz: [0.6, 0.6, 0], direction: [0.1, 0, 1]}]
planes: [{name: floor, link: base, xyz: [0, 0, -0.2], normal: [0, 0, 1]}]
home: {j2: 0.3, j3: 0.2}
boundaries:
"""
PAIRS = [
    "gem wedge",
    "gem sliver",
    "gem tile",
    "gem rod",
    "gem tip",
    "gem far",
    "crate wedge",
    "crate drum",
    "drum wedge",
    "sliver wedge",
    "tile pole",
    "pole wedge",
    "wedge floor",
    "floor drum",
]
SLIDE = joint("x", "prismatic", "base", "a", axis="1 0 0", limit="-5 5")
TURN = joint("q", "revolute", "base", "a", axis="0 1 0", limit="-3.2 3.2")
CUBE = "[[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1], [-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1]]"


def urdf(*joints: str) -> str:
    return f'{HEAD}<link name="base"/>{"".join(joints)}</robot>'


@pytest.fixture
def arm(load_text: Load) -> pb.Robot:
    rows = "".join(f"- {{name: {'_'.join(p.split())}, a: {p.split()[0]}, b: {p.split()[1]}}}\n" for p in PAIRS)
    text = MARKS + rows
    return load_text(urdf(*ARM), text)


def test_bounds_over_boxes_hold_all_that_is_sampled(arm: pb.Robot) -> None:
    rng = np.random.default_rng(0)
    which = np.arange(len(arm.boundaries))
    tight: list[float] = []
    for size in (0.3, 0.03, 1e-3, 1e-5):
        for _ in range(6):
            low = rng.uniform(-2, 2, 4)
            family = families(arm, tuple(arm.boundaries), low, low + 2 * size)[-1]
            centre, half = np.tile(low + size, (len(which), 1)), np.full((len(which), 4), size)
            found = over_box(family.swept, which, centre, half, family.error)
            corners = low + size * (1 + np.sign(rng.uniform(-1, 1, (30, 4))))
            values = family.signed(np.vstack((rng.uniform(low, low + 2 * size, (30, 4)), corners))) + family.threshold
            assert np.all(found.lower <= values.min(axis=0) + 1e-15)
            assert np.all(found.upper >= values.max(axis=0) - 1e-15)
            tight += (
                ((values.min(axis=0) - found.lower) / size)[values.min(axis=0) > 0.1].tolist() if size < 0.1 else []
            )
    assert np.median(tight) < 0.3  # of the box's half width: second order, but for faces that are nearly parallel


def test_bounds_along_pieces_hold_all_that_is_sampled(arm: pb.Robot) -> None:
    rng = np.random.default_rng(1)
    which, zero = np.arange(len(arm.boundaries)), np.zeros(4)
    for size in (0.5, 0.05, 1e-3):
        for _ in range(5):
            middle, slope = rng.uniform(-2, 2, 4), size * rng.normal(size=4)
            family = families(arm, tuple(arm.boundaries), middle - np.abs(slope), middle + np.abs(slope))[-1]
            q, v = np.tile(middle, (len(which), 1)), np.tile(slope, (len(which), 1))
            piece = Expansion(
                q, zero, v, np.stack((q - v / 2, q + v / 2), axis=1), zero, v[:, None], zero, 0 * v[:, None], zero
            )
            found = along_motion(family.swept, which, piece, family.error)
            values = family.signed(middle + np.linspace(-0.5, 0.5, 41)[:, None] * slope) + family.threshold
            assert np.all(found.lower <= values.min(axis=0) + 1e-15)
            assert np.all(found.upper >= values.max(axis=0) - 1e-15)


def test_bounds_do_not_trust_the_search_for_the_nearest_vertices(
    arm: pb.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        swept_bounds, "nearest_in_tables", lambda w, *rest: (np.full((len(w), 6), 0.05), np.zeros(len(w)))
    )
    rng = np.random.default_rng(2)
    which = np.arange(len(arm.boundaries))
    for size in (0.1, 1e-3):
        low = rng.uniform(-1, 1, 4)
        family = families(arm, tuple(arm.boundaries), low, low + size)[-1]
        half = np.full((len(which), 4), size / 2)
        found = family.enclose_box(which, np.tile(low + size / 2, (len(which), 1)), half)
        assert np.all(found.lower <= family.signed(rng.uniform(low, low + size, (200, 4))).min(axis=0) + 1e-15)


@pytest.mark.parametrize("offset", [0.0, 4096.0])
def test_cubes_on_a_slide_are_certified_up_to_the_rounding_of_their_distance(load_text: Load, offset: float) -> None:
    """Their faces are x - 2 apart; the numbers of the offsets are exact."""
    moved = [[x + offset, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    marks = f"hulls: [{{name: A, link: base, vertices: {moved}}}, {{name: B, link: a, vertices: {moved}}}]\n"
    pair = "home: {x: 4}\nboundaries: [{name: beta, a: A, b: B, min_distance: 0.5}]"
    robot = load_text(urdf(SLIDE), marks + pair)
    size = 1e-13 if offset == 0.0 else 1e-8
    clear, hit = (pb.certify(robot, [[4.0], [2.5 + gap]]) for gap in (200 * size, -200 * size))
    assert clear.verdict is pb.Verdict.CERTIFIED
    assert clear.lower <= 200 * size + 1e-12 * offset
    assert hit.verdict is pb.Verdict.VIOLATED
    assert hit.first_contact is not None
    assert robot.boundaries["beta"].clearance(hit.first_contact.q) < 0.0
    assert pb.certify(robot, [[4.0], [2.5]]).verdict is not pb.Verdict.CERTIFIED
    assert pb.certify_box(robot, [2.5 + 200 * size], [4.5]).verdict is pb.Verdict.CERTIFIED
    assert pb.certify_box(robot, [2.5 - 200 * size], [4.5]).verdict is pb.Verdict.VIOLATED


def test_a_vertex_that_overtakes_within_a_piece_is_seen(load_text: Load) -> None:
    """A plate turns about its middle above a floor of a box: at +-phi the other end is nearest, by sin(phi)."""
    plate = "[[-1, -0.1, 0], [1, -0.1, 0], [-1, 0.1, 0], [1, 0.1, 0], [0, 0, 0.1]]"
    marks = f"hulls: [{{name: A, link: a, vertices: {plate}}}]\n"
    marks += "boxes: [{name: B, link: base, xyz: [0, 0, -1], rpy: [0, 0, 0], size: [9, 9, 1]}]\n"
    for gap in (-1e-6, 1e-6):
        distance = float(0.5 - np.sin(0.1) - gap)
        text = f"{marks}boundaries: [{{name: beta, a: A, b: B, min_distance: {distance!r}}}]"
        robot = load_text(urdf(TURN), text)
        certified = pb.Verdict.CERTIFIED if gap > 0 else pb.Verdict.VIOLATED
        assert pb.certify(robot, [[-0.1], [0.05]]).verdict is certified
        assert pb.certify(robot, [[0.1], [-0.05]]).verdict is certified
        assert pb.certify_box(robot, [-0.1], [0.1]).verdict is certified


def test_motions_of_every_sort_agree_on_a_hull(arm: pb.Robot) -> None:
    rng = np.random.default_rng(3)
    seen: set[pb.Verdict] = set()
    for _ in range(3):
        points = np.array(arm.home) + np.cumsum(0.25 * rng.normal(size=(4, 4)), axis=0)
        spline = CubicSpline(np.arange(4.0), points)
        bends = np.abs(spline(np.linspace(0, 3, 61), 2)).max(axis=0) * 1.0001
        speeds = np.abs(spline(np.linspace(0, 3, 3001), 1)).max(axis=0) * 1.01
        bounded = pb.BoundedMotion(lambda t, order=0, s=spline: s(t, order), 0.0, 3.0, speeds, bends)
        Q = spline(np.linspace(0.0, 3.0, 400))
        least = arm.boundaries.signed_clearances(Q).min(axis=0)
        for motion in (spline, bounded):
            found = pb.certify(arm, motion, limits=False, each=True)
            seen.add(found.verdict)
            for one, value in zip(found.boundaries, least, strict=True):
                assert one.lower <= value + 1e-12
                assert (one.verdict is pb.Verdict.CERTIFIED) <= (value > 0.0)
                if one.contact is not None:
                    assert arm.boundaries[one.name].signed_clearance(one.contact.q) < 0.0
    assert pb.Verdict.VIOLATED in seen


def test_a_certified_box_of_hulls_cannot_grow_much_and_holds_no_contact(load_text: Load) -> None:
    marks = f"hulls: [{{name: A, link: b, vertices: {CUBE}}}, {{name: B, link: base, vertices: {CUBE}}}]\n"
    marks += "home: {x: 4}\nboundaries: [{name: beta, a: A, b: B}]"
    robot = load_text(urdf(SLIDE, joint("q", "revolute", "a", "b", axis="0 1 0", limit="-3.2 3.2")), marks)
    box = pb.certified_box(robot, [4.0, 0.2], budget=pb.Budget(boxes=5_000, seconds=60.0))
    assert box.verdict is pb.Verdict.CERTIFIED
    assert box.lower_corner[0] < 3.0  # the corners of a cube that turns reach to 1 + sqrt(2) before they touch
    rng = np.random.default_rng(4)
    assert np.all(robot.boundaries.free(rng.uniform(box.lower_corner, box.upper_corner, (500, 2))))


def test_bodies_inside_each_other_are_in_contact_and_proven_to_be(load_text: Load) -> None:
    small = CUBE.replace("1", "0.25")
    marks = f"hulls: [{{name: A, link: a, vertices: {small}}}, {{name: B, link: base, vertices: {CUBE}}}]\n"
    robot = load_text(urdf(SLIDE), f"{marks}home: {{x: 4}}\nboundaries: [{{name: beta, a: A, b: B}}]")
    family = families(robot, tuple(robot.boundaries), np.array([-1.0]), np.array([1.0]))[-1]
    found = over_box(family.swept, np.zeros(1, np.intp), np.array([[0.05]]), np.array([[0.3]]), family.error)
    assert found.upper[0] <= 0.05  # the smaller one may move by 0.3 m and is inside still
    assert pb.certify(robot, [[0.1], [-0.1]]).verdict is pb.Verdict.VIOLATED


def test_a_box_written_as_a_hull_has_the_same_bounds(load_text: Load) -> None:
    rng = np.random.default_rng(5)
    corners = [[x, y, z] for x in (0.1, 0.3) for y in (-0.1, 0.2) for z in (0.2, 0.5)]
    box = "boxes: [{name: A, link: d, xyz: [0.2, 0.05, 0.35], rpy: [0, 0, 0], size: [0.2, 0.3, 0.3]}]\n"
    hull = f"hulls: [{{name: A, link: d, vertices: {corners}}}]\n"
    rest = "points: [{name: B, link: base, xyz: [2, 1, 0.5]}]\nboundaries: [{name: beta, a: A, b: B}]"
    found: list[np.ndarray] = []
    boxes = rng.uniform(-1, 1, (40, 4)), 10.0 ** rng.uniform(-4, -1, (40, 4))
    for marks in (box, hull):
        robot = load_text(urdf(*ARM), marks + rest)
        family = families(robot, tuple(robot.boundaries), -2 * np.ones(4), 2 * np.ones(4))[-1]
        bounds = over_box(family.swept, np.zeros(40, np.intp), *boxes, np.zeros(40))
        found.append(np.stack((bounds.value, bounds.lower)))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-12)
    assert np.median(np.abs(found[0][1] - found[1][1])) < 0.02
    assert dataclasses.is_dataclass(family.swept)
