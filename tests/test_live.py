"""The live view: what it draws and says is what Python says, whatever the server."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import linkages
import pinbound as pb
from pinbound.cli import app
from pinbound.explorer.live import LiveView, live_view
from viewers import Server

pytest.importorskip("trimesh", reason="trimesh, which viser brings, is not installed: pip install viser")


@pytest.fixture(scope="module")
def robot() -> pb.Robot:
    return pb.load("minervabot_v3")


def test_a_slider_moves_the_links(robot: pb.Robot) -> None:
    server = Server()
    shown = LiveView(robot, server)
    assert len(server.frames) == len(robot.tree.links)
    server.connect(server.window)  # a browser comes
    away = server.window.camera.position - server.window.camera.look_at
    assert abs(away[1]) > abs(away[0])  # the arm moves in x and z
    assert [one.label for one in server.sliders] == ["q1 [deg]", "q2 [deg]", "q3 [deg]"]
    server.sliders[1].put(20.0)
    server.sliders[2].put(10.0)
    q = np.radians([0.0, 20.0, 10.0])
    assert np.allclose(shown.q, q)
    for frame, link in zip(server.frames.values(), robot.tree.links, strict=True):
        point = np.array([0.1, -0.2, 0.3])
        x = frame.position + Rotation.from_quat(np.roll(frame.wxyz, -1)).apply(point)
        assert np.abs(x - robot.positions(link, q, point.tolist())).max() < 1e-12


def test_it_says_what_python_says(robot: pb.Robot) -> None:
    server = Server()
    shown = LiveView(robot, server)
    least = 1e3 * robot.boundaries.signed_clearances(robot.home).min()
    assert server.text.content.startswith(f"**Free**, smallest clearance {least:.3f} mm (beta_9)")
    limits = robot.boundaries.limits("q2", robot.home)
    assert f"q2: {np.degrees(limits.lower):.3f} deg (beta_10)" in server.text.content
    assert robot.coverage.summary in server.text.content
    server.sliders[2].put(60.0)
    assert server.text.content.startswith("**Not free**: beta_1, beta_4")
    shown.show([3.0, 0.0, 0.0])
    assert "a joint limit is passed" in server.text.content


def test_the_chosen_and_the_touching_marks_have_colours(robot: pb.Robot) -> None:
    server = Server()
    LiveView(robot, server)
    names = [mark.name for mark in robot.annotations.marks.values()]
    marks = dict(zip(names, (one for place, one in server.solids.items() if "/mark_" in place), strict=True))
    plain = marks["o3"].color
    server.choice.put("beta_4")
    assert {name for name in names if marks[name].color != plain} == {"o14", "o15"}
    server.choice.put("none")
    server.sliders[2].put(60.0)
    beta = robot.boundaries["beta_1"]
    assert marks[beta.point_a.name].color != plain


def test_every_body_and_mark_is_drawn_where_it_is() -> None:
    """A box, a cylinder, a hull with a radius, a line and a plane: their triangles hold their vertices."""
    text = """<robot name="r"><link name="base">
      <collision><origin xyz="1 0 0" rpy="0 0 1.2"/><geometry><box size="0.2 0.4 0.6"/></geometry></collision>
      <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
      <collision><geometry><mesh filename="none.stl"/></geometry></collision></link><link name="a"/>
      <joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    hull = pb.Hull("h", "a", ((0.0, 0.0, 1.0), (0.1, 0.0, 1.0), (0.0, 0.1, 1.0), (0.0, 0.0, 1.2)), radius=0.05)
    wire = pb.Line("wire", "base", (0.0, 5.0, 0.0), (0.0, 0.0, 1.0))
    floor = pb.Plane("floor", "base", (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    server = Server()
    shown = LiveView(pb.load(text).with_annotations(pb.Annotations.of([hull, wire, floor])), server)
    assert len(shown.missing) == 1
    assert "none.stl" in shown.missing[0]
    box, round_, horn, line, plane = server.solids.values()
    local = (box.vertices - [1.0, 0.0, 0.0]) @ Rotation.from_euler("z", 1.2).as_matrix()
    assert np.allclose(np.abs(local).max(axis=0), [0.1, 0.2, 0.3])
    assert np.isclose(np.linalg.norm(round_.vertices[:, :2], axis=1).max(), 0.1)
    assert np.allclose(horn.vertices.min(axis=0), [-0.05, -0.05, 0.95], atol=2e-3)
    assert np.ptp(line.vertices[:, 2]) > 0.4
    assert np.ptp(line.vertices[:, 0]) < 0.01
    assert np.ptp(plane.vertices[:, 0]) > 0.4
    assert np.ptp(plane.vertices[:, 2]) < 0.01


def test_the_command_serves_until_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Server] = []

    def server(**options: Any) -> Server:
        made.append(Server(**options))
        return made[0]

    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setitem(__import__("sys").modules, "viser", SimpleNamespace(ViserServer=server))
    monkeypatch.setattr("pinbound.cli.view.time.sleep", interrupt)
    result = CliRunner().invoke(app, ["view", "minervabot_v3", "--port", "8123", "--at", "q2=10", "--deg"])
    assert result.exit_code == 0, result.output
    assert "http://127.0.0.1:8123" in result.output
    assert made[0].options["host"] == "127.0.0.1"
    assert made[0].sliders[1].value == pytest.approx(10.0)
    assert made[0].stopped


def test_viser_itself_takes_it(robot: pb.Robot) -> None:
    pytest.importorskip("viser", reason="viser is not installed: pip install 'pinbound[view]'")
    shown = live_view(robot, port=8765)
    shown.show([0.0, 0.1, 0.2])
    assert shown.server.get_port() >= 8765
    shown.server.stop()


def test_a_four_bar_moves_by_its_independent_joints() -> None:
    robot, server = pb.load(linkages.lifter_urdf(linkages.lifter())), Server()
    shown = LiveView(robot, server)
    assert [one.label for one in server.sliders] == ["crank_joint [deg]", "tool_joint [deg]"]
    assert server.text.content.startswith("**Free**")
    server.sliders[0].put(40.0)
    for frame, link in zip(server.frames.values(), robot.tree.links, strict=True):
        assert np.abs(frame.position - robot.positions(link, shown.q)).max() < 1e-12
    server.sliders[0].put(150.0)
    assert server.text.content.startswith("**Not free**: a loop cannot be closed: four_bar")
