"""xacro in a process of its own: threads do not mix, hostile files end, nothing is left behind, packages are found."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli.app import app
from pinbound.model import expansion
from pinbound.model.expansion import expand_xacro
from pinbound.model.xacro_child import find_package

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
ARM = """<link name="b"/><link name="a"/><joint name="q" type="revolute"><parent link="b"/><child link="a"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="{}" effort="1" velocity="1"/></joint>"""


def write(path: Path, body: str, encoding: str = "utf-8", declared: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(f'{declared}<robot name="r" {XACRO}>{body}</robot>'.encode(encoding))
    return path


def arm(path: Path, body: str = "", upper: str = "1") -> Path:
    return write(path, body + ARM.format(upper))


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("PINBOUND_XACRO_SECONDS", "1.5")
    return


def test_threads_get_the_arguments_that_they_gave(tmp_path: Path) -> None:
    macro = '<xacro:macro name="more" params="n"><xacro:if value="${n > 0}"><xacro:more n="${n - 1}"/></xacro:if>'
    body = f'<xacro:arg name="up" default="0"/>{macro}</xacro:macro><xacro:more n="8"/>'
    files = [arm(tmp_path / f"{i}.xacro", body, "$(arg up)") for i in range(4)]
    ups = [round(0.5 + 0.01 * i, 2) for i in range(100)]

    def one(i: int) -> float:
        return float(pb.load(files[i % 4], xacro_args={"up": ups[i]}).upper[0])

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(one, range(100))) == ups
    finally:
        sys.setswitchinterval(before)


HOSTILE = {
    "a power": ('<xacro:property name="p" value="${9**9**8}"/>${p}', "did not finish within 1.5 s"),
    "doubling macros": (
        '<xacro:macro name="m"><xacro:m/><xacro:m/></xacro:macro><xacro:m/>',
        "did not come to an end|refer to themselves|memory|recursion|without an answer",
    ),
    "a property of itself": ('<xacro:property name="p" value="${p}1"/><x>${p}</x>', "recursive|Undefined|p"),
    "memory": ("${'a' * 10**10}", "GiB of memory"),
    "sleep": ("${[x for x in [lambda: (x.__class__.__mro__, 1)]][0]}${float(int(1) / 0)}", "ZeroDivision|division"),
    "exit": (
        "${(lambda: [c for c in ().__class__.__base__.__subclasses__() if c.__name__ == 'x'][0])()}",
        "list index out of range",
    ),
    "an unknown command": ("<x>$(nothing)</x>", "Unknown substitution command"),
    "a missing argument": ("<x>$(arg nothing)</x>", "nothing"),
    "a macro without a name": ("<xacro:macro><x/></xacro:macro>", "name"),
    "an argument without a default": ('<xacro:arg name="a"/>', "default"),
    "a missing file": ('<xacro:include filename="gone.xacro"/>', "No such file"),
    "a folder": ('<xacro:include filename="."/>', "directory"),
    "a missing package": ('<xacro:include filename="$(find gone)/x.xacro"/>', "no package 'gone'.*--package-dir"),
    "an undefined macro": ("<xacro:nothing/>", "nothing"),
    "a syntax error": ("${1 +}", "SyntaxError|invalid syntax"),
    "no text": ('<xacro:element xacro:name=""/>', "empty name"),
}


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("what", HOSTILE)
def test_what_xacro_cannot_expand_is_one_fault_and_ends(tmp_path: Path, what: str) -> None:
    body, message = HOSTILE[what]
    begun = time.monotonic()
    with pytest.raises(pb.InputError, match=message) as caught:
        pb.load(arm(tmp_path / "r.xacro", body))
    assert time.monotonic() - begun < 20
    assert len(caught.value.problems) == 1
    assert pb.load(arm(tmp_path / "good.xacro")).upper.tolist() == [1.0]


def test_faults_carry_the_file_and_the_line_of_the_element(tmp_path: Path) -> None:
    arm(tmp_path / "parts" / "inner.xacro", "\n<xacro:macro name='m'>\n<x/></xacro:macro>\n\n<y a='${1/0}'/>")
    outer = arm(tmp_path / "r.urdf.xacro", '\n\n<xacro:include filename="parts/inner.xacro"/>')
    with pytest.raises(pb.InputError, match="division by zero") as caught:
        pb.load(outer)
    (problem,) = caught.value.problems
    assert (problem.source, problem.line) == (os.path.join("parts", "inner.xacro"), 5)
    with pytest.raises(pb.InputError, match=r"r.urdf.xacro, line 3.*division by zero"):
        pb.load(arm(outer, '\n\n<x a="${1/0}"/>'))
    (tmp_path / "parts" / "inner.xacro").write_text("<robot>\n<open></robot>")
    arm(outer, '<xacro:include filename="parts/inner.xacro"/>')
    with pytest.raises(pb.InputError, match=r"inner.xacro, line 2.*mismatched tag"):
        pb.load(outer)


def test_nothing_that_a_file_changes_outlives_it(tmp_path: Path) -> None:
    env = "${(lambda: [c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close'][0]"
    env += ".__init__.__globals__['environ'].__setitem__('PINBOUND_LEFT', '1'))()}"
    loaded = pb.load(arm(tmp_path / "bad.xacro", f'<xacro:property name="p" value="{env}"/><x n="${{p}}"/>'))
    assert any("<x>" in note for note in loaded.notes)
    assert "PINBOUND_LEFT" not in os.environ
    after = arm(tmp_path / "next.xacro", "", "$(optenv PINBOUND_LEFT 0.5)")
    assert pb.load(after).upper.tolist() == [0.5]


def test_the_environment_and_the_folder_are_those_of_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arm(tmp_path / "one" / "r.xacro", "", "$(env PINBOUND_UP)")
    arm(tmp_path / "two" / "r.xacro", "", "0.25")
    monkeypatch.setenv("PINBOUND_UP", "0.75")
    monkeypatch.chdir(tmp_path / "one")
    assert pb.load("r.xacro").upper.tolist() == [0.75]
    monkeypatch.setenv("PINBOUND_UP", "0.125")
    assert pb.load("r.xacro").upper.tolist() == [0.125]
    monkeypatch.chdir(tmp_path / "two")
    assert pb.load("r.xacro").upper.tolist() == [0.25]


def test_a_child_that_dies_is_started_again(tmp_path: Path) -> None:
    from pinbound.model import expansion

    path = arm(tmp_path / "r.xacro")
    assert expand_xacro(path, {}).text
    process = expansion._THE_CHILD.process
    assert process is not None
    process.kill()
    process.wait()
    assert pb.load(path).upper.tolist() == [1.0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_of_this_process_has_a_child_of_its_own(tmp_path: Path) -> None:
    path = arm(tmp_path / "r.xacro", '<xacro:arg name="up" default="1"/>', "$(arg up)")
    assert expand_xacro(path, {"up": "0.5"}).text.count('upper="0.5"') == 1
    ours, theirs = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.write(theirs, expand_xacro(path, {"up": "0.25"}).text.encode())
        finally:
            os._exit(0)
    os.close(theirs)
    with open(ours, "rb") as stream:
        assert b'upper="0.25"' in stream.read()
    os.waitpid(pid, 0)
    assert expand_xacro(path, {"up": "0.125"}).text.count('upper="0.125"') == 1


@pytest.mark.parametrize(
    ("encoding", "name"), [("iso-8859-1", "é"), ("utf-16", "名"), ("utf-8-sig", "名"), ("utf-8", "é")]
)
def test_files_of_other_encodings_are_read(tmp_path: Path, encoding: str, name: str) -> None:
    declared = "" if encoding == "utf-8-sig" else f'<?xml version="1.0" encoding="{encoding}"?>'
    inner = f'<xacro:property name="word" value="{name}"/>'
    write(tmp_path / "inner.xacro", inner, encoding, declared)
    outer = f'<xacro:include filename="inner.xacro"/><link name="{name}${{word}}"/>'
    assert pb.load(write(tmp_path / "r.xacro", outer, encoding, declared)).tree.root == name * 2


@pytest.mark.parametrize("spec", ["${folder}/bad.xacro", "inc/b*.xacro", "inc/bad.xacro"])
def test_a_doctype_is_refused_in_whatever_is_included(tmp_path: Path, spec: str) -> None:
    (tmp_path / "inc").mkdir()
    (tmp_path / "inc" / "bad.xacro").write_text('<!DOCTYPE robot [<!ENTITY e "1">]>\n<robot><x y="&e;"/></robot>')
    body = f'<xacro:property name="folder" value="inc"/><xacro:include filename="{spec}"/>'
    with pytest.raises(pb.InputError, match=r"bad.xacro.*DOCTYPE"):
        pb.load(arm(tmp_path / "r.xacro", body))


@pytest.mark.parametrize("spec", ["${folder}/up.xacro", "inc/*.xacro", "inc/up.xacro"])
def test_arguments_of_included_files_are_taken_and_others_refused(tmp_path: Path, spec: str) -> None:
    write(tmp_path / "inc" / "up.xacro", '<xacro:arg name="upper" default="0.75"/>')
    body = f'<xacro:property name="folder" value="inc"/><xacro:include filename="{spec}"/>'
    path = arm(tmp_path / "r.xacro", body, "$(arg upper)")
    assert pb.load(path).upper.tolist() == [0.75]
    assert pb.load(path, xacro_args={"upper": 0.5}).upper.tolist() == [0.5]
    with pytest.raises(pb.InputError, match=r"no xacro argument 'uper'. Did you mean 'upper'"):
        pb.load(path, xacro_args={"uper": 0.5})


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a source package, an installed one, and an arm that needs one by name."""
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    value = '<xacro:property name="up" value="{}"/>'
    write(tmp_path / "ws" / "src" / "deep" / "other_folder" / "urdf" / "m.xacro", value.format(0.25))
    (tmp_path / "ws" / "src" / "deep" / "other_folder" / "package.xml").write_text(
        "<package format='3'><name> parts </name><export><name>no</name></export></package>"
    )
    write(tmp_path / "install" / "share" / "parts" / "urdf" / "m.xacro", value.format(0.5))
    arm(tmp_path / "alone" / "r.xacro", '<xacro:include filename="$(find parts)/urdf/m.xacro"/>', "${up}")
    return tmp_path


@pytest.mark.parametrize("folder", ["ws", "ws/src", "ws/src/deep", "ws/src/deep/other_folder"])
def test_packages_are_found_in_package_dirs(workspace: Path, folder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(workspace / "install"))
    path = workspace / "alone" / "r.xacro"
    assert pb.load(path, package_dirs=[workspace / folder]).upper.tolist() == [0.25]
    assert pb.load(path, package_dirs=str(workspace / folder)).upper.tolist() == [0.25]  # one folder, not its letters
    monkeypatch.chdir(workspace)
    done = CliRunner().invoke(app, ["info", str(path), "--package-dir", folder])
    assert done.exit_code == 0
    assert "14.3239 deg" in done.output


@pytest.mark.parametrize(
    ("variable", "folder", "upper"),
    [
        ("ROS_PACKAGE_PATH", "ws/src", 0.25),
        ("AMENT_PREFIX_PATH", "install", 0.5),
        ("CMAKE_PREFIX_PATH", "install", 0.5),
    ],
)
def test_packages_are_found_by_the_variables_of_ros(
    workspace: Path, monkeypatch: pytest.MonkeyPatch, variable: str, folder: str, upper: float
) -> None:
    path = workspace / "alone" / "r.xacro"
    with pytest.raises(pb.InputError, match=r"no package 'parts'.*package_dirs"):
        pb.load(path)
    monkeypatch.setenv(variable, os.pathsep.join([str(workspace / "nowhere"), str(workspace / folder)]))
    robot = pb.load(path)
    assert robot.upper.tolist() == [upper]
    assert robot.notes == ()


def test_packages_around_the_file_are_found_and_noted(workspace: Path) -> None:
    own = workspace / "ws" / "src" / "robot"
    arm(own / "urdf" / "r.xacro", '<xacro:include filename="$(find robot)/urdf/up.xacro"/>', "${up}")
    write(own / "urdf" / "up.xacro", '<xacro:property name="up" value="0.375"/>')
    (own / "package.xml").write_text("<package><name>robot</name></package>")
    robot = pb.load(own / "urdf" / "r.xacro")
    assert robot.upper.tolist() == [0.375]
    assert any(f"$(find robot) is {own}, found beside the file" in note for note in robot.notes)
    assert find_package("robot", [str(workspace / "ws")], "x", {}) == (str(own), False)


def test_trust_refuses_xacro_and_only_xacro(tmp_path: Path) -> None:
    for name in ("r.urdf.xacro", "R.XACRO", "r.Xacro"):
        path = arm(tmp_path / name)
        assert pb.load(path).upper.tolist() == [1.0]
        with pytest.raises(pb.InputError, match="can run code"):
            pb.load(path, trust="urdf-only")
    plain = tmp_path / "plain.urdf"
    plain.write_text(f'<robot name="r">{ARM.format(1)}</robot>')
    assert pb.load(plain, trust="urdf-only").upper.tolist() == [1.0]
    assert pb.load("minervabot_v3", trust="urdf-only").coordinates == ("q1", "q2", "q3")
    with pytest.raises(pb.InputError, match=r"'all' is not a valid value of trust. Valid: xacro, urdf-only"):
        pb.load(plain, trust="all")


def test_the_command_line_asks_for_trust_everywhere(tmp_path: Path) -> None:
    path, run = arm(tmp_path / "r.urdf.xacro"), CliRunner()
    for command in ("info", "derive", "limits", "region", "mark", "crosscheck"):
        done = run.invoke(app, [command, str(path), "--trust", "urdf-only"])
        assert done.exit_code == 2, command
        assert "can run code" in done.stderr
    assert run.invoke(app, ["info", str(path), "--trust", "xacro"]).exit_code == 0
    assert run.invoke(app, ["info", str(path)]).exit_code == 0
    assert "--trust" in run.invoke(app, ["batch", "--help"]).output


def test_what_xacro_warns_of_is_a_note(tmp_path: Path) -> None:
    body = '<xacro:property name="x" value="1" nonsense="2"/>'
    assert any("xacro warns" in note and "nonsense" in note for note in pb.load(arm(tmp_path / "r.xacro", body)).notes)


def test_a_wrong_limit_of_time_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PINBOUND_XACRO_SECONDS", "soon")
    with pytest.raises(pb.InputError, match="PINBOUND_XACRO_SECONDS is 'soon'"):
        pb.load(arm(tmp_path / "r.xacro"))


def test_what_is_kept_for_speed_changes_no_result(tmp_path: Path) -> None:
    """One expression in many scopes, dollars of all kinds and empty texts come out as xacro alone prints them."""
    path = tmp_path / "many.urdf.xacro"
    path.write_text("""<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="n" default="2"/>
      <xacro:property name="x" value="1"/>
      <xacro:macro name="one" params="x y:=^|7 text:=''"><link name="l_${x}_${y}" a="$${x}" b="" c="$5 ${text}" d="$"/>
        <xacro:if value="${x &gt; 1}"><xacro:one x="${x - 1}"/></xacro:if></xacro:macro>
      <xacro:one x="$(arg n)"/><xacro:property name="y" value="${x * 2}"/><xacro:one x="3" text="${'$'}{x}"/>
      <xacro:property name="x" value="9"/><link name="${x * 2}"/></robot>""")
    code = "import sys, xacro; print(xacro.process_file(sys.argv[1]).toprettyxml(indent='  '), end='')"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert expand_xacro(path, {}).text == done.stdout
    assert 'name="l_1_2"' in done.stdout


INCLUDED = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="top" value="{}"/></robot>'
OTHERS = {
    "a variable of the environment": '<xacro:property name="v" value="$(optenv PINBOUND_NO_SUCH x)"/>${v}',
    "a file of YAML": '<xacro:property name="y" value="${xacro.load_yaml(\'some.yaml\')}"/>${y.a}',
    "files by a pattern": '<xacro:include filename="mor*.xacro"/>',
    "a package": '<xacro:include filename="$(find here)/more.xacro"/>',
    "code inside an expression": '<xacro:property name="c" value="${[*(i for i in range(3))][0]}"/>${c}',
    "a function inside an expression": '<xacro:property name="c" value="${(lambda: 1)()}"/>${c}',
}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the files that xacro is asked to expand, from now on."""
    found: list[str] = []
    real = expansion._ask

    def ask(request: dict[str, object], path: Path) -> dict[str, object]:
        found.append(path.name)
        return real(request, path)

    monkeypatch.setattr(expansion, "_ask", ask)
    return found


def included(folder: Path, more: str = "") -> Path:
    (folder / "package.xml").write_text("<package><name>here</name></package>")
    (folder / "some.yaml").write_text("a: 1\n")
    (folder / "more.xacro").write_text(INCLUDED.format("0.5"))
    body = '<xacro:arg name="up" default="1"/><xacro:include filename="more.xacro"/>' + more
    return arm(folder / "arm.xacro", body, "${top * $(arg up)}")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="without fork nothing is reused")
def test_the_same_files_and_arguments_are_expanded_once(tmp_path: Path, asked: list[str]) -> None:
    path = included(tmp_path)
    assert [float(pb.load(path).upper[0]) for _ in range(3)] == [0.5] * 3
    assert asked == ["arm.xacro"]
    (tmp_path / "more.xacro").write_text(INCLUDED.format("0.75"))
    assert float(pb.load(path).upper[0]) == 0.75
    assert len(asked) == 2
    assert float(pb.load(path, xacro_args={"up": "0.5"}).upper[0]) == 0.375
    assert len(asked) == 3
    (tmp_path / "more.xacro").unlink()
    with pytest.raises(pb.InputError, match=r"more\.xacro"):
        pb.load(path)
    (tmp_path / "more.xacro").write_text(INCLUDED.format("0.75"))
    assert float(pb.load(path).upper[0]) == 0.75
    with pytest.raises(pb.InputError, match="no xacro argument 'down'"):
        pb.load(path, xacro_args={"down": "1"})


@pytest.mark.skipif(not hasattr(os, "fork"), reason="without fork nothing is reused")
@pytest.mark.parametrize("what", OTHERS)
def test_what_depends_on_more_than_files_is_expanded_again(what: str, tmp_path: Path, asked: list[str]) -> None:
    path = included(tmp_path, OTHERS[what])
    for _ in range(2):
        assert float(pb.load(path).upper[0]) == 0.5
    assert len(asked) == 2


@pytest.mark.skipif(not hasattr(os, "fork"), reason="without fork nothing is reused")
def test_few_answers_are_kept(tmp_path: Path, asked: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expansion, "_MOST_KEPT", 2)
    path = included(tmp_path)
    for value in ("0.1", "0.2", "0.3", "0.3", "0.1"):
        assert float(pb.load(path, xacro_args={"up": value}).upper[0]) == pytest.approx(0.5 * float(value))
    assert len(asked) == 4
