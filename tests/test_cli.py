"""The command line: tables for people, JSON for programs, exit codes."""

import json
import math
import re
from pathlib import Path

import pytest
import typer.main
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app
from robots import ARM, joint, robot_xml


def run(*arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == code, result.output
    return result.stdout if code != 2 else result.stderr


def test_info_shows_coupling_closures_and_assumptions() -> None:
    text = run("info", "minervabot_v3")
    for part in ("q2_level", "- q2", "orientation", "r_1,27", "R_2,16"):
        assert part in text
    record = json.loads(run("info", "minervabot_v3", "--json"))
    assert record["coordinates"] == ["q1", "q2", "q3"]
    assert len(record["S"]) == len(record["joints"]) == 11
    assert max(closure["residual_bound"] for closure in record["closures"]) < 1e-12


def test_derive_shows_both_forms_where_they_differ() -> None:
    text = run("derive", "minervabot_v3")
    assert "coincident branched; ancestor link_2; depends on q3" in text
    assert "contact at q3 - q2 = 32.429119975 deg, every turn" in text
    blocks = text.split("\nbeta_")
    assert [("minimal frame" in block) for block in blocks] == [i in (3, 4, 5) for i in range(10)]
    record = {entry["name"]: entry for entry in json.loads(run("derive", "minervabot_v3", "--json"))}
    assert record["beta_5"]["coordinates"] == ["q3"]
    assert record["beta_5"]["expression"] != record["beta_5"]["expression_ancestor"]
    assert r"\sin" in run("derive", "minervabot_v3", "--latex")


@pytest.mark.parametrize("name", sorted(typer.main.get_command(app).commands))  # type: ignore[attr-defined]
def test_help_prints_what_it_says(name: str) -> None:
    """A unit in brackets was read as markup, and left out; every word of a help text is printed."""
    command = typer.main.get_command(app).commands[name]  # type: ignore[attr-defined]
    printed = "".join(re.sub(r"[^\x21-\x7e]", "", run(name, "--help")))
    texts = [command.help, *(one.help for one in command.params)]
    assert [text for text in texts if not text.rstrip().endswith((".", ".)"))] == []
    words = [word for text in texts for word in text.split() if len(word) < 12]
    assert [word for word in words if word not in printed] == []


def test_limits_at_home_and_in_contact() -> None:
    found = {entry["coordinate"]: entry for entry in json.loads(run("limits", "minervabot_v3", "--json"))}
    assert (found["q2"]["lower_stop"], found["q2"]["upper_stop"]) == ("beta_10", "beta_8")
    assert (found["q1"]["lower_stop"], found["q3"]["upper_stop"]) == ("q1", "beta_4")
    turned = json.loads(run("limits", "minervabot_v3", "--at", "q2=30,q3=20", "--deg", "--json"))
    assert turned[1]["value"] == pytest.approx(0.5235987755982988)
    assert "a contact of beta_10 is in between" in run("limits", "minervabot_v3", "--at", "q2=-0.3", code=1)
    assert json.loads(run("limits", "minervabot_v3", "--at", "q2=-0.3", "--json", code=1))[1]["beyond"] == ["beta_10"]
    assert "not allowed here" in run("limits", "minervabot_v3", "--at", "q1=3", code=1)


def test_region_names_its_edges() -> None:
    text = run("region", "minervabot_v3")
    assert "1.5434743997" in text
    assert "implied by" in text
    record = json.loads(run("region", "minervabot_v3", "--json", "--coordinates", "q2,q3"))
    assert [edge["name"] for edge in record["edges"]] == ["beta_7", "beta_3", "beta_4", "beta_10", "beta_9", "beta_8"]
    assert record["implied"]["beta_1"]["by"] == ["beta_4"]
    assert len(record["vertices"]) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("info", "nothing.urdf"), "neither a file nor a packaged robot"),
        (("limits", "minervabot_v3", "--at", "q9=1"), "q1, q2, q3"),
        (("limits", "minervabot_v3", "--at", "q2=nan"), "finite"),
        (("limits", "minervabot_v3", "--at", "q2=1_0"), "finite"),
        (("limits", "minervabot_v3", "--at", "q2=0.1,q2=0.2"), "'q2' is given twice"),
        (("region", "minervabot_v3", "--window", "q2=0..1,q2=0..0.5"), "'q2' is given twice"),
        (("info", "minervabot_v3", "--xacro-arg", "bridge=a", "--xacro-arg", "bridge=b"), "'bridge' is given twice"),
        (("region", "minervabot_v3", "--coordinates", "q2"), "two coordinates"),
        (("region", "minervabot_v3", "--at", "q2=-0.5"), "beta_10"),
        (("info", "minervabot_v3", "--xacro-arg", "bridge"), "NAME=VALUE"),
        (("info", "minervabot_v3", "--annotations", "none.yaml"), "none.yaml"),
        (("report", "minervabot_v3", "--frame", "link_9"), "link_6"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    extra = ("--out", str(tmp_path)) if arguments[0] == "report" else ()
    text = run(*arguments, *extra, code=2)
    assert message in text
    assert text.startswith("pinbound: ")
    assert "Traceback" not in text


def test_report_writes_a_page_with_its_figures(tmp_path: Path) -> None:
    text = run("report", "minervabot_v3", "--out", str(tmp_path / "deep" / "report"))
    assert "implied by beta_4" in text
    folder = tmp_path / "deep" / "report"
    assert (folder / "index.html").read_text().count("its marks are points without a surface") == 8
    assert {path.name for path in folder.iterdir()} == {
        "index.html",
        *(f"{name}.{kind}" for name in ("region", "workspace", "robot") for kind in ("svg", "png")),
    }
    page = (folder / "index.html").read_text(encoding="utf-8")
    for robot_fact in (*pb.load("minervabot_v3").boundaries.names, "1.5434743997", "r_1,27", "orientation", "<math"):
        assert robot_fact in page
    for name in ("region", "workspace", "robot"):
        assert f'src="{name}.svg"' in page
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_report_is_the_same_on_every_run(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run("report", "minervabot_v3", "--out", str(tmp_path / name))
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


def test_a_robot_without_boundaries_still_has_a_report(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text('<robot name="bare &lt;b&gt;"><link name="only"/></robot>')
    run("report", str(path), "--out", str(tmp_path / "out"))
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "No planar region" in page
    assert "<b>" not in page.split("<h2>")[0].replace("<li><b>", "").replace("bare &lt;b&gt;", "")


def marked_arm(folder: Path, **shapes: str) -> Path:
    """Write an arm whose links have the given shapes as collision bodies."""
    path = folder / "arm.urdf"
    text = robot_xml(ARM, {}, [])
    for link, shape in shapes.items():
        body = f"<collision><geometry>{shape}</geometry></collision>"
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{body}</link>')
    path.write_text(text)
    return path


def test_mark_writes_a_sidecar_that_loads(tmp_path: Path) -> None:
    out = tmp_path / "arm.pinbound.yaml"
    urdf = marked_arm(tmp_path, base='<sphere radius="0.05"/>', d='<box size="0.1 0.1 0.1"/>')
    said = run("mark", str(urdf), "--out", str(out))
    assert "Not covered" not in said
    assert len(pb.load(urdf).boundaries) == json.loads(run("mark", str(urdf), "--json"))["boundaries"] > 0
    assert "exists already" in run("mark", str(urdf), "--out", str(out), code=2)
    assert "sphere, box, cylinder, capsule" in run("mark", str(urdf), "--shapes", "cone", code=2)


def test_mark_says_last_what_it_left_out_and_exits_with_1(tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    urdf = marked_arm(
        tmp_path, base='<sphere radius="0.05"/>', d='<box size="0.1 0.1 0.1"/>', b='<mesh filename="x.stl"/>'
    )
    lines = run("mark", str(urdf), "--out", str(out), "--skip-missing", code=1).splitlines()
    assert lines[-2] == "Not covered: 1 body of b (1 mesh); no boundary watches it."
    assert lines[-1].startswith("1 of 3 bodies has no mark")
    assert len(pb.load(urdf, annotations=out).boundaries) == 1
    record = json.loads(run("mark", str(urdf), "--json", "--skip-missing", code=1))
    assert [(one["link"], one["shape"]) for one in record["uncovered"]] == [("b", "mesh")]
    assert ["base", "b"] in [one["links"] for one in record["left_out"]]
    meshes = marked_arm(tmp_path, base='<mesh filename="x.stl"/>', d='<mesh filename="y.stl"/>')
    assert "2 of 2 bodies have no mark" in run("mark", str(meshes), "--skip-missing", code=1).splitlines()[-1]
    run("mark", str(urdf), "--shapes", "box", code=1)
    assert "--skip-missing" in run("mark", str(urdf), code=2)


def test_mark_of_half_written_geometry_is_bad_input(tmp_path: Path) -> None:
    urdf = marked_arm(tmp_path, base="<sphere/>", b='<box size="1 1"/>')
    said = run("mark", str(urdf), code=2)
    assert "2 problems" in said
    assert "has no radius" in said
    assert "Traceback" not in said


def test_mark_says_which_home_it_proposes(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    balls = {
        name: f'<link name="{name}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
        for name in ("base", "c")
    }
    joints = [joint("j1", "revolute", "base", "a"), joint("j2", "prismatic", "a", "c", limit="0 0.5")]
    text = robot_xml(joints, {}, [])
    for name, ball in balls.items():
        text = text.replace(f'<link name="{name}"/>', ball)
    urdf.write_text(text)
    said = run("mark", str(urdf), "--out", str(tmp_path / "out.yaml"))
    assert "base.0 and c.0 overlap by 200 mm" in said
    home = pb.load(urdf, annotations=tmp_path / "out.yaml").home
    assert f"j1 = {math.degrees(home[0]):.6g} deg, j2 = {1e3 * home[1]:.6g} mm, with no pair in contact" in said


@pytest.mark.parametrize(
    "command",
    ["export minervabot_v3 json", "mark minervabot_v3", "plan minervabot_v3 --goal q2=0.1,q3=0.1", "new palletizer"],
)
def test_a_folder_that_is_not_there_is_made_and_a_file_in_its_place_is_told(command: str, tmp_path: Path) -> None:
    """`mark` looked for minutes, and then the folder of its sidecar was not there."""
    name = "" if command.startswith("new") else "out.csv"
    run(*command.split(), "--out", str(tmp_path / "not" / "there" / name))
    assert list((tmp_path / "not" / "there").iterdir())
    (tmp_path / "taken").write_text("mine")
    said = run(*command.split(), "--out", str(tmp_path / "taken" / name), code=2)
    assert "is a file, not a folder. Give another folder." in said
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_negative_seed_is_no_traceback() -> None:
    result = CliRunner().invoke(app, ["crosscheck", "minervabot_v3", "--seed", "-1"])
    assert (result.exit_code, "--seed" in result.output) == (2, True)
