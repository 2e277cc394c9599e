"""Names are data: whatever they hold, they are printed as they are, run nothing, and are refused if unseen."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from lxml import etree
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli.app import app
from pinbound.exceptions import Problem, printable
from pinbound.figures.motion_figure import draw_motion
from pinbound.figures.plots import draw_region, draw_robot
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
RUN = CliRunner()
NAMES = [
    "wrist[left]",
    "tool[/mount]",
    "[bold red]x",
    ":smile:",
    "<img src=x onerror=alert(1)>",
    "a&b;\"c'",
    r"$\frac{1}$",
]
NAMES += [
    r"\input{/etc/hosts}",
    "q_{1}^2",
    "100%",
    "${9**9}",
    "{{7*7}}",
    "'; drop table",
    "-rf",
    "é ß ñ",
    "a\\b",
    "$(arg x)",
]


def planar(first: str, second: str, tmp_path: Path) -> Path:
    """Write an arm of two joints whose joints, links, marks and boundary have the names."""
    a, b = (quoteattr(f"{name}") for name in (first, second))
    text = robot_xml(
        [
            joint("J1", "revolute", "base", "L1", xyz="0 0 0.1", limit="-1.5 1.5"),
            joint("J2", "revolute", "L1", "L2", xyz="0 0 0.4", limit="-2.5 2.5"),
        ],
        {"P": ("base", "0.3 0 0.1"), "S": ("L2", "0 0 0.35")},
        [],
        '<pinbound:boundary name="B" a="P" b="S" min_distance="0.05"/>',
    )
    for old, new in {'"J1"': a, '"L1"': a, '"P"': a, '"J2"': b, '"L2"': b, '"S"': b, '"B"': b}.items():
        text = text.replace(old, new)
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", NAMES)
def test_tables_print_names_as_they_are(tmp_path: Path, name: str) -> None:
    path = planar(name, name + ".2", tmp_path)
    at = [] if "," in name or "=" in name else ["--coordinates", f"{name},{name}.2"]
    for command in (["info"], ["derive"], ["limits"], ["region", *at]):
        done = RUN.invoke(app, [*command, str(path)])
        assert done.exit_code in (0, 1), (command, done.output, done.exception)
        assert done.exception is None or isinstance(done.exception, SystemExit)
        assert name in re.sub(r"\s+", " ", done.output), command
    found = json.loads(RUN.invoke(app, ["info", str(path), "--json"]).output)
    assert found["coordinates"] == [name, name + ".2"]


@pytest.mark.parametrize("name", NAMES)
def test_the_report_holds_no_element_and_no_formula_of_a_name(tmp_path: Path, name: str) -> None:
    robot = pb.load(planar(name, name + ".2", tmp_path))
    from pinbound.evaluate import symbolic

    for component in symbolic.mathml(robot.boundaries[0].expression()):
        page = etree.fromstring(component.encode())
        assert {etree.QName(e).localname for e in page.iter(etree.Element)} <= {
            *("math", "mrow", "mi", "mo", "mn", "msup", "msub", "mfenced", "mspace", "mfrac"),
        }
        if component.count("<mi>sin") + component.count("<mi>cos"):
            assert name in "".join(page.itertext())
    latex = robot.boundaries[0].latex()
    assert r"\input" not in latex
    assert len(re.findall(r"(?<!\\)\$", latex)) == 0


def test_the_whole_report_escapes_a_hostile_robot(tmp_path: Path) -> None:
    path = planar("<script>alert(1)</script>", "<img src=x onerror=alert(2)>", tmp_path)
    done = RUN.invoke(app, ["report", str(path), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "out" / "index.html").read_text()
    assert "<script" not in page
    assert "onerror" in page
    assert "<img src=x" not in page


@pytest.mark.parametrize("hidden", ["\x85", "\u202e", "\u200b", "\ufeff", "\u2028"])
def test_names_that_nobody_can_see_are_refused(tmp_path: Path, hidden: str) -> None:
    with pytest.raises(pb.InputError, match="invisible characters") as caught:
        pb.load(planar(f"a{hidden}b", "c", tmp_path))
    assert hidden not in str(caught.value)


def test_an_escape_sequence_in_a_sidecar_reaches_no_terminal(load_text: Load) -> None:
    for name in (r"a\e]0;title\a", r"x\e[2J"):
        with pytest.raises(pb.InputError, match=r"\\x1b") as caught:
            load_text(
                '<robot name="r"><link name="b"/></robot>', f'points: [{{name: "{name}", link: b, xyz: [0, 0, 0]}}]'
            )
        assert "\x1b" not in str(caught.value)


def test_messages_are_escaped_but_letters_stay() -> None:
    assert str(Problem("a\x1b[0m\nb é", "Ü", "名.urdf")) == "名.urdf: a\\x1b[0m\\nb é. Ü."
    assert printable("a\u00a0b c") == "a\u00a0b c"


@pytest.mark.parametrize("name", [r"$\frac{1}$", "$", "a_{1}$b$"])
def test_figures_of_robot_and_region_take_names_letter_by_letter(tmp_path: Path, name: str) -> None:
    robot = pb.load(planar(name, name + ".2", tmp_path))
    draw_robot(robot, robot.home).draw_without_rendering()
    draw_region(pb.feasible_region(robot), robot.home).draw_without_rendering()


def test_motion_figures_take_names_letter_by_letter(tmp_path: Path) -> None:
    robot = pb.load(planar("$x", r"$\frac{1}", tmp_path))
    from pinbound.motion.history import history

    region = pb.feasible_region(robot)
    Q = [[0.0, 0.0], [0.2, 0.1], [0.3, 0.4]]
    draw_motion(history(robot, Q, None, region), None).draw_without_rendering()


def test_a_hint_keeps_the_case_of_names(tmp_path: Path) -> None:
    path = planar("LeftArm_J1", "LeftArm_J2", tmp_path)
    (tmp_path / "m.csv").write_text("LeftArmJ1,leftarm_j2\n0,0\n")
    done = RUN.invoke(app, ["check", str(path), str(tmp_path / "m.csv")])
    assert done.exit_code == 2
    assert "Did you mean 'LeftArm_J1'? Valid: time, LeftArm_J1, LeftArm_J2" in done.stderr
    assert "Did you mean 'LeftArm_J2'?" in done.stderr


@pytest.mark.parametrize("inside", ["\t", "\n", "\r\n"])
@pytest.mark.parametrize("quote", ['"', "'"])
def test_names_with_tabs_and_line_breaks_are_refused(inside: str, quote: str, load_text: Load) -> None:
    """XML reads them as spaces, Pinocchio as they are: two robots out of one file."""
    body = "".join(joint(name, "revolute", f"l_{name}", f"m_{name}") for name in "ab").replace("l_b", "m_a")
    body += '<link name="l_a"/>'
    text = f'<robot name="r">\n{body}</robot>'.replace('"a"', f"{quote}a{inside}c{quote}")
    assert inside in text
    with pytest.raises(pb.InputError, match="tab or a line break") as caught:
        load_text(text)
    (problem,) = caught.value.problems
    assert problem.line == text[: text.index(f"{quote}a{inside}")].count("\n") + 1
    assert load_text(text.replace(inside, " ")).coordinates == ("a c", "b")
    assert load_text(text.replace(inside, " ").replace("<robot", f'<!-- link="x{inside}" --><robot', 1)).coordinates
