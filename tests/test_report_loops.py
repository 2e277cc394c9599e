"""The report and `derive` of robots with loops that are not parallelograms: what they print is what the loop does."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
import sympy
from typer.testing import CliRunner

import linkages
import pinbound as pb
from pinbound.boundaries.looped import over_z
from pinbound.cli import app
from pinbound.figures.report import _volume, boundary_rows, write_report
from pinbound.figures.report_joints import closure_rows, limit_rows, loop_rows, tree_rows
from pinbound.figures.workspace_image import workspace_image
from pinbound.robot.loop_robot import LoopRobot


@pytest.fixture(scope="module")
def robot() -> LoopRobot:
    found = pb.load(linkages.lifter_urdf(linkages.lifter()))
    assert isinstance(found, LoopRobot)
    return found


@pytest.fixture(scope="module")
def region(robot: LoopRobot) -> pb.Region:
    return pb.feasible_region(robot)


def test_the_page_of_a_four_bar_holds_the_tables(robot: LoopRobot, region: pb.Region, tmp_path: Path) -> None:
    page, rows = write_report(robot, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert f"{region.area:.10f}" in text
    assert {row.boundary.name for row in rows if row.status == "active"} == {
        edge.name for edge in region.edges if edge.is_contact
    }
    assert "between marks and 1 closed loop." in text
    assert f"<strong>Coverage:</strong> {robot.coverage.summary}" in text
    assert "passive joints" in text.lower()
    for name in ("robot", "region", "workspace"):
        assert (tmp_path / f"{name}.svg").stat().st_size > 5_000
    for name in ("tool_post", "tip_floor", "crank_rocker"):
        joint = "rocker_joint" if name == "crank_rocker" else "knee"
        body = text[text.index(f"<summary>{name}</summary>") :]
        assert f"in this formula: {joint} = four_bar(crank_joint)" in body[: body.index("</details>")]
    assert "made of small cells" not in text
    assert "drawn from small cells of the region" in text


def test_contact_of_a_boundary_within_the_loop_is_the_angle_of_its_one_joint(robot: LoopRobot) -> None:
    """`tool_crank` turns by the tool alone: its contact is a strip, tried on both sides in three poses."""
    rows = boundary_rows(robot, None)
    row = next(row for row in rows if row.boundary.name == "tool_crank")
    found = re.fullmatch(r"tool_joint = ([0-9.-]+) ± ([0-9.]+)°", row.contact)
    assert found is not None
    middle, half = (math.radians(float(part)) for part in found.groups())
    for crank in (0.0, 0.7, 1.4):
        for side in (-1.0, 1.0):
            for off in (-1e-6, 1e-6):
                clear = row.boundary.signed_clearance([crank, middle + side * (half + off)])
                assert (clear > 0.0) == (off > 0.0)


def test_formulas_are_functions_of_the_solved_joints(robot: LoopRobot) -> None:
    """Each expression at `theta` of the coupling has the norm of the boundary: SymPy against NumPy."""
    Q = np.array([[0.2, -0.4], [1.1, 0.9], [1.9, -1.3]])
    boundary = robot.boundaries["tool_post"]
    for frame in ("minimal", "ancestor"):
        expression = over_z(boundary).expression(frame)
        symbols = {str(one): one for one in expression.free_symbols}
        assert {"knee", "tool_joint"} <= set(symbols) <= {*robot.coupling.joints}
        for q, norm in zip(Q, boundary.norm(Q), strict=True):
            theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
            vector = expression.subs({symbol: theta[name] for name, symbol in symbols.items()})
            assert float(sympy.sqrt(vector.dot(vector))) == pytest.approx(norm, abs=1e-12)


def test_toggles_and_limits_of_the_tables_are_those_of_the_mechanism(robot: LoopRobot) -> None:
    (row,) = loop_rows(robot)
    assert (row.name, row.passive, row.inputs, row.form) == (
        "four_bar",
        ("knee", "rocker_joint"),
        ("crank_joint",),
        "two arms",
    )
    found = re.fullmatch(r"crank_joint = ([0-9.]+) deg and ([0-9.]+) deg, every turn", row.toggles)
    assert found is not None
    flat = {"crank_joint": 2.0, "knee": -2.0, "rocker_joint": 2.0, "tool_joint": 0.0}
    exact = float(linkages.lifter().toggled(flat, "crank_joint"))
    assert float(found[1]) == pytest.approx(math.degrees(exact), abs=1e-6)
    assert float(found[2]) == pytest.approx(360.0 - math.degrees(exact), abs=1e-6)
    for one in limit_rows(robot):
        known = robot.boundaries.limits(one.coordinate, robot.home)
        assert [float(end.split()[0]) for end in one.ends] == pytest.approx(
            np.degrees([known.lower, known.upper]), abs=1e-6
        )
        assert one.stops == (known.lower_stop, known.upper_stop)
    declared = {joint: ends for _, _, joint, _, ends in tree_rows(robot)}
    for part in linkages.lifter().parts:
        low, high = np.degrees([part.lower, part.upper])
        assert declared[part.name] == f"{low:.3f} deg to {high:.3f} deg"


def test_pins_are_measured_only_where_the_loop_closes(robot: LoopRobot) -> None:
    """A quarter of the box is beyond the toggle, where the formulas belong to no robot and the pin is open."""
    (row,), said = closure_rows(robot)
    assert row.bound == "solved in closed form"
    assert row.largest < 1e-15
    count = int(said.split(" samples of 10,000")[0].replace(",", ""))
    assert 6_000 < count < 9_000
    assert robot.closure_residuals([2.5, 0.0]).max() > 1e-3


def test_the_filled_workspace_is_what_the_hand_reaches(robot: LoopRobot, region: pb.Region) -> None:
    image = workspace_image(robot, region, "hand")
    assert image.is_sampled
    shape = shapely.unary_union([shapely.Polygon(rings[0], rings[1:]) for rings in image.rings])
    rng, bounds = np.random.default_rng(3), region.polygon.bounds
    Q = rng.uniform(bounds[:2], bounds[2:], (120_000, 2))
    Q = Q[region.contains(Q)]
    keep = list(image.plane)
    reached = shapely.points(1e3 * robot.positions("hand", Q)[:, keep])
    assert shapely.distance(shape, reached).max() < 0.5  # mm
    lows, highs = np.array(shape.bounds).reshape(2, 2)
    within = shapely.points(rng.uniform(lows, highs, (2_000, 2)))
    within = within[shapely.contains(shape.buffer(-8.0), within)]
    nearest = shapely.STRtree(reached).query_nearest(within, return_distance=True)[1]
    assert nearest.max() < 15.0  # as thick as the samples lie
    assert workspace_image(robot, region, "rocker").rings == ()  # its origin stands still
    assert workspace_image(robot, region, "tool").rings == ()  # its origin moves along a curve


@pytest.mark.parametrize("kind", linkages.KINDS)
def test_every_kind_of_loop_has_a_report(kind: str, tmp_path: Path) -> None:
    robot = linkages.scene(kind, np.random.default_rng(4), pb.load)
    page, rows = write_report(robot, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert len(rows) == len(robot.boundaries)
    assert 'id="loops"' in text
    (row,), _ = closure_rows(robot)
    assert row.largest < 1e-14
    assert len(limit_rows(robot)) == len(robot.coordinates)


def test_free_volumes_and_sections_are_not_computed() -> None:
    mechanism = linkages.lifter()
    mechanism.parts.append(linkages.Part("wrist", "hand", "palm", 0j, None, 1, -1.0, 1.0))
    urdf = linkages.lifter_urdf(mechanism).replace('"grip" link="hand"', '"grip" link="palm"')
    robot = pb.load(urdf)
    assert _volume(robot, None) == (None, "free volumes through loops that are not parallelograms are not computed")
    with pytest.raises(pb.UnsupportedError, match="four_bar"):
        _volume(robot, ("crank_joint", "tool_joint", "wrist"))
    with pytest.raises(pb.UnsupportedError, match="four_bar"):
        pb.workspace_section(robot, pb.feasible_region(robot, ("tool_joint", "wrist")), "hand")


def test_derive_says_which_joints_are_solved(tmp_path: Path) -> None:
    path = tmp_path / "lifter.urdf"
    path.write_text(linkages.lifter_urdf(linkages.lifter()))
    said = CliRunner().invoke(app, ["derive", str(path)])
    assert said.exit_code == 0
    assert "depends on crank_joint, tool_joint" in said.stdout
    assert "knee = four_bar(crank_joint): passive, solved from the loop" in said.stdout
    records = json.loads(CliRunner().invoke(app, ["derive", str(path), "--json"]).stdout)
    record = next(one for one in records if one["name"] == "crank_rocker")
    assert record["coordinates"] == ["crank_joint"]
    assert record["solved_joints"] == {"rocker_joint": "four_bar(crank_joint)"}
    assert CliRunner().invoke(app, ["derive", str(path), "--latex"]).exit_code == 0
