"""The reproduction: printed facts judged, errata computed, and a page whose every link is there."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from lxml import etree
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app
from pinbound.region.membership import Place
from pinbound.reproduce import Reproduction, reproduce_paper
from pinbound.reproduce.drawing import solids
from pinbound.reproduce.equations import check_equations
from pinbound.reproduce.errata import find_errata
from pinbound.reproduce.four_kinds import write_four_kinds
from pinbound.reproduce.judged import JudgedLimit, derived_limit, judge_limits
from pinbound.reproduce.printed import BOUNDARIES, LIMITS, constants
from pinbound.reproduce.study import Study
from robots import joint, robot_xml

PAPER = Path(__file__).parents[2] / "shared" / "paper" / "paper.txt"


@pytest.fixture(scope="module")
def study(minerva: pb.Robot) -> Study:
    return Study(minerva)


@pytest.fixture(scope="module")
def judged(study: Study) -> tuple[JudgedLimit, ...]:
    return judge_limits(study.robot, study.constants, np.radians(25.0))


@pytest.fixture(scope="module")
def written(minerva: pb.Robot, tmp_path_factory: pytest.TempPathFactory) -> Reproduction:
    return reproduce_paper(minerva, tmp_path_factory.mktemp("reproduction"))


def test_fifteen_of_sixteen_limits_solve_their_equation_and_nine_fail_with_one_argument(
    judged: tuple[JudgedLimit, ...],
) -> None:
    wrong = [one for one in judged if not one.solves]
    assert [(one.limit.equation, one.limit.line, one.limit.boundary, one.limit.component) for one in wrong] == [
        (19, 5, 10, 1)
    ]
    assert wrong[0].mended == 0
    assert sum(not one.solves_with_one_argument for one in judged) == 9
    assert min(one.residual for one in wrong) > 1e-2
    assert max(one.residual for one in judged if one.solves) < 1e-15


def test_the_right_limits_have_a_branch_at_the_contact(judged: tuple[JudgedLimit, ...]) -> None:
    """Within what lengths rounded to 0.01 mm allow; the wrong line misses by far."""
    for one in judged:
        assert abs(np.degrees(one.difference)) < (0.1 if one.solves else 360.0)
        if not one.solves:
            assert abs(np.degrees(one.difference)) > 10.0


def test_derived_limits_are_contacts(study: Study) -> None:
    for limit in LIMITS:
        boundary = study.robot.boundaries[f"beta_{limit.boundary}"]
        for other in (-0.4, 0.0, 1.1):
            own = derived_limit(boundary, limit.joint, other)
            q2, q3 = (own, other) if limit.joint == "q2" else (other, own)
            assert boundary.norm([0.3, q2, q3]) == pytest.approx(boundary.contact.smallest, abs=1e-12)


def test_a_wrong_component_would_be_noticed(study: Study) -> None:
    """Judge a line by the equation of another component: it must fail."""
    k = dict(study.constants)
    k["x_2,7"] += 0.05
    moved = judge_limits(study.robot, k, 0.4)
    assert moved[0].solves  # consistent with its own lengths ...
    assert abs(moved[0].difference) > 10 * abs(judge_limits(study.robot, study.constants, 0.4)[0].difference)


@pytest.mark.skipif(not PAPER.is_file(), reason="the paper's text is not beside the checkout")
def test_quoted_lengths_are_in_the_papers_text() -> None:
    text = PAPER.read_text().replace("\u2212", "-")
    for name, value in constants((0.0, 0.0)).items():
        axis, _, points = name.partition("_")
        if points in ("1,13", "1,27", "2,3", "3,4"):
            continue  # not printed, or in Table 3
        found = re.search(re.escape(f"{axis}_{{{points}}}") + r" = (-?[\d.]+)", text)
        assert found is not None, name
        assert float(found[1]) == value


def test_every_erratum_is_confirmed(study: Study, judged: tuple[JudgedLimit, ...]) -> None:
    errata = find_errata(study, judged)
    assert [one.number for one in errata] == list(range(1, 11))
    assert all(one.holds for one in errata)
    numbers = {one.number: one.numbers for one in errata}
    assert numbers[2]["beta_5 contact as printed, q2 [deg]"] == pytest.approx(26.090547, abs=1e-6)
    assert numbers[2]["beta_5 contact level, q3 [deg]"] == pytest.approx(-26.090547340, abs=1e-9)
    assert numbers[2]["beta_6 contact level, q3 [deg]"] == pytest.approx(71.143173065, abs=1e-9)
    assert numbers[3]["smallest norm as printed [mm]"] > 30.0
    assert numbers[5]["points of the tool path not seen"] > 0
    assert numbers[1]["signed distance of wrong sign"] == 0


def test_an_erratum_that_is_mended_is_no_longer_confirmed(as_printed: pb.Robot) -> None:
    """With the printed bridge beta_5 is no stop of q3: erratum 2 must not be confirmed blindly."""
    other = Study(as_printed)
    errata = find_errata(other, judge_limits(as_printed, other.constants, 0.4))
    assert not errata[1].holds


def test_equations_hold_and_all_four_kinds_are_checked(study: Study, tmp_path: Path) -> None:
    rows = check_equations(study, write_four_kinds(tmp_path))
    assert [one.number for one in rows if not one.agrees] == ["(17)"]
    assert next(one for one in rows if not one.agrees).checked_on == "beta_5, beta_6"
    assert all(one.checked_on for one in rows)


def test_equation_17_agrees_with_the_bridge_as_printed(as_printed: pb.Robot, tmp_path: Path) -> None:
    rows = check_equations(Study(as_printed), write_four_kinds(tmp_path))
    assert all(one.agrees for one in rows)


def test_the_tool_path_is_reached_and_leaves_the_region_on_purpose(study: Study) -> None:
    path = study.path
    assert path.solution.reached.all()
    tools = study.robot.positions("link_6", path.solution.q)
    assert np.abs(tools - path.targets).max() < 1e-10
    assert np.abs(np.diff(path.solution.q, axis=0)).max() < np.radians(8.0)  # one branch, no jump
    assert {Place(value) for value in path.place} == {Place.INSIDE, Place.ON, Place.OUTSIDE}
    assert np.sum(path.in_region < 0) > 20
    norms = study.robot.boundaries.norms(path.solution.q)
    assert np.all(norms > 0)  # the unsigned norms never say so


def test_samples_are_ninety_thousand_and_reproducible(study: Study) -> None:
    X, norms, inside = study.samples
    assert X.shape == (90_000, 2)
    assert norms.shape == (90_000, 10)
    share = study.region.area / (4 * np.pi) ** 2
    assert abs(inside.mean() - share) < 4 * np.sqrt(share / len(X))


def test_solids_stand_where_the_links_are(study: Study) -> None:
    """Every solid of the wrist stays level, and follows its link."""
    q = np.array([0.4, 0.7, 0.5])
    here, home = solids(study.robot, q), solids(study.robot, np.zeros(3))
    assert len(here) == len(home) > 10
    assert all(mesh.is_watertight for mesh, _ in here)
    volumes = [mesh.volume for mesh, _ in here]
    assert volumes == pytest.approx([mesh.volume for mesh, _ in home], rel=1e-9)
    lowest = min(mesh.bounds[0, 2] for mesh, _ in home)
    assert lowest == pytest.approx(0.0, abs=1e-6)


def test_everything_that_the_page_names_is_there(written: Reproduction) -> None:
    page = written.page.read_text(encoding="utf-8")
    root = etree.HTML(page)
    targets = {*root.xpath("//img/@src"), *root.xpath("//a/@href")}
    local = {target for target in targets if not target.startswith(("http", "#"))}
    assert len(local) > 30
    for target in local:
        file = written.page.parent / target
        assert file.stat().st_size > 500, target
    ids = set(root.xpath("//*/@id"))
    assert {target[1:] for target in targets if target.startswith("#")} <= ids
    for number in range(8, 23):
        assert f"figure-{number}" in ids
    text = " ".join(root.itertext())
    for label in ("Table 3", "Table 14", "(12)-(14)", "Eqs. (18)", "Eq. (21)", "13787.57", "1.014810e+07"):
        assert label in text
    assert len(root.xpath("//section")) == len(written.errata) == 10
    assert len(root.xpath("//math")) >= 38


def test_page_and_files_name_nothing_of_this_machine(written: Reproduction) -> None:
    folder = str(written.page.parent)
    for file in (written.page, *written.files):
        if file.suffix in (".html", ".json", ".csv", ".svg", ".urdf", ".geojson"):
            assert folder not in file.read_text(encoding="utf-8")


def test_files_hold_what_they_say(written: Reproduction, study: Study) -> None:
    folder = written.page.parent
    record = json.loads((folder / "results.json").read_text())
    assert len(record["errata"]) == 10
    assert {one["label"] for one in record["tables"]} >= {f"Table {number}" for number in range(3, 15)}
    for name in ("swept_body.ply", "swept_body.stl"):
        mesh = trimesh.load(folder / name, force="mesh")
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(study.body.volume.value, rel=5e-3)
    data = np.genfromtxt(folder / "tool_path.csv", delimiter=",", names=True)
    assert np.array_equal(data["place"], study.path.place)
    assert data["signed_distance"] == pytest.approx(study.path.membership.signed_distance, abs=1e-9)


def test_command_line(written: Reproduction, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it prints; the figures were drawn once, for `written`, and are not drawn again."""
    asked = []

    def stand_in(robot: pb.Robot, out: Path, progress: object) -> Reproduction:
        asked.append((robot.name, out))
        return written

    monkeypatch.setattr("pinbound.reproduce.reproduce_paper", stand_in)
    result = CliRunner().invoke(app, ["reproduce", "--out", "somewhere"])
    assert result.exit_code == 0, result.output
    assert asked == [("minervabot_v3", Path("somewhere"))]
    assert "15 of 16" in result.output
    assert all(f"Table {number} " in result.output for number in range(3, 15))
    assert result.output.count(" yes ") == 10


def test_another_robot_is_refused_with_what_it_lacks(tmp_path: Path) -> None:
    path = tmp_path / "other.urdf"
    path.write_text(robot_xml([joint("q1", "revolute", "base", "a")], {}, []))
    result = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path / "out"), "--robot", str(path)])
    assert result.exit_code == 2
    assert "not the paper's robot" in result.output
    assert not (tmp_path / "out").exists()


def test_boundaries_are_the_tables(study: Study) -> None:
    for printed in BOUNDARIES:
        assert study.robot.boundaries[printed.name].kind.value == printed.kind
