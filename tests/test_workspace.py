"""The workspace image against closed-form kinematics, Monte Carlo and known bodies."""

import dataclasses
import importlib
import itertools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
import trimesh

import pinbound as pb
from pinbound.evaluate import numeric
from pinbound.path.relative import absolute_chain
from pinbound.path.restriction import hold
from pinbound.region.folds import find_folds
from pinbound.region.swept import swept_body
from pinbound.region.workspace import workspace_section
from robots import joint, robot_xml

TOOL = np.array([0.03546, -0.02771])  # from the wrist, always level


@pytest.fixture(scope="module")
def hexagon(minerva: pb.Robot) -> pb.Region:
    return pb.feasible_region(minerva)


def elbow_up(points: np.ndarray) -> np.ndarray:
    """Closed-form inverse of MinervaBotV3's (x, z): (q2, q3); NaN out of reach. Lengths and angles as in the notes."""
    wrist = points - TOOL - [0.0, 0.0385 + 0.072]
    a, b, droop = 0.1, np.hypot(0.09397, 0.0342), np.arctan2(0.0342, 0.09397)
    reach = np.linalg.norm(wrist, axis=1)
    with np.errstate(invalid="ignore"):
        at_shoulder = np.arccos((a**2 + reach**2 - b**2) / (2 * a * reach))
    q2 = np.arctan2(wrist[:, 0], wrist[:, 1]) - at_shoulder
    elbow = a * np.column_stack((np.sin(q2), np.cos(q2)))
    fore = wrist - elbow
    q3 = np.arctan2(-fore[:, 1], fore[:, 0]) - droop
    return np.column_stack((q2, q3))


def two_link(limits: tuple[str, str], axis: str = "0 1 0") -> str:
    """A planar arm of 0.3 and 0.2 m on a turret; without boundaries the region is the box of the limits."""
    return robot_xml(
        [
            joint("turn", "revolute", "base", "turret", axis="0 0 1", limit="-1 1"),
            joint("a", "revolute", "turret", "upper", axis=axis, limit=limits[0]),
            joint("b", "revolute", "upper", "fore", axis=axis, xyz="0 0 0.3", limit=limits[1]),
            joint("c", "fixed", "fore", "hand", xyz="0 0 0.2"),
        ],
        {},
        [],
    )


def test_the_printed_robots_area_and_volume(minerva: pb.Robot, hexagon: pb.Region) -> None:
    section = workspace_section(minerva, hexagon, "link_6", turn="q1")
    body = swept_body(minerva, section)
    assert section.folds.sign == -1
    assert section.folds.margin > 0.0
    assert section.is_one_to_one
    assert 1e6 * section.area.value == pytest.approx(13787.57, rel=1e-6)
    assert 1e9 * body.volume.value == pytest.approx(1.014810e7, rel=1e-6)
    assert body.angle == pytest.approx(np.radians(270))
    assert section.area.error < 1e-12 * section.area.value
    assert section.area.method == body.volume.method == "boundary integral"


def test_area_and_volume_against_monte_carlo_in_the_workspace(minerva: pb.Robot, hexagon: pb.Region) -> None:
    """Points drawn in the workspace, inverted in closed form, kept if the region holds them: nothing shared."""
    section = workspace_section(minerva, hexagon, "link_6", turn="q1")
    box = np.array([[0.0, 0.0], [0.3, 0.25]])
    count = 400_000
    points = np.random.default_rng(5).uniform(box[0], box[1], (count, 2))
    angles = elbow_up(points)
    inside = hexagon.contains(np.column_stack((np.zeros(count), angles)))
    size = float(np.prod(box[1]))
    for value, weights in ((section.area.value, np.ones(count)), (section.moment.value, points[:, 0])):
        draws = size * weights * inside
        assert abs(draws.mean() - value) < 4.0 * draws.std() / np.sqrt(count)
    assert np.array_equal(inside, shapely.contains_xy(section.polygon(1e-9), points))


def test_area_is_the_integral_of_the_determinant(minerva: pb.Robot, hexagon: pb.Region) -> None:
    section = workspace_section(minerva, hexagon, "link_6")
    low, high = hexagon.vertices.min(axis=0), hexagon.vertices.max(axis=0)
    X = np.random.default_rng(8).uniform(low, high, (200_000, 2))
    inside = hexagon.contains(np.column_stack((np.zeros(len(X)), X)))
    draws = np.prod(high - low) * np.abs(section.map.determinant(X)) * inside
    assert abs(draws.mean() - section.area.value) < 4.0 * draws.std() / np.sqrt(len(X))


def test_points_are_the_robots_own_positions(minerva: pb.Robot, hexagon: pb.Region) -> None:
    X = np.random.default_rng(2).uniform(-1, 1, (50, 2))
    section = workspace_section(minerva, hexagon, "link_4", xyz=(0.01, 0.02, 0.03), turn="q1")
    expected = minerva.positions("link_4", np.column_stack((np.zeros(50), X)), (0.01, 0.02, 0.03))
    assert np.abs(section.points(X) - expected).max() < 1e-15
    image = section.map
    rebuilt = image.origin + section.image(X) @ np.array((image.u, image.v)) + image.offset * image.normal
    assert np.abs(rebuilt - expected).max() < 1e-15


def test_restriction_keeps_the_value(any_robot: pb.Robot) -> None:

    rng = np.random.default_rng(4)
    n = len(any_robot.coordinates)
    for link in any_robot.tree.links:
        chain = absolute_chain(any_robot.tree, any_robot.coupling, link, (0.1, -0.2, 0.3))
        at, X = rng.uniform(-2, 2, n), rng.uniform(-2, 2, (20, 2))
        indices = rng.permutation(n)[:2]
        Q = np.repeat(at[None], 20, axis=0)
        Q[:, indices] = X
        found = numeric.positions(hold(chain, at, indices.tolist()), X)
        assert np.abs(found - numeric.positions(chain, Q)).max() < 1e-14


def test_derivative_bounds_hold_and_are_not_idle(minerva: pb.Robot, hexagon: pb.Region) -> None:
    image = workspace_section(minerva, hexagon, "link_6").map
    X = np.random.default_rng(3).uniform(-image.most, image.most, (20_000, 2))
    step = 1e-6
    largest = np.linalg.norm(image.jacobian(X), axis=1).max(axis=0)
    assert np.all(largest <= image.first_bound * (1 + 1e-12))
    assert np.all(largest > 0.5 * image.first_bound)
    for k in range(2):
        h = step * np.eye(2)[k]
        slope = np.abs(image.determinant(X + h) - image.determinant(X - h)) / (2 * step)
        assert slope.max() <= image.determinant_lipschitz[k] * (1 + 1e-6)


def test_a_disc_sector_and_its_torus(load_text: Callable[..., pb.Robot]) -> None:
    """A telescope that tilts and slides sweeps an annular sector; turned about the turret, a piece of a ball."""
    robot = load_text(
        robot_xml(
            [
                joint("turn", "revolute", "base", "turret", axis="0 0 1", limit="-2 1"),
                joint("tilt", "revolute", "turret", "arm", axis="0 1 0", limit="0.2 1.2"),
                joint("reach", "prismatic", "arm", "hand", axis="0 0 1", limit="0.3 0.5"),
            ],
            {},
            [],
        )
    )
    region = pb.feasible_region(robot, ("tilt", "reach"))
    section = workspace_section(robot, region, "hand", turn="turn")
    assert section.area.value == pytest.approx((0.25 - 0.09) / 2, rel=1e-12)
    volume = 3.0 * (0.5**3 - 0.3**3) / 3 * (np.cos(0.2) - np.cos(1.2))
    body = swept_body(robot, section)
    assert body.volume.value == pytest.approx(volume, rel=1e-12)
    mesh = body.mesh(1e-5)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume, rel=2e-4)
    angles = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    assert (angles.min(), angles.max()) == pytest.approx((-2.0, 1.0))


def test_a_fold_is_found_and_its_area_counted_once(load_text: Callable[..., pb.Robot]) -> None:
    """b in +-1 folds at b = 0: both elbows reach the same places."""
    robot = load_text(two_link(("0.5 1.0", "-1 1")))
    region = pb.feasible_region(robot, ("a", "b"))
    section = workspace_section(robot, region, "hand", turn="turn")
    assert section.folds.sign == 0
    assert np.abs(section.folds.points[:, 1]).max() < 0.02
    assert not section.is_one_to_one
    count = 200_000
    points = np.random.default_rng(6).uniform([0.0, 0.0], [0.6, 0.6], (count, 2))
    reach = np.linalg.norm(points, axis=1)
    with np.errstate(invalid="ignore"):
        bend = np.arccos((reach**2 - 0.13) / 0.12)
    towards = np.arctan2(points[:, 0], points[:, 1])
    covered = np.zeros(count, dtype=bool)
    for b in (bend, -bend):
        a = towards - np.arctan2(0.2 * np.sin(b), 0.3 + 0.2 * np.cos(b))
        covered |= (np.abs(b) < 1.0) & (a > 0.5) & (a < 1.0)
    draws = 0.36 * covered
    assert section.area.method == "covered places"
    assert abs(draws.mean() - section.area.value) < 4 * draws.std() / np.sqrt(count) + section.area.error
    assert section.area.error < 1e-6 * section.area.value


def test_a_fold_behind_a_simple_contour_is_not_overlooked(load_text: Callable[..., pb.Robot]) -> None:
    """The part below the fold lands inside the part above: the contour's image is simple, the map is not."""
    robot = load_text(two_link(("-2 2", "-1 1")))
    whole = workspace_section(robot, pb.feasible_region(robot, ("a", "b")), "hand", turn="turn")
    polygon = shapely.Polygon([(0, 0), (0.5, -0.5), (1, 0), (1.5, 0.8), (-1, 0.8)])
    section = dataclasses.replace(whole, region=SimpleNamespace(polygon=polygon, accuracy=0.0))
    assert section._outline(1e-6).is_valid
    assert section.folds.sign == 0
    assert not section.is_one_to_one
    upper = dataclasses.replace(
        whole, region=SimpleNamespace(polygon=polygon.intersection(shapely.box(-2, 1e-9, 2, 2)), accuracy=0.0)
    )
    assert abs(section.area.value - upper.area.value) < 2 * section.area.error
    assert section.area.error < 1e-6 * section.area.value


def test_a_map_that_winds_round_is_not_one_to_one(load_text: Callable[..., pb.Robot]) -> None:
    """No fold, but more than a turn: the annulus is counted once."""
    robot = load_text(two_link(("-3 4", "0.5 1.5")))
    region = pb.feasible_region(robot, ("a", "b"))
    section = workspace_section(robot, region, "hand", turn="turn")
    assert section.folds.sign != 0
    assert not section.is_one_to_one
    annulus = np.pi * 0.12 * (np.cos(0.5) - np.cos(1.5))
    assert section.area.value == pytest.approx(annulus, rel=1e-6)
    assert abs(section.area.value - annulus) < 2 * section.area.error


@pytest.mark.parametrize("sweep", [1.0, 3.0, 4.0, 7.0])
def test_a_section_across_the_axis_is_swept_once(load_text: Callable[..., pb.Robot], sweep: float) -> None:
    """A symmetric section: both sides sweep `min(2 alpha, 2 pi)` together."""
    robot = load_text(two_link(("-0.6 0.6", "-0.2 0.2")))
    region = pb.feasible_region(robot, ("a", "b"))
    body = swept_body(robot, workspace_section(robot, region, "hand", turn="turn"), 0.0, sweep)
    assert body.crosses_axis
    half = shapely.box(0.0, -1.0, 1.0, 1.0).intersection(body.section.polygon())
    alpha = min(sweep, 2 * np.pi)
    expected = min(2 * alpha, 2 * np.pi) * half.area * half.centroid.x
    assert body.volume.value == pytest.approx(expected, rel=1e-3)
    with pytest.raises(pb.UnsupportedError, match="reaches its axis"):
        body.mesh()


def test_meshes_are_closed_and_their_files_read_back(minerva: pb.Robot, hexagon: pb.Region, tmp_path: Path) -> None:
    section = workspace_section(minerva, hexagon, "link_6", turn="q1")
    for lower, upper in ((None, None), (-0.5, 0.25), (-4.0, 4.0)):
        body = swept_body(minerva, section, lower, upper)
        mesh = body.mesh(1e-4)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(body.volume.value, rel=2e-3)
    body = swept_body(minerva, section)
    for suffix in (".ply", ".stl"):
        read = trimesh.load(body.export(tmp_path / f"swept{suffix}", 3e-4), force="mesh")
        assert read.is_watertight
        assert read.volume == pytest.approx(body.volume.value, rel=5e-3)
    polygon = shapely.from_geojson(section.export(tmp_path / "section.geojson").read_text())
    assert polygon.area == pytest.approx(section.area.value, rel=1e-4)
    assert shapely.from_wkt(section.export(tmp_path / "section.wkt").read_text()).is_valid


def test_mesh_stays_within_its_chord(minerva: pb.Robot, hexagon: pb.Region) -> None:
    section = workspace_section(minerva, hexagon, "link_6", turn="q1")
    chord = 5e-4
    mesh = swept_body(minerva, section, 0.0, 1.0).mesh(chord)
    points, _ = trimesh.sample.sample_surface(mesh, 4000, seed=1)
    angle = np.arctan2(points[:, 1], points[:, 0])
    kept = (angle > 1e-6) & (angle < 1 - 1e-6)
    flat = np.column_stack((np.hypot(points[:, 0], points[:, 1]), points[:, 2]))[kept]
    ring = shapely.LinearRing(section.polygon(1e-8).exterior)
    assert shapely.distance(shapely.points(flat), ring).max() < chord


def test_scaled_area_shrinks_but_not_by_the_square(minerva: pb.Robot, hexagon: pb.Region) -> None:
    whole, scaled = (workspace_section(minerva, r, "link_6").area.value for r in (hexagon, hexagon.scale(0.9)))
    assert 0.7 < scaled / whole < 0.9


def test_refusals_say_why(minerva: pb.Robot, hexagon: pb.Region, load_text: Callable[..., pb.Robot]) -> None:
    with pytest.raises(pb.UnknownNameError, match="link_6"):
        workspace_section(minerva, hexagon, "link_9")
    with pytest.raises(pb.UnsupportedError, match="does not rotate the whole section"):
        workspace_section(minerva, hexagon, "link_6", turn="q2")
    with pytest.raises(pb.UnsupportedError, match="along a line, or not at all"):
        workspace_section(minerva, hexagon, "link_1")
    section = workspace_section(minerva, hexagon, "link_6")
    with pytest.raises(pb.DimensionError, match="turn="):
        swept_body(minerva, section)
    with pytest.raises(pb.DimensionError, match="polygon format"):
        section.export("section.dxf")
    turned = workspace_section(minerva, hexagon, "link_6", turn="q1")
    with pytest.raises(pb.DimensionError, match="lower <= upper"):
        swept_body(minerva, turned, 1.0, 0.0)
    with pytest.raises(pb.DimensionError, match="mesh format"):
        swept_body(minerva, turned).export("swept.step")
    with pytest.raises(pb.DimensionError, match="empty"):
        workspace_section(minerva, hexagon.inset(2.0), "link_6")
    skew = load_text(two_link(("0.5 1.0", "0.5 1.0")).replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 1"/>', 1))
    with pytest.raises(pb.UnsupportedError, match="does not lie along"):
        workspace_section(skew, pb.feasible_region(skew, ("a", "b")), "hand", turn="turn")
    curved = load_text(
        two_link(("0.5 1.0", "0.5 1.0")).replace(
            '<axis xyz="0 1 0"/><limit lower="0.5"', '<axis xyz="1 1 0"/><limit lower="0.5"', 1
        )
    )
    with pytest.raises(pb.UnsupportedError, match="curved surface"):
        workspace_section(curved, pb.feasible_region(curved, ("a", "b")), "hand")


def test_find_folds_names_its_budget_by_a_zero_sign(minerva: pb.Robot, hexagon: pb.Region) -> None:
    image = workspace_section(minerva, hexagon, "link_6").map
    stretched = shapely.box(-1.5, -1.5, 1.5, 1.5)  # holds q3 - q2 = 70 degrees, where the arm is straight
    found = find_folds(image, stretched)
    assert found.sign == 0
    bend = np.degrees(found.points[:, 1] - found.points[:, 0])
    assert (
        np.minimum(np.abs(bend - 70.0), np.abs(bend + 110.0)).max() < 1.0
    )  # straight or folded back; last triangles: 0.67
    assert {round(value, -1) for value in bend} == {70.0, -110.0}


def covered_by_both_elbows(first: float, second: float) -> float:
    """Area [m^2] of the 0.3 and 0.2 m arm with a in +-first and b in +-second: arcs at every radius, integrated."""
    quad = importlib.import_module("scipy.integrate").quad

    def arcs(b: float) -> float:
        aside = np.arctan2(0.2 * np.sin(b), 0.3 + 0.2 * np.cos(b))  # the tool beside the upper arm
        return min(2 * first + 2 * aside, 4 * first, 2 * np.pi) * 0.06 * np.sin(b)  # r dr = 0.06 sin(b) db

    bends = np.linspace(0.0, second, 400).tolist()
    return sum(quad(arcs, low, high, epsabs=1e-14)[0] for low, high in itertools.pairwise(bends))


@pytest.mark.parametrize(("first", "second"), [(0.2, 0.5), (0.2, 2.5), (1.0, 3.0), (3.05, 2.0)])
def test_a_folded_section_is_exact_to_its_error(
    load_text: Callable[..., pb.Robot], first: float, second: float
) -> None:
    """Both elbows, apart or over each other, with the image ending at its folds, its contour, or itself."""
    robot = load_text(two_link((f"-{first} {first}", f"-{second} {second}")))
    area = workspace_section(robot, pb.feasible_region(robot, ("a", "b")), "hand").area
    expected = covered_by_both_elbows(first, second)
    assert area.error < 1e-6 * expected
    assert abs(area.value - expected) < area.error


def test_the_error_of_a_folded_section_falls_with_the_accuracy(load_text: Callable[..., pb.Robot]) -> None:
    """An obstacle leaves a curved contour; four accuracies agree within what they state."""
    robot = load_text(
        robot_xml(
            [
                joint("a", "revolute", "base", "upper", axis="0 1 0", limit="-2 2"),
                joint("b", "revolute", "upper", "fore", axis="0 1 0", xyz="0 0 0.3", limit="-2 2"),
            ],
            {"tip": ("fore", "0 0 0.18")},
            [],
            '<pinbound:point name="post" link="base" xyz="0.3 0 0.25" radius="0.06"/>'
            '<pinbound:boundary name="beta" a="tip" b="post"/>',
        )
    )
    found = [
        workspace_section(robot, pb.feasible_region(robot, accuracy=accuracy), "fore", (0.0, 0.0, 0.2)).area
        for accuracy in (1e-3, 1e-4, 1e-5, 1e-6)
    ]
    best = found[-1]
    assert best.error < 1e-5 * best.value
    for coarse, fine in itertools.pairwise(found):
        assert fine.error < 0.3 * coarse.error
        assert abs(coarse.value - best.value) <= coarse.error + best.error


def test_three_joints_of_which_one_follows_make_cusps(load_text: Callable[..., pb.Robot]) -> None:
    """Several folds that meet in cusps: between what a raster surely holds, and what it touches."""
    for multiplier in (2.0, -2.0, 3.0):
        robot = load_text(
            robot_xml(
                [
                    joint("a", "revolute", "base", "one", axis="0 1 0", limit="-1 1"),
                    joint("b", "revolute", "one", "two", axis="0 1 0", xyz="0 0 0.5", limit="-2.5 2.5"),
                    joint(
                        "c",
                        "revolute",
                        "two",
                        "three",
                        axis="0 1 0",
                        xyz="0 0 0.5",
                        limit="-9 9",
                        mimic=f"b {multiplier} 0",
                    ),
                ],
                {},
                [],
            )
        )
        section = workspace_section(robot, pb.feasible_region(robot, ("a", "b")), "three", (0.0, 0.0, 0.4))
        count, cells = 1500, 250
        width = 3.0 / cells
        seen = np.zeros((cells, cells), dtype=bool)
        for a in np.linspace(-1.0, 1.0, count):
            place = section.image(np.column_stack((np.full(count, a), np.linspace(-2.5, 2.5, count))))
            seen[tuple(((place + 1.5) / width).astype(int).T)] = True
        inner = seen[1:-1, 1:-1].copy()
        for i, j in itertools.product(range(3), range(3)):
            inner &= seen[i : cells - 2 + i, j : cells - 2 + j]
        assert inner.sum() * width**2 < section.area.value < seen.sum() * width**2
        assert section.area.error < 1e-6


def test_slides_and_frames_that_cover_nothing(load_text: Callable[..., pb.Robot]) -> None:
    """A rail and an arm, two rails askew, and a point on the second axis."""
    rail = joint("x", "prismatic", "base", "cart", axis="1 0 0", limit="-1 1")
    arm = joint("b", "revolute", "cart", "arm", axis="0 1 0", limit="-1.2 1.2")
    robot = load_text(robot_xml([rail, arm], {}, []))
    section = workspace_section(robot, pb.feasible_region(robot, ("x", "b")), "arm", (0.0, 0.0, 0.5))
    # Swept by an arc on a rail: 2 m times its height, and the arc's own segment on both sides.
    height, segment = 0.5 * (1 - np.cos(1.2)), 0.25 * (1.2 - np.sin(1.2) * np.cos(1.2))
    assert section.area.value == pytest.approx(2.0 * height + segment, rel=1e-7)
    second = joint("z", "prismatic", "cart", "tool", axis="0.6 0 0.8", limit="-1 2")
    askew = load_text(robot_xml([rail, second], {}, []))
    section = workspace_section(askew, pb.feasible_region(askew, ("x", "z")), "tool")
    assert section.area.value == pytest.approx(2.0 * 3.0 * 0.8, rel=1e-12)
    hand = load_text(two_link(("-1 1", "-1 1")))
    section = workspace_section(hand, pb.feasible_region(hand, ("a", "b")), "fore")
    assert section.area.value == 0.0
    along = load_text(robot_xml([rail, joint("z", "prismatic", "cart", "tool", axis="1 0 0", limit="-1 2")], {}, []))
    with pytest.raises(pb.UnsupportedError, match="covers no area"):
        workspace_section(along, pb.feasible_region(along, ("x", "z")), "tool")
