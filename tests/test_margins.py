"""Margins: scaling that refuses, insets that hold, clearances that are proven, convex parts that fit."""

from pathlib import Path

import numpy as np
import pytest
import shapely

import pinbound as pb
from pinbound.evaluate import numeric
from pinbound.path.chain import Chain
from pinbound.region import convex, margins

ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="upper"/><link name="fore"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="tip" link="fore" xyz="0 0 0.25" radius="0.06"/>
    <pinbound:point name="elbow" link="fore" xyz="0 0 0" radius="0.03"/>
    <pinbound:point name="post" link="base" xyz="{post}" radius="0"/>
    {boundaries}
  </pinbound:annotations>
</robot>"""


@pytest.fixture(params=["hole", "bay"])
def curved(request: pytest.FixtureRequest, tmp_path: Path) -> pb.Region:
    """A region that is not convex."""
    post = {"hole": "0.35 0 0.1", "bay": "0.3 0 0.1"}[request.param]
    pairs = (("tip", "post"),) if request.param == "hole" else (("tip", "post"), ("elbow", "post"))
    boundaries = "".join(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs)
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(post=post, boundaries=boundaries))
    region = pb.feasible_region(pb.load(path), ("q1", "q2"))
    assert not region.is_convex
    return region


def samples(region: pb.Region, count: int = 4000) -> np.ndarray:
    X = np.random.default_rng(3).uniform(*region.slice.window, (count, 2))
    return X[shapely.contains_xy(region.polygon, X)]


def test_a_scaled_region_that_leaves_is_refused_with_a_witness(curved: pb.Region) -> None:
    with pytest.raises(pb.LeavesRegionError, match="with_clearance") as caught:
        curved.scale(0.9)
    assert not curved.contains(caught.value.witness)
    assert caught.value.factor == 0.9
    assert curved.scale(1.0).area == pytest.approx(curved.area, rel=1e-12)


@pytest.mark.parametrize("factor", [0.0, -1.0, 1.1, float("nan")])
def test_factors_that_make_no_sense_are_refused(curved: pb.Region, factor: float) -> None:
    with pytest.raises(pb.DimensionError, match="factor"):
        curved.scale(factor)


@pytest.mark.parametrize("angle", [0.01, 0.2, 0.5])
def test_an_inset_is_at_least_that_deep(curved: pb.Region, angle: float) -> None:
    inset = curved.inset(angle)
    for part in inset.components:
        points = np.concatenate([edge.points for edge in part.edges])
        depth = curved.polygon.boundary.distance(shapely.union_all(shapely.points(points)))
        assert depth >= angle
        assert {edge.name for edge in part.edges} <= {edge.name for edge in curved.edges}
    X = samples(curved)
    deep = curved.signed_distance(curved.slice.lift(X)) > angle + 2e-3 * angle + 3e-5
    held = np.any([part.contains(curved.slice.lift(X)) for part in inset.components], axis=0)
    assert np.all(held[deep])


def test_an_inset_may_be_empty(curved: pb.Region) -> None:
    nothing = curved.inset(4.0)
    assert nothing.is_empty
    assert nothing.area == 0.0
    assert not nothing.contains(curved.at)
    assert nothing.signed_distance(curved.at) == -np.inf


def test_a_metric_margin_raises_every_threshold(curved: pb.Region) -> None:
    near = curved.with_clearance(0.01)
    robot = curved.slice.robot
    Q = near.slice.lift(samples(near))
    assert len(Q) > 100
    assert robot.boundaries.clearances(Q[near.contains(Q)]).min() > 0.01
    assert near.area < curved.area
    found = near.clearance(1e-5)
    slope = max(np.abs(b.gradient(Q)).max() for b in robot.boundaries)
    assert found.lower >= 0.01 - 2 * slope * near.accuracy - 1e-5
    assert found.upper - found.lower <= 1e-5


@pytest.mark.parametrize("gap", [1e-6, 1e-3, 0.1])
def test_the_smallest_clearance_is_a_bound(curved: pb.Region, gap: float) -> None:
    inset = curved.inset(0.05)
    found = inset.clearance(gap)
    robot = curved.slice.robot
    Q = inset.slice.lift(np.concatenate((samples(inset), *(edge.points for edge in inset.edges))))
    seen = robot.boundaries.clearances(Q)
    assert found.lower <= seen.min()
    assert found.upper <= seen.min() + gap
    assert found.upper - found.lower <= gap
    assert robot.boundaries[found.boundary].clearance(found.q) == pytest.approx(found.upper, abs=1e-15)


def test_a_coarse_search_is_still_a_bound() -> None:
    """Where the norm bends down, the linear part alone would promise too much."""
    offsets = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.7], [0.0, 0.0, 0.4]])
    chain = Chain(offsets, np.zeros((3, 3, 2)), np.array([[0.0, 1.0, 0.0]] * 2), np.eye(2), 2.1)
    rng = np.random.default_rng(2)
    for _ in range(60):
        corner = rng.uniform(-2.0, 2.0, 2)
        polygon = shapely.box(*corner, *(corner + rng.uniform(0.2, 1.2, 2)))
        grid = np.stack(np.meshgrid(*(np.linspace(*polygon.bounds[i::2], 60) for i in (0, 1))), axis=-1).reshape(-1, 2)
        least = numeric.norm(numeric.positions(chain, grid)).min() - 0.1
        for gap in (1.0, 0.1, 1e-3):
            lower, upper, point = margins._branch_and_bound(margins._PointBounds(chain), 0.1, polygon, gap, np.inf)
            assert lower <= least <= upper + 1e-3
            assert upper - lower <= gap
            assert polygon.covers(shapely.Point(point))


@pytest.mark.parametrize("factor", [1.0, 0.9, 0.5])
def test_the_smallest_clearance_of_one_angle_boundaries(factor: float) -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot).scale(factor)
    found = region.clearance()
    X = samples(region, 100_000)
    edges = np.concatenate([np.linspace(edge.start, edge.end, 200) for edge in region.edges])
    seen = robot.boundaries.clearances(region.slice.lift(np.concatenate((X, edges)))).min()
    assert found.lower <= seen <= found.upper + 1e-5
    assert found.upper - found.lower <= 1e-6


def test_convex_parts_fill_the_region(curved: pb.Region) -> None:
    parts = curved.convex_parts(rim=5e-3)
    polygons = [part.polygon for part in parts]
    assert all(convex.is_convex(polygon) for polygon in polygons)
    assert all(curved.polygon.covers(polygon) for polygon in polygons)
    assert shapely.union_all(polygons).area == pytest.approx(sum(p.area for p in polygons), rel=1e-9)
    length = curved.polygon.length
    assert curved.area - 2 * 5e-3 * length < sum(p.area for p in polygons) < curved.area
    X = samples(curved)
    for part in parts[:20]:
        A, b = part.halfspaces()
        np.testing.assert_array_equal(np.all(X @ A.T < b, axis=1), part.contains(part.slice.lift(X)))


def test_the_inscribed_polygon_is_convex_free_and_large(curved: pb.Region) -> None:
    found = curved.inscribed_polygon()
    assert convex.is_convex(found.polygon)
    assert curved.polygon.covers(found.polygon)
    assert curved.slice.free(samples(found)).all()
    assert found.area >= max(part.area for part in curved.convex_parts(rim=5e-3)) * 0.9


def test_a_convex_region_is_its_own_convex_part() -> None:
    region = pb.feasible_region(pb.load("minervabot_v3"))
    assert region.convex_parts() == (region,)
    assert region.inscribed_polygon() is region
    with pytest.raises(pb.DimensionError, match="inset"):
        region.inset(-0.1)
    with pytest.raises(pb.DimensionError, match="margin"):
        region.with_clearance(-0.1)
