"""Tables of coupled limits, read by readers of our own that interpolate as the formats say: all they accept is free."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import pinbound as pb
from pinbound.robot.table_formats import GRIDS
from robots import joint, robot_xml
from test_steps import robot_with


def from_skrobot(text: str) -> tuple[Any, Any, Any]:
    (one,) = yaml.safe_load(text)["joint_limit_tables"]
    assert (one["target_joint"], one["dependent_joint"]) == ("q2", "q3")
    count = len(one["min_angles"])
    return np.linspace(one["target_min_angle"], one["target_max_angle"], count), one["min_angles"], one["max_angles"]


def from_jskeus(text: str) -> tuple[Any, Any, Any]:
    body = "\n".join(line for line in text.splitlines() if not line.startswith(";"))
    assert ':joint-min-max-target "q2"' in body
    rows = re.search(r"#2f\(\((.*?)\)\)", body).group(1).split(") (")
    angles, lower, upper = (np.array([int(word) for word in row.split()]) for row in rows)
    return angles, lower, upper


def from_hrpsys(text: str) -> tuple[Any, Any, Any]:
    line = next(line for line in text.splitlines() if line.startswith("joint_limit_table: "))
    own, target, low, high, lower, upper = line.removeprefix("joint_limit_table: ").split(":")
    assert (own, target) == ("q3", "q2")
    return np.arange(int(low), int(high) + 1), *(np.array(x.split(","), dtype=float) for x in (lower, upper))


def from_csv(text: str) -> tuple[Any, Any, Any]:
    rows = np.array([line.split(",") for line in text.splitlines()[1:]], dtype=float)
    return rows[:, 0], rows[:, 1], rows[:, 2]


def from_json(text: str) -> tuple[Any, Any, Any]:
    said = json.loads(text)
    return tuple(np.degrees(said[key]) for key in ("angles", "lower", "upper"))


READERS = {"skrobot": from_skrobot, "jskeus": from_jskeus, "hrpsys": from_hrpsys, "csv": from_csv, "json": from_json}


@pytest.mark.parametrize("form", READERS)
def test_all_that_a_reader_accepts_is_free(form: str, minerva: pb.Robot) -> None:
    for grid in ("multiples", GRIDS[form]):
        table = pb.limit_table(minerva, "q2", "q3", whole=form == "jskeus", grid=grid)
        accepted_is_free(minerva, *READERS[form](table.text(form)))


@pytest.mark.parametrize("form", ["skrobot", "csv"])
@pytest.mark.parametrize("spacing", [1 / 3, 0.7])
def test_angles_are_printed_where_the_entries_are(form: str, spacing: float, minerva: pb.Robot) -> None:
    for grid in ("multiples", "fitted"):
        table = pb.limit_table(minerva, "q2", "q3", spacing=spacing, grid=grid)
        angles, lower, upper = READERS[form](table.text(form))
        assert np.abs(np.radians(angles) - table.angles).max() < 1e-13
        accepted_is_free(minerva, angles, lower, upper)


def test_the_call_without_options_loses_nothing_and_readers_of_equal_spacing_take_it(minerva: pb.Robot) -> None:
    table = pb.limit_table(minerva, "q2", "q3")
    assert np.degrees(table.loss) < 1e-6
    for form in ("skrobot", "csv", "json"):
        accepted_is_free(minerva, *READERS[form](table.text(form)))
    for form in ("jskeus", "hrpsys"):  # which hold whole degrees: what they take is said, and taken
        whole = pb.limit_table(minerva, "q2", "q3", whole=form == "jskeus", grid="multiples", spacing=1)
        accepted_is_free(minerva, *READERS[form](whole.text(form)))
        with pytest.raises(pb.UnsupportedError, match="whole=True" if form == "jskeus" else "grid='multiples'"):
            table.text(form)
    accepted_is_free(minerva, *READERS["jskeus"](pb.limit_table(minerva, "q2", "q3", whole=True).text("jskeus")))
    with pytest.raises(pb.UnsupportedError, match="grid='multiples' and spacing=1"):
        pb.limit_table(minerva, "q2", "q3", whole=True, spacing=0.5).text("jskeus")


def test_one_entry_is_a_table_of_equal_spacing() -> None:
    joints = [
        joint("q2", "revolute", "base", "l1", xyz="0 0 1", limit="-0.001 0.001"),
        joint("q3", "revolute", "l1", "l2", xyz="0 0 1", limit="-2 2"),
    ]
    table = pb.limit_table(pb.load(robot_xml(joints, {}, [])), "q2", "q3", grid="multiples")
    assert len(table.angles) == 1
    assert from_skrobot(table.text("skrobot"))[0].tolist() == [0.0]


def accepted_is_free(minerva: pb.Robot, angles: Any, lower: Any, upper: Any) -> None:
    """Sample what a reader accepts who interpolates, most of it at the very limits."""
    rng = np.random.default_rng(0)
    q2 = np.concatenate((rng.uniform(angles[0], angles[-1], 20000), angles))
    ends = np.interp(q2, angles, lower), np.interp(q2, angles, upper)
    share = rng.choice([0.0, 1.0, 0.5, 1e-9, 1 - 1e-9], len(q2))
    q3 = np.clip(ends[0] + share * (ends[1] - ends[0]), *ends)
    Q = np.radians(np.stack((np.zeros_like(q2), q2, q3), axis=1))
    assert np.all(minerva.boundaries.free(Q))


def test_what_is_lost_is_what_is_said(minerva: pb.Robot) -> None:
    whole: dict[str, Any] = {"grid": "multiples"}
    for options, most in ((whole, 0.25), ({"whole": True}, 1.5), (whole | {"spacing": 0.25}, 0.07)):
        table = pb.limit_table(minerva, "q2", "q3", **options)
        q2 = np.linspace(table.angles[0], table.angles[-1], 8001)
        lower, upper = (np.interp(q2, table.angles, ends) for ends in (table.lower, table.upper))
        true, _ = minerva.boundaries.limits_table(
            "q3", np.stack((np.zeros_like(q2), q2, 0.5 * (lower + upper)), axis=1)
        )
        lost = np.maximum(lower - true[:, 0], true[:, 1] - upper)
        assert lost.min() > 0.0
        assert np.degrees(lost.max()) <= np.degrees(table.loss) + 1e-9
        assert np.degrees(lost.max()) >= 0.9 * np.degrees(table.loss)
        assert np.degrees(table.loss) < most


def test_corners_fall_on_entries_where_a_format_allows_it(minerva: pb.Robot) -> None:
    """At 1 degree nearly nothing is lost; entries at whole degrees cannot lose less than they do."""
    corners = np.array([np.degrees(x) for x, _ in pb.feasible_region(minerva, ("q2", "q3")).vertices])
    corners = corners[(corners > -10.0) & (corners < 70.0)]
    assert len(corners) == 2
    for form in ("skrobot", "csv", "json"):
        table = pb.limit_table(minerva, "q2", "q3", grid=GRIDS[form])
        assert np.degrees(table.loss) < 1e-3
        angles = READERS[form](table.text(form))[0]
        assert np.diff(angles).max() <= 1.0 + 1e-9
        assert all(np.abs(angles - corner).min() < 1e-9 for corner in corners)
    assert len(angles) >= 81
    with pytest.raises(pb.UnsupportedError, match="grid='fitted'"):
        table.text("skrobot")
    with pytest.raises(pb.UnsupportedError, match="spacing=1"):
        table.text("hrpsys")
    with pytest.raises(pb.UnknownNameError, match="grid"):
        pb.limit_table(minerva, "q2", "q3", grid="corner")
    # Any sound table at whole degrees: its entries are within the limits, so that it is below the chord at a corner.
    whole = pb.limit_table(minerva, "q2", "q3", grid="multiples")
    lost = []
    for corner in np.radians(corners):
        at = [np.radians(np.floor(np.degrees(corner))), corner, np.radians(np.ceil(np.degrees(corner)))]
        middle = [np.interp(x, whole.angles, 0.5 * (whole.lower + whole.upper)) for x in at]
        true, _ = minerva.boundaries.limits_table("q3", np.stack((np.zeros(3), at, middle), axis=1))
        share = (corner - at[0]) / (at[2] - at[0])
        chords = (1.0 - share) * true[0] + share * true[2]
        lost.append(max(chords[0] - true[1, 0], true[1, 1] - chords[1]))
    assert whole.loss == pytest.approx(max(lost), abs=1e-8)


@pytest.mark.parametrize("spacing", [1.0, 15.0, 60.0])
def test_no_entry_is_where_the_target_alone_is_in_contact(spacing: float) -> None:
    """Contact is at a whole multiple of the spacing; an angle a limit ends at is kept, for limits are closed."""
    joints = [
        joint("a", "revolute", "base", "l1", xyz="0 0 1", limit=f"-2.5 {math.radians(45.0)!r}"),
        joint("b", "revolute", "l1", "l2", xyz="0 0 1", limit="-2 2"),
    ]
    ends = [
        pb.Point("p", "base", (0.0, 0.0, 2.0)),
        pb.Point("s", "l1", (0.0, 0.0, -1.0), 2.0 * math.sin(math.pi / 3.0)),
    ]
    marks = pb.Annotations.of(ends, [pb.BoundaryMark("front", "p", "s")])
    robot = pb.load(robot_xml(joints, {}, [])).with_annotations(marks)
    assert not robot.boundaries.free(np.array([np.radians(-60.0), 0.0]))
    for grid in ("multiples", "fitted", "corners"):
        table = pb.limit_table(robot, "a", "b", spacing=spacing, grid=grid)
        for angles in (table.angles, np.radians(table.in_degrees()[0])):
            Q = np.stack((angles, 0.5 * (table.lower + table.upper)), axis=1)
            assert np.all(robot.boundaries.free(Q))
        assert np.degrees(table.angles[0]) == pytest.approx(-60.0, abs=1e-6 if grid == "corners" else spacing + 1e-9)
    whole = pb.limit_table(robot, "a", "b", spacing=15.0, grid="multiples")
    assert np.degrees(whole.angles).round(9).tolist() == [-45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0]


def test_a_table_without_corners_and_one_with_corners_side_by_side() -> None:
    joints = [
        joint("a", "revolute", "base", "l1", xyz="0 0 1", limit="-1 1"),
        joint("b", "revolute", "l1", "l2", xyz="0 0 1", limit="-2 2"),
    ]
    robot = pb.load(robot_xml(joints, {}, []))
    for grid in ("fitted", "corners"):
        table = pb.limit_table(robot, "a", "b", grid=grid)
        assert np.allclose(table.upper, 2.0, atol=1e-8)
        assert table.loss < 1e-8
    rules = tuple(pb.Rule(f"r{k}", {"a": c, "b": 1.0}, upper=u) for k, (c, u) in enumerate([(1.0, 1.5), (1.0001, 1.5)]))
    some = robot.with_annotations(pb.Annotations.of([], [], rules=rules))
    table = pb.limit_table(some, "a", "b", grid="fitted")  # a corner at 0, of slopes that hardly differ
    assert len(table.angles) < 200
    assert np.degrees(table.loss) < 0.01


def test_targets_beyond_the_entries_are_said(minerva: pb.Robot) -> None:
    table = pb.limit_table(minerva, "q2", "q3", grid="multiples")
    region = pb.feasible_region(minerva, ("q2", "q3"))
    assert np.allclose(table.target_range, (region.vertices[:, 0].min(), region.vertices[:, 0].max()), atol=1e-9)
    assert "keep 'q2' within -10 deg .. 70 deg" in table.notes[0]
    assert table.target_range[0] < table.angles[0]
    assert table.angles[-1] < table.target_range[1]
    some = pb.limit_table(minerva, "q2", "q3", boundaries=["beta_3", "beta_9"])
    assert "not kept by this table: beta_1, beta_2" in some.notes[1]


def test_a_mimic_joints_limit_is_in_the_table() -> None:
    joints = [
        joint("a", "revolute", "base", "l1", xyz="0 0 1", limit="-1 1"),
        joint("b", "revolute", "l1", "l2", xyz="0 0 1", limit="-2 2"),
        joint("c", "revolute", "l2", "l3", xyz="0 0 1", limit="-0.5 0.5", mimic="b 0.5 0.1"),
    ]
    table = pb.limit_table(pb.load(robot_xml(joints, {}, [])), "a", "b")
    assert np.allclose(np.radians(table.in_degrees()[1]), -1.2, atol=1e-7)
    assert np.allclose(np.radians(table.in_degrees()[2]), 0.8, atol=1e-7)


def test_what_a_table_cannot_say_is_refused(minerva: pb.Robot) -> None:
    arm = robot_with(["spheres"])
    for robot, names, options, said in (
        (arm, ("a", "b"), {}, "several effective angles"),
        (arm, ("a", "c"), {}, "'c' is prismatic"),
        (arm, ("a", "d"), {"boundaries": []}, "nothing limits 'd'"),
        (minerva, ("q2", "q2"), {}, "name two joints"),
        (minerva, ("q2", "q9"), {}, "q9"),
        (minerva, ("q2", "q3"), {"spacing": 0.0}, "spacing"),
        (minerva, ("q1", "q3"), {}, "also depends on 'q2'"),
    ):
        with pytest.raises(pb.PinboundError, match=said):
            pb.limit_table(robot, *names, **options)
    with pytest.raises(pb.UnsupportedError, match="whole=True"):
        pb.limit_table(minerva, "q2", "q3").text("jskeus")
    with pytest.raises(pb.UnsupportedError, match="spacing=1"):
        pb.limit_table(minerva, "q2", "q3", spacing=0.5).text("hrpsys")
    with pytest.raises(pb.UnknownNameError, match="format"):
        pb.limit_table(minerva, "q2", "q3").text("xls")


def test_the_command_writes_all_kinds(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from pinbound.cli import app

    runner = CliRunner()

    def run(*words: str) -> Any:
        return runner.invoke(app, ["export", "minervabot_v3", *words])

    assert run("c", "--out", str(tmp_path / "arm.c")).exit_code == 0
    assert (tmp_path / "arm.h").is_file()
    assert run("json", "--out", str(tmp_path / "arm.json"), "--boundary", "beta_4").exit_code == 0
    assert len(json.loads((tmp_path / "arm.json").read_text())["boundaries"]) == 1
    done = run("table", "--out", str(tmp_path / "t.yaml"), "--format", "skrobot", "--target", "q2", "--dependent", "q3")
    assert done.exit_code == 0
    low, high = map(float, re.search(r"Note: keep 'q2' within (\S+) deg .. (\S+) deg", done.stdout).groups())
    assert -10.146 <= low < -9.5
    assert 69.5 < high <= 70.001
    done = run("table", "--out", str(tmp_path / "t.txt"), "--format", "hrpsys", "--target", "q2", "--dependent", "q3")
    assert "Note: keep 'q2' within -10 deg .. 70 deg" in done.stdout
    said = json.loads(run("c", "--out", str(tmp_path / "arm.c"), "--json").stdout)
    assert said["files"] == [str(tmp_path / "arm.c"), str(tmp_path / "arm.h")]
    assert run("table", "--out", str(tmp_path / "t.yaml")).exit_code == 2
    assert run("fortran", "--out", str(tmp_path / "t.f")).exit_code == 2
