"""Planar regions against brute force: membership, area, components, corners, on robots with holes and islands."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy import ndimage

import pinbound as pb
from pinbound.region.region import ConvexRegion, TracedRegion
from pinbound.tolerances import VERTEX

CAMPAIGN = Path(__file__).parents[1] / "benchmarks" / "planar_mechanisms.py"
spec = importlib.util.spec_from_file_location("planar_mechanisms", CAMPAIGN)
campaign = importlib.util.module_from_spec(spec)
sys.modules["planar_mechanisms"] = campaign
spec.loader.exec_module(campaign)

ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="mast"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q3" type="revolute"><parent link="base"/><child link="mast"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="tip" link="fore" xyz="0 0 0.25" radius="{tip}"/>
    <pinbound:point name="elbow" link="fore" xyz="0 0 0" radius="0.03"/>
    <pinbound:point name="post" link="base" xyz="{post}" radius="0"/>
    <pinbound:point name="flag" link="mast" xyz="0 0 0.2" radius="0.04"/>
    {boundaries}
  </pinbound:annotations>
</robot>"""

HEXAGON = (  # (q2, q3) in degrees, re-derived from the reference data
    (70.001229130, 1.496605072),
    (70.001229130, 68.981699122),
    (36.552579147, 68.981699122),
    (-10.145750656, 22.283369318),
    (-10.145750656, -8.462041074),
    (60.042582985, -8.462041074),
)


def arm(tmp_path: Path, tip: float, post: str, *pairs: tuple[str, str]) -> pb.Robot:
    boundaries = "".join(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs)
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(tip=tip, post=post, boundaries=boundaries))
    return pb.load(path)


def check_corners(region: pb.Region) -> int:
    """Return how many corners are polished.

    At each corner both named functions vanish to `VERTEX` in angle, or the corner says that it is not polished.
    """
    robot = region.slice.robot
    limits = {p.name: p for p in (*region.slice.box, *region.slice.limits)}
    columns = [robot.coordinates.index(name) for name in region.coordinates]
    for corner in region.corners:
        if not corner.polished:
            continue
        q = region.slice.lift(corner.point[None])[0]
        for name in (corner.before, corner.after):
            if name in limits:
                off = abs(limits[name].normal @ corner.point - limits[name].bound)
            else:
                boundary = robot.boundaries[name]
                if boundary.contact is not None:
                    continue
                slope = np.linalg.norm(boundary.gradient(q)[columns])
                threshold = max(boundary.threshold, boundary.contact_tolerance)
                off = abs(boundary.norm(q) - threshold) / slope
            assert off <= 20 * VERTEX
    return sum(corner.polished for corner in region.corners)


@pytest.mark.parametrize(
    ("style", "seed", "boundaries"), [("planar", 7, None), ("spatial", 8, None), ("planar", 9, 12)]
)
def test_random_mechanisms_agree_with_brute_force(style: str, seed: int, boundaries: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    count = 10 if boundaries else 30
    corners = polished = 0
    for robot, names in campaign.free_robots(rng, tmp_path, count, style, boundaries):
        region = pb.feasible_region(robot, names)
        one = campaign.compare(region)
        assert one.disagreements == 0
        corners, polished = corners + len(region.corners), polished + check_corners(region)
        assert all(edge.name in region.supports() for edge in region.edges)
    assert polished >= 0.98 * corners > 0


@pytest.mark.parametrize("seed", range(4))
def test_components_are_those_of_the_flood(seed: int, tmp_path: Path) -> None:
    robot, names = next(iter(campaign.free_robots(np.random.default_rng([4, seed]), tmp_path, 1, "planar", 8)))
    region = pb.feasible_region(robot, names)
    grid = 401
    X, free, _ = campaign.oracle(region, grid)
    labels, _ = ndimage.label(free.reshape(grid, grid))
    labels = labels.ravel()
    held = np.array([component.contains(X, order="region") for component in region.components])
    assert held.sum(axis=0).max() == 1  # no point in two components
    lost = free & ~held.any(axis=0)
    contour = shapely.union_all([component.polygon.boundary for component in region.components])
    assert np.all(shapely.distance(shapely.points(X[lost]), contour) <= region.accuracy)
    for label in range(1, labels.max() + 1):
        assert np.count_nonzero(held[:, labels == label].any(axis=1)) <= 1  # what the grid connects is one component


def test_area_converges_to_the_oracles(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.05, "0.35 0 0.1", ("tip", "post"), ("elbow", "post"))
    region = pb.feasible_region(robot, ("q1", "q2"))
    errors = [campaign.compare(region, (grid,)).area_difference for grid in (50, 200, 800)]
    assert errors[2] < 0.002 * region.area
    assert errors[2] < errors[0]
    fine = pb.feasible_region(robot, ("q1", "q2"), accuracy=1e-7)
    assert abs(fine.area - region.area) <= region.area_error + fine.area_error


def test_a_hole_of_a_ten_thousandth_of_a_radian(tmp_path: Path) -> None:
    """Two bare points meet at one elbow angle: the contact tolerance of 0.02 mm leaves a hole of 1e-4 rad."""
    robot = arm(tmp_path, 0.0, "0.4 0 0.1", ("tip", "post"))
    region = pb.feasible_region(robot, ("q1", "q2"))
    assert len(region.loops) == 3  # elbow up and elbow down
    for loop in region.loops[1:]:
        assert [edge.name for edge in loop] == ["tip_post"]
        hole = loop[0].points
        assert 1e-5 < np.ptp(hole, axis=0).max() < 1e-3
        centre = region.slice.lift(hole.mean(axis=0)[None])[0]
        assert robot.boundaries["tip_post"].norm(centre) < 1e-6  # a twentieth of the hole's radius
        assert not region.contains(centre)
        assert region.signed_distance(centre) < 0.0


def test_branched_boundaries_in_the_plane_of_two_branches(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.03, "0.4 0 0.1", ("elbow", "flag"), ("tip", "flag"))
    region = pb.feasible_region(robot, ("q1", "q3"))
    assert campaign.compare(region).disagreements == 0
    assert {"elbow_flag"} <= {edge.name for edge in region.edges}
    check_corners(region)


def test_the_order_of_the_coordinates_only_mirrors_the_plane(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.05, "0.35 0 0.1", ("tip", "post"))
    one, other = pb.feasible_region(robot, ("q1", "q2")), pb.feasible_region(robot, ("q2", "q1"))
    assert one.area == pytest.approx(other.area, abs=2 * one.area_error)
    Q = np.random.default_rng(0).uniform(-3, 3, (3000, 3))
    Q[:, 2] = 0.0
    differ = one.contains(Q) != other.contains(Q)
    assert np.all(np.abs(one.signed_distance(Q[differ])) <= one.accuracy)


def test_what_is_held_moves_the_region(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.03, "0.4 0 0.1", ("tip", "flag"))
    areas = [pb.feasible_region(robot, ("q1", "q2"), at=[0.0, 0.0, a]).area for a in (-0.5, 0.0, 0.8)]
    assert len({round(area, 6) for area in areas}) == 3
    region = pb.feasible_region(robot, ("q1", "q2"), at=[0.0, 0.0, 0.8])
    assert campaign.compare(region).disagreements == 0
    assert np.isnan(region.signed_distance([0.0, 0.0, 0.7]))  # another slice


@pytest.mark.parametrize("distance", [0.0, 0.005])
def test_minervabot_is_exact(distance: float) -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot, ("q2", "q3"), margin=distance)
    assert region.is_convex
    assert region.accuracy == 0.0
    if distance == 0.0:
        assert region.area == pytest.approx(1.5434743997, abs=5e-11)
        expected = np.array(HEXAGON)
        np.testing.assert_allclose(np.degrees(region.vertices), expected, rtol=0, atol=1e-9)
        after = np.roll(expected, -1, axis=0)
        weight = expected[:, 0] * after[:, 1] - expected[:, 1] * after[:, 0]
        centroid = weight @ (expected + after) / (3.0 * weight.sum())
        np.testing.assert_allclose(np.degrees(region.centroid), centroid, rtol=0, atol=1e-9)
        assert sum(component.area for component in region.components) == pytest.approx(4 * np.pi**2, abs=1e-12)
        return
    Q = region.slice.lift(np.random.default_rng(1).uniform(-np.pi, np.pi, (20000, 2)))
    clear = np.all(robot.boundaries.norms(Q) > [b.threshold + distance for b in robot.boundaries], axis=1)
    assert not np.any(region.contains(Q) & ~clear)
    held = np.array([c.contains(Q) for c in region.components])
    np.testing.assert_array_equal(held.any(axis=0), clear)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.05, "0.35 0 0.1", ("tip", "post"))
    q = [1.0, 0.7, 0.0]
    clear = robot.boundaries["tip_post"].clearance(q)
    with pytest.raises(pb.DimensionError, match="tip_post"):
        pb.feasible_region(robot, ("q1", "q2"), at=q, margin=clear + 1e-9)
    with pytest.raises(pb.DimensionError, match="accuracy"):
        pb.feasible_region(robot, ("q1", "q2"), accuracy=0.0)
    with pytest.raises(pb.DimensionError, match="finite"):
        pb.feasible_region(robot, ("q1", "q2"), at=[0.0, np.nan, 0.0])
    with pytest.raises(pb.DimensionError, match="has no range"):
        pb.feasible_region(robot, ("q1", "q2"), window={"q1": (1.0, 1.0)})
    with pytest.raises(pb.DimensionError, match="margin"):
        pb.feasible_region(robot, ("q1", "q2"), margin=float("inf"))
    with pytest.raises(pb.UnsupportedError, match="convex"):
        pb.feasible_region(robot, ("q1", "q2")).halfspaces()


def test_two_sorts_of_region_answer_the_same_questions(tmp_path: Path) -> None:
    convex = pb.feasible_region(pb.load("minervabot_v3"))
    boundaries = '<pinbound:boundary name="beta" a="tip" b="post"/><pinbound:boundary name="flag" a="tip" b="flag"/>'
    (tmp_path / "arm.urdf").write_text(ARM.format(tip=0.02, post="0.3 0 0.1", boundaries=boundaries))
    traced = pb.feasible_region(pb.load(tmp_path / "arm.urdf"), ("q1", "q2"))
    assert isinstance(convex, ConvexRegion)
    assert isinstance(traced, TracedRegion)
    assert isinstance(traced.inscribed_polygon(), ConvexRegion)
    for region in (convex, traced):
        assert isinstance(region, pb.Region)
        assert type(region.scale(1.0)) is type(region.inset(0.01)) is type(region)
        assert region.area_interval[0] <= region.area <= region.area_interval[1]
        assert region.contains(region.slice.start, order="region")
    with pytest.raises(TypeError, match="abstract"):
        pb.Region(convex.slice, convex.loops, convex.corners, 0.0)


def test_old_names_stay_for_one_release() -> None:
    region = pb.feasible_region(pb.load("minervabot_v3"))
    with pytest.warns(DeprecationWarning, match=r"Region\.plane is now called Region\.slice") as told:
        assert region.plane is region.slice
    assert told[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"Region\.planes is now called Region\.half_planes"):
        assert region.planes is region.half_planes
