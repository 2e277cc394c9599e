"""Palletizers of published numbers: the family's xacro, presets, what is not known, and the command line."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli.app import app
from pinbound.robot.presets import models

PRESETS = {model.name: model for model in models() if model.name is not None}
LOOPS = {"drive": "0.41", "level_x": "-0.3", "level_z": "0.17", "forward_x": "0.21", "forward_z": "0.3"}
FAMILY = {
    "as_it_is": {},
    "up_and_ahead": {"forearm_sign": "-1", "drive_side": "1", "forearm_zero": "0.3", "arm_zero": "0.2"},
    "elbow_above": {"elbow_up": "0.26", "forearm_sign": "-1"},
    "relative": {
        "third_axis": "relative",
        "drive": "0",
        "arm_zero": "1.5707963267948966",
        "j2_lower": "-2.1",
        "j2_upper": "0.2",
        "j3_lower": "-0.2",
        "j3_upper": "2.6",
    },
}
LENGTHS = {"shoulder_x": 0.3, "shoulder_z": 1.05, "arm": 1.17, "forearm": 1.31, "flange_x": 0.27, "flange_drop": 0.19}


def flange(q: np.ndarray, given: dict[str, str], lengths: dict[str, float]) -> np.ndarray:
    """Return (x, z) of the flange by the level-wrist formula, written down by hand."""
    lean = float(given.get("arm_zero", 0)) + q[1]
    turned = float(given.get("forearm_sign", 1)) * q[2]
    up = float(given.get("forearm_zero", 0)) - turned
    if given.get("third_axis") == "relative":
        up += math.pi / 2 - lean
    x = lengths["shoulder_x"] + lengths["arm"] * math.sin(lean) + lengths["forearm"] * math.cos(up)
    z = lengths["shoulder_z"] + lengths["arm"] * math.cos(lean) + lengths["forearm"] * math.sin(up)
    z += float(given.get("elbow_up", 0)) - lengths["flange_drop"]
    return np.array([x + lengths["flange_x"], z])


@pytest.mark.parametrize("name", FAMILY)
def test_every_member_of_the_family_closes_and_keeps_its_flange_level(name: str) -> None:
    """Each loop is proven; the flange is where the formula says; its plate never tilts; no length is written twice."""
    given = LOOPS | FAMILY[name]
    robot = pb.load("palletizer", xacro_args=given | {key: repr(value) for key, value in LENGTHS.items()})
    loops = ["orientation", "forward"] if name == "relative" else ["drive", "orientation", "forward"]
    assert [closure.name for closure in robot.closures] == loops
    assert all(closure.is_exact for closure in robot.closures)
    Q = np.random.default_rng(0).uniform(-1, 1, (8, 4)) * [0, 1, 1, 1]
    assert robot.closure_residuals(Q).max() < 1e-14
    for q in Q:
        x, _, z = robot.positions("flange", q)
        np.testing.assert_allclose([x, z], flange(q, given, LENGTHS), rtol=0, atol=1e-14)
        below = robot.positions("flange", q, (0, 0, -0.1)) - robot.positions("flange", q)
        np.testing.assert_allclose(below, [0, 0, -0.1], rtol=0, atol=1e-14)
    assert {"forearm_floor", "forearm_column", "flange_floor"} <= set(robot.boundaries.names)


@pytest.mark.parametrize("loops", [(), ("drive",), ("drive", "level_x", "level_z")])
def test_none_one_and_two_parallelograms(loops: tuple[str, ...]) -> None:
    given = dict.fromkeys(LOOPS, "0") | {name: LOOPS[name] for name in loops}
    robot = pb.load("palletizer", xacro_args=given)
    assert [c.name for c in robot.closures] == [
        n for n, k in (("drive", "drive"), ("orientation", "level_x")) if k in loops
    ]


def test_widths_that_are_not_known_have_no_body_and_no_boundary() -> None:
    widths: dict[str, str] = dict.fromkeys(("arm_width", "forearm_width", "column_width", "flange_width"), "0")
    robot = pb.load("palletizer", xacro_args=widths)
    assert robot.boundaries.names == ()
    robot = pb.load("palletizer", xacro_args=widths | {"flange_width": "0.2"})
    assert robot.boundaries.names == ("flange_floor",)


@pytest.mark.parametrize("given", [{"third_axis": "sideways"}, {"third_axis": "relative"}])
def test_what_cannot_be_built_is_refused(given: dict[str, str]) -> None:
    with pytest.raises(pb.InputError, match=r"palletizer: (third_axis is|with a relative)"):
        pb.load("palletizer", xacro_args=given)


def test_rods_are_as_wide_as_they_are_said_to_be() -> None:
    robot = pb.load("palletizer", xacro_args={"rod_width": "0.07"})
    for rod in ("drive_rod", "orientation_rod", "forward_rod"):
        boxes = robot.document.root.xpath(f"link[@name='{rod}']/collision/geometry/box/@size")
        assert [size.split()[1:] for size in map(str, boxes)] == [["0.07", "0.07"]]


def test_the_corners_of_the_working_range_of_m410ib_700() -> None:
    """Ten corner points of the maker's drawing, within 0.7 mm of 3143 mm reach."""
    model = PRESETS["palletizers/fanuc_m410ib_700"]
    robot = pb.load("palletizers/fanuc_m410ib_700")
    assert len(model.facts["corners"]) == 10
    for arm, fore, x, z in model.facts["corners"]:
        at = 1e3 * robot.positions("flange", [0, math.radians(arm), math.radians(fore), 0])
        assert abs(at[0] - x) < 0.7
        assert abs(at[2] - z) < 0.7


@pytest.mark.parametrize(
    ("name", "square_degrees"),
    [
        ("palletizers/fanuc_m410ib_700", 144 * 136 - 35**2 / 2 - 100**2 / 2),
        ("palletizers/kuka_kr_700_pa", 130 * 160),
        ("palletizers/dobot_mg400", 110 * 130 * 19 / 26),
        ("palletizers/comau_pal_260_31", 144 * 140 - 57**2 / 2),
    ],
)
def test_regions_of_presets(name: str, square_degrees: float) -> None:
    robot = pb.load(name)
    assert robot.name == name.split("/")[1]
    region = pb.feasible_region(robot, ("J2", "J3"))
    assert math.degrees(math.degrees(region.area)) == pytest.approx(square_degrees, abs=1e-8)


def test_reaches_that_no_rule_was_fitted_to() -> None:
    """KR 700 PA stretched reaches 3320 mm; CP180L with the arm level, 3255 mm; both published."""
    for name, degrees in (("kuka_kr_700_pa", (0, 0)), ("kawasaki_cp180l", (90, 0))):
        robot = pb.load(f"palletizers/{name}")
        x = 1e3 * robot.positions("flange", [0, *np.radians(degrees), 0])[0]
        assert x == pytest.approx(PRESETS[f"palletizers/{name}"].facts["reach_mm"], abs=1e-9)


def test_what_is_not_published_is_said_until_it_is_given() -> None:
    robot = pb.load("palletizers/gsk_rmd08")
    said = " ".join(robot.annotations.assumptions)
    assert "the range of J2 is not known" in said
    assert "no rule between J2 and J3 is known" in said
    assert "widths of bodies are not published" in said
    assert "sign of J3 is not published" in " ".join(pb.load("palletizers/kawasaki_cp180l").annotations.assumptions)
    assert robot.upper[1] == math.pi
    given = {"j2_lower": -0.6, "j2_upper": 1.4, "drive": 0.2}
    robot = pb.load("palletizers/gsk_rmd08", xacro_args=given)
    said = " ".join(robot.annotations.assumptions)
    assert "range of J2" not in said
    assert "range of J3 is not known" in said
    assert "crank" not in said
    assert (robot.lower[1], robot.upper[1]) == (-0.6, 1.4)
    assert [closure.name for closure in robot.closures] == ["drive"]


def test_annotations_add_to_a_preset() -> None:
    more = pb.Annotations(rules=(pb.Rule("cell", {"J2": 1.0}, upper=1.0),))
    robot = pb.load("palletizers/fanuc_m410ib_700", annotations=more)
    assert [rule.name for rule in robot.annotations.rules] == ["coupling", "cell"]


def test_the_table_has_33_models_and_no_number_without_a_source() -> None:
    assert sum(model.facts["in_table"] for model in models()) == 33
    for model in PRESETS.values():
        assert model.sources["lengths_mm"]
        assert not model.facts["ranges_deg"] or model.sources["ranges_deg"]
        assert all(rule["basis"] for rule in model.facts["rules"])
    with pytest.raises(pb.UnknownNameError, match="palletizers/abb_irb_760"):
        pb.load("palletizers/abb_irb_670")


def test_the_command_line_lists_robots_and_writes_a_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner = CliRunner()
    found = json.loads(runner.invoke(app, ["robots", "--json"]).stdout)
    assert found["robots"] == ["minervabot_v3", "palletizer"]
    assert {one["name"]: one["confidence"] for one in found["presets"]} == {n: m.confidence for n, m in PRESETS.items()}
    text = runner.invoke(app, ["robots"]).stdout
    assert "palletizers/fanuc_m410ib_700" in text
    assert "read from the corner points" in " ".join(text.split())
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    assert runner.invoke(app, ["new", "palletizer", "--out", str(tmp_path / "mine")]).exit_code == 0
    robot = pb.load(tmp_path / "mine" / "my_palletizer.urdf.xacro")
    assert [closure.name for closure in robot.closures] == ["drive", "orientation", "forward"]
    assert len(robot.boundaries) == 4
    there = runner.invoke(app, ["new", "palletizer", "--out", str(tmp_path / "mine")])
    assert there.exit_code == 2
    assert "is there already" in there.stderr
    assert runner.invoke(app, ["new", "scara", "--out", str(tmp_path)]).exit_code == 2


def test_check_and_region_repeat_what_a_preset_does_not_know(tmp_path: Path) -> None:
    runner, name = CliRunner(), "palletizers/fanuc_m410ib_700"
    robot = pb.load(name)
    known = list(robot.annotations.assumptions)
    assert known
    motion = tmp_path / "motion.csv"
    motion.write_text("\n".join([",".join(robot.coordinates), *[",".join(map(str, robot.home))] * 2]) + "\n")
    for words in (["region", name, "--coordinates", "J2,J3"], ["check", name, str(motion), "--limits-only"]):
        said = runner.invoke(app, words).stdout
        assert all(f"assumption: {one}" in said for one in known)
        assert json.loads(runner.invoke(app, [*words, "--json"]).stdout)["assumptions"] == known


def test_the_inner_boundary_of_m410ib_700_can_be_marked_as_the_page_says(tmp_path: Path) -> None:
    """Its corners with the rule and with the range of J3 are those of the drawing: (1065, 1278) and (1065, 666) mm."""
    page = (Path(__file__).parents[1] / "docs" / "palletizers.md").read_text(encoding="utf-8")
    (tmp_path / "inner.yaml").write_text(re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)[-1])
    robot = pb.load("palletizers/fanuc_m410ib_700", annotations=tmp_path / "inner.yaml")
    region = pb.feasible_region(robot, ("J2", "J3"))
    edge = next(one for one in region.edges if one.name == "inner_boundary")
    ends = np.array([edge.start, edge.end])
    places = [1e3 * robot.positions("flange", [0.0, *end, 0.0])[[0, 2]] for end in ends]
    np.testing.assert_allclose(sorted(places, key=lambda at: -at[1]), [[1065, 1278], [1065, 666]], rtol=0, atol=0.7)
