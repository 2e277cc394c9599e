"""The explorer's page, in a real browser: its numbers are Python's, and it answers to mouse, touch and keys.

Tests of the page are skipped, with the reason, where no Chromium or no Playwright is found.
"""

import json
import math
import re
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pages import opened, until
from pinbound.explorer.program import ways
from pinbound.explorer.solids import _triangles
from robots import joint, robot_xml

NEAR = 1e-12  # what the page's numbers may differ by [m]
STEPPED = 1e-8  # the clearance at which the page stops stepping [m]
EXACT_AT_CONTACT = 1e-7  # closed forms by other formulas: half the digits where a contact is grazed [rad]


HORN = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.02), (0.0, 0.1, 0.05), (0.02, 0.03, 0.15), (0.07, 0.07, 0.1))


def every_mark() -> pb.Robot:
    """Return an arm on a rail, with a mark of every kind, a rule with a condition, and every way that the page has."""
    joints = [
        joint("rail", "prismatic", "base", "cart", axis="1 0 0", limit="-0.4 0.4"),
        joint("j1", "revolute", "cart", "a", axis="0 0 1", xyz="0 0 0.3", limit="-2.5 2.5"),
        joint("j2", "revolute", "a", "b", axis="0 0.6 0.8", xyz="0.05 0.02 0.1", limit="-2 2"),
        joint("j3", "revolute", "b", "c", axis="0 1 0", xyz="0 0 0.4", rpy="0.1 0 0.2", limit="-2.5 2.5"),
        joint("m", "revolute", "c", "d", axis="0 1 0", xyz="0 0 0.2", limit="-1.2 1.2", mimic="j3 -0.5 0.1"),
    ]
    robot = pb.load(robot_xml(joints, {}, []))
    marks = [
        pb.Point("p", "base", (0.3, 0.1, 0.5), radius=0.02),
        pb.Point("s", "c", (0.05, 0.0, 0.15), radius=0.03),
        pb.Point("bare", "b", (0.1, 0.0, 0.3)),
        pb.Segment("bone", "d", (0.0, 0.0, 0.0), (0.02, 0.01, 0.2), radius=0.02),
        pb.Segment("post", "base", (-0.4, 0.3, 0.0), (-0.4, 0.3, 0.6), radius=0.01),
        pb.Box("crate", "base", (0.4, -0.2, 0.2), (0.1, 0.2, 0.3), (0.2, 0.15, 0.3), radius=0.005),
        pb.Box("hand", "d", (0.0, 0.0, 0.22), (0.0, 0.3, 0.0), (0.06, 0.1, 0.05)),
        pb.Hull("horn", "c", HORN),
        pb.Cylinder("can", "base", (0.0, -0.5, 0.0), (0.0, -0.5, 0.4), radius=0.08),
        pb.Line("wire", "base", (0.0, 0.6, 0.9), (1.0, 0.0, 0.1), radius=0.01),
        pb.Plane("floor", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ]
    pairs = [
        ("p", "s"), ("p", "bare"), ("post", "bone"), ("post", "s"), ("crate", "hand"), ("crate", "horn"),
        ("can", "hand"), ("wire", "s"), ("wire", "bone"), ("wire", "hand"), ("floor", "s"), ("floor", "bone"),
        ("floor", "horn"), ("floor", "hand"),
    ]  # fmt: skip
    boundaries = [pb.BoundaryMark(f"{a} - {b}", a, b) for a, b in pairs]
    low = pb.Condition({"j3": 1.0}, upper=-0.5)
    rules = (pb.Rule("front", {"j2": 1.0}, lower=-0.9, where=(low,)), pb.Rule("sum", {"j2": 1.0, "j3": 1.0}, upper=3.2))
    return robot.with_annotations(pb.Annotations.of(marks, boundaries, rules=rules))


@pytest.fixture(scope="module")
def robots() -> dict[str, pb.Robot]:
    return {"minervabot_v3": pb.load("minervabot_v3"), "every mark": every_mark()}


@pytest.fixture(scope="module")
def pages(robots: dict[str, pb.Robot], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("explorer")
    motion = np.radians([[0.0, 0.0, 0.0], [60.0, 20.0, 10.0], [0.0, 0.0, 0.0]])
    made = {
        "minervabot_v3": pb.explorer_page(robots["minervabot_v3"], motion=motion),
        "every mark": pb.explorer_page(robots["every mark"], planes=[("j2", "j3")], budget=0.0),
    }
    return {name: page.save(folder / f"{name}.html") for name, page in made.items()}


@pytest.fixture
def page(browser: Any, pages: dict[str, Path]) -> Iterator[Any]:
    found = opened(browser, pages["minervabot_v3"])
    yield found
    assert found.faults == []
    found.close()


def poses(robot: pb.Robot, count: int) -> np.ndarray:
    low, high = np.clip(robot.lower, -3.0, 3.0), np.clip(robot.upper, -3.0, 3.0)
    return np.random.default_rng(19).uniform(low, high, (count, len(low)))


ASK = """(Q) => { const { robot, data } = pinbound; return JSON.stringify({
  clearances: Q.map((q) => [...robot.evaluate(q)]),
  free: Q.map((q) => robot.contact(q, data.boundaries.map((_, k) => k)) < 0),
  kept: Q.map((q) => robot.broken(q).length === 0),
  places: Q.map((q) => robot.places(q)),
  slopes: Q.slice(0, 100).map((q) => robot.clearances.map((one) => one.gradient(q).gradient).map((g) => g && [...g])),
}); }"""


@pytest.mark.parametrize("name", ["minervabot_v3", "every mark"])
def test_a_thousand_poses_have_pythons_numbers(
    name: str, browser: Any, pages: dict[str, Path], robots: dict[str, pb.Robot]
) -> None:
    robot, page = robots[name], opened(browser, pages[name])
    Q = poses(robot, 1000)
    found = json.loads(page.evaluate(ASK, Q.tolist()))
    assert page.faults == []
    page.close()
    B = robot.boundaries
    signed = B.signed_clearances(Q)
    assert np.abs(np.array(found["clearances"]) - signed).max() < NEAR
    decided = np.abs(signed).min(axis=1) > NEAR
    assert np.array_equal(np.array(found["free"])[decided], np.all(signed > 0.0, axis=1)[decided])
    assert found["kept"] == robot.intervals.hold(Q).tolist()
    if name == "every mark":
        assert 100 < sum(found["kept"]) < 900
    places = np.array(found["places"]).reshape(len(Q), -1, 4, 4)
    for k, link in enumerate(robot.tree.links):
        origin = robot.positions(link, Q)
        assert np.abs(places[:, k, 3, :3] - origin).max() < NEAR
        for axis, unit in enumerate(np.eye(3).tolist()):
            assert np.abs(places[:, k, axis, :3] - (robot.positions(link, Q, unit) - origin)).max() < NEAR
    slopes = B.signed_gradients(Q[:100])
    for q, row in enumerate(found["slopes"]):
        for k, slope in enumerate(row):
            known = slopes[q, k] if slope is not None else np.zeros(0)
            if slope is None:
                assert not np.any(np.isfinite(slopes[q, k]))
            elif np.all(np.isfinite(known)) and abs(signed[q, k]) > 1e-3:  # near contact |r| divides the rounding
                assert np.abs(np.array(slope) - known).max() < 1e-10


@pytest.mark.parametrize("name", ["minervabot_v3", "every mark"])
def test_live_limits_are_pythons(name: str, browser: Any, pages: dict[str, Path], robots: dict[str, pb.Robot]) -> None:
    """Closed forms agree; what is stepped ends before the contact, at a clearance of 10 nm or at the last step."""
    robot, page = robots[name], opened(browser, pages[name])
    B, Q = robot.boundaries, poses(robot, 4000)
    Q = Q[B.free(Q)][: 20 if name == "minervabot_v3" else 3]
    ask = """(Q) => Q.map((q) => { const s = pinbound.robot.evaluate(q); return q.map((_, j) => {
      const { lower, upper } = pinbound.reach.of(Float64Array.from(q), j, s);
      return [lower, upper].map(({ value, name, how }) => [String(value), name, how]); }); })"""
    hows = set()
    for q, rows in zip(Q, page.evaluate(ask, Q.tolist()), strict=True):
        for j, ends in enumerate(rows):
            known = B.limits(robot.coordinates[j], q)
            for (text, stop, how), value, side in zip(ends, (known.lower, known.upper), (-1.0, 1.0), strict=True):
                hows.add(how)
                short = 0.0 if float(text) == value else side * (value - float(text))
                if how in ("exact", "closed form"):
                    assert abs(short) < EXACT_AT_CONTACT, (q, j, stop)
                else:
                    moved = q.copy()
                    moved[j] = float(text)
                    assert -1e-9 < short
                    assert how == "at least" or B[stop].signed_clearance(moved) <= 2.0 * STEPPED
    assert hows >= ({"closed form"} if name == "minervabot_v3" else {"exact", "stepped"})
    page.close()


def test_closed_forms_are_pythons(browser: Any, pages: dict[str, Path], robots: dict[str, pb.Robot]) -> None:
    """Boundary by boundary: where each coordinate comes into contact by a turn, a slide or a stop."""
    tried: list[str] = []
    for name, robot in robots.items():
        page, B = opened(browser, pages[name]), robot.boundaries
        Q = poses(robot, 1000)
        ask = """(Q) => Q.map((q) => pinbound.robot.clearances.map((one) => q.map((_, j) => {
          const span = pinbound.reach.span(one, Float64Array.from(q), j); return span && span.map(String); })))"""
        found = page.evaluate(ask, Q.tolist())
        given = [one["ways"] for one in page.evaluate("() => pinbound.data.boundaries.map(({ ways }) => ({ ways }))")]
        clear = B.signed_clearances(Q) > 1e-6
        for i, k, j in np.argwhere(clear[:, :, None] & np.ones(len(robot.coordinates), dtype=bool)).tolist():
            way = given[k][j]["way"]
            if way not in ("stop", "turn", "slide"):
                assert found[i][k][j] is None
                continue
            if way == "stop" or (found[i][k][j] is None and i > 30):  # of a stop the page knows home's gap alone
                continue
            known = B[k].limits(robot.coordinates[j], Q[i]).around(float(Q[i, j]))
            span = (-math.inf, math.inf) if found[i][k][j] is None else tuple(map(float, found[i][k][j]))
            tried += [way] if math.isfinite(span[0]) or math.isfinite(span[1]) else []
            for value, end in zip(span, known, strict=True):
                assert value == end or abs(value - end) < EXACT_AT_CONTACT, (B[k], robot.coordinates[j], span, known)
        page.close()
    assert tried.count("turn") > 10
    assert tried.count("slide") > 3


def state(page: Any, what: str) -> Any:
    return page.evaluate(f"() => pinbound.{what}")


def pixels(page: Any, point: tuple[float, float]) -> tuple[float, float]:
    """Return where a point [deg] of the shown plane is in the window."""
    box = page.locator("#plane").bounding_box()
    x, y = page.evaluate("(p) => pinbound.plane.toPixels(p)", np.radians(point).tolist())
    return box["x"] + x, box["y"] + y


def test_dragging_in_the_region_moves_the_robot(page: Any) -> None:
    before = page.evaluate("() => pinbound.robot.places(pinbound.q).map((m) => m.slice(12, 15))")
    page.mouse.move(*pixels(page, (0.0, 0.0)))
    page.mouse.down()
    page.mouse.move(*pixels(page, (10.0, 5.0)))
    page.mouse.move(*pixels(page, (40.0, 30.0)), steps=4)
    page.mouse.up()
    until(page, "() => document.getElementById('verdict').textContent.includes('Free')")
    q = np.degrees(state(page, "q"))
    assert np.allclose(q, [0.0, 40.0, 30.0], atol=0.6)  # a pixel is a third of a degree
    after = page.evaluate("() => pinbound.robot.places(pinbound.q).map((m) => m.slice(12, 15))")
    assert np.abs(np.array(after) - before).max() > 0.03
    values = [float(one.input_value()) for one in page.locator("#joints input[type=number]").all()]
    assert np.allclose(values, q, atol=1e-3)
    page.mouse.click(*pixels(page, (-20.0, 50.0)))
    until(page, "() => document.getElementById('verdict').textContent.includes('Not free')")
    assert {"beta_4", "beta_10"} <= {one["name"] for one in state(page, "touching.map(({ name }) => ({ name }))")}


def test_a_slider_and_the_keys_move_the_point(page: Any) -> None:
    def cursor() -> float:
        return float(page.locator("#cursor .point").get_attribute("cx"))

    start = cursor()
    page.locator("#joint-1").fill("20")
    until(page, "() => Math.abs(pinbound.q[1] - Math.PI / 9) < 1e-9")
    until(page, f"() => document.querySelector('#cursor .point').getAttribute('cx') - {start} > 20")
    until(page, "() => document.querySelectorAll('.joint .ends')[1].textContent.includes('beta_8')")
    page.locator("#plane").focus()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowRight")
    until(page, "() => pinbound.drawn === pinbound.moved")
    assert np.allclose(np.degrees(state(page, "q")), [0.0, 20.1, 1.0])
    page.get_by_role("button", name="Go home").click()
    until(page, "() => pinbound.q.every((value) => value === 0) && pinbound.drawn === pinbound.moved")
    assert cursor() == start


def test_a_click_on_an_edge_lights_up_its_two_marks(page: Any) -> None:
    page.mouse.click(*pixels(page, (13.0, 45.43)))  # the middle of beta_4, q3 = q2 + 32.43 deg
    until(page, "() => document.getElementById('labels').children.length === 2")
    assert page.locator("#labels span").all_text_contents() == ["o14", "o15"]
    assert np.allclose(state(page, "q"), 0.0)  # it was a click, no drag
    said = page.locator("#detail").text_content()
    angle = math.degrees(pb.load("minervabot_v3").boundaries["beta_4"].contact.angle)
    assert f"q3 - q2 = {angle:.6f} deg" in said
    assert "o14 on link_2; o15 on link_13" in said
    assert page.locator("#detail math").count() == 3
    assert f"{1e3 * pb.load('minervabot_v3').boundaries['beta_4'].signed_clearance(np.zeros(3)):.6f} mm" in said
    page.get_by_role("button", name="beta_9", exact=True).click()
    until(page, "() => pinbound.chosen === 'beta_9'")
    assert page.locator("#choice").input_value() == "beta_9"


def test_touch_and_a_narrow_window(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(
        browser, pages["minervabot_v3"], viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True
    )
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
    page.locator("#plane").scroll_into_view_if_needed()
    page.touchscreen.tap(*pixels(page, (30.0, 40.0)))
    until(page, "() => pinbound.q[1] > 0.4")
    assert np.allclose(np.degrees(state(page, "q")), [0.0, 30.0, 40.0], atol=1.0)
    assert page.faults == []
    page.close()


def test_a_finger_turns_the_robot_and_two_zoom(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(
        browser, pages["minervabot_v3"], viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True
    )
    page.locator("#scene").scroll_into_view_if_needed()
    box, hand = page.locator("#scene").bounding_box(), page.context.new_cdp_session(page)
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": a, "y": b, "id": k} for k, (a, b) in enumerate(places)]
        hand.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    scrolled = page.evaluate("() => scrollY")
    before = state(page, "scene.view")
    touch("touchStart", (x, y))
    for k in range(1, 6):
        touch("touchMove", (x + 10 * k, y))
    touch("touchEnd")
    until(page, f"() => pinbound.scene.view.turn < {before['turn'] - 0.2}")
    after = state(page, "scene.view")
    assert abs(after["turn"] - (before["turn"] - 0.008 * 50)) < 0.01
    assert (after["tilt"], after["far"]) == (before["tilt"], before["far"])
    touch("touchStart", (x - 30, y), (x + 30, y))
    touch("touchMove", (x - 60, y), (x + 60, y))
    touch("touchEnd")
    until(page, f"() => Math.abs(pinbound.scene.view.far / {after['far']} - 0.5) < 0.05")
    assert page.evaluate("() => [scrollY, pinbound.scene.fingers.size]") == [scrolled, 0]
    assert page.faults == []
    page.close()


NO_WEBGL = """
const old = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : old.call(this, kind, ...rest);
};"""
UNNAMED = """
const old = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "WEBGL_debug_renderer_info" ? null : old.call(this, name);
};"""


def blocks(picture: np.ndarray) -> np.ndarray:
    """Return the means over 6 x 6 pixels."""
    high, wide = (size // 6 for size in picture.shape[:2])
    return picture[: 6 * high, : 6 * wide].reshape(high, 6, wide, 6, 3).mean(axis=(1, 3))


@pytest.mark.parametrize("name", ["minervabot_v3", "every mark"])
def test_the_processor_draws_what_webgl_draws(name: str, browser: Any, pages: dict[str, Path]) -> None:
    """Bodies, marks that shine through, the chosen pair, and corners behind the eye, pixel by pixel."""
    from matplotlib.image import imread

    views = ["{}", "{ turn: 0.4, tilt: 0.9 }", "{ far: 0.2, turn: 0.1 }"]
    pictures: dict[str, list[np.ndarray]] = {}
    for pen, script in (("SoftPen", NO_WEBGL), ("GlPen", UNNAMED)):
        page = opened(browser, pages[name], script)
        found = page.evaluate("() => pinbound.scene.pen.constructor.name")
        if pen == "GlPen" and found != pen:
            pytest.skip("this browser has no WebGL to compare with")
        assert found == pen
        page.evaluate("() => pinbound.choose(pinbound.data.boundaries[1].name)")
        pictures[pen] = []
        for view in views:
            page.evaluate(f"() => {{ pinbound.scene.reset(); Object.assign(pinbound.scene.view, {view}); }}")
            page.evaluate("() => { pinbound.scene.draw(); }")
            page.wait_for_timeout(60)
            pictures[pen].append(imread(BytesIO(page.locator("#scene").screenshot()))[..., :3])
        page.close()
    for pair in zip(pictures["SoftPen"], pictures["GlPen"], strict=True):
        soft, full = (blocks(picture) for picture in pair)
        assert 0.01 < np.mean(np.abs(full - full[0, 0]).max(axis=2) > 0.1)
        assert np.abs(soft - full).max() < 0.12  # lines and rims are one pixel, smoothed in another way


def test_frames_that_come_late_lower_the_resolution_until_it_stands_still(page: Any) -> None:
    found = page.evaluate("""() => {
      const { scene } = pinbound, seen = [], told = (gap, spent, count) => {
        for (let k = 0; k < count; k++) scene.pace(gap, spent);
        seen.push(scene.step);
      };
      Object.assign(scene, { step: 0, late: 0, inTime: 0, patience: 20 }); // whatever frames came before
      scene.moving();
      const full = scene.ratio;
      told(16, 5, 100); told(40, 5, 2); told(40, 5, 1); told(40, 5, 30); told(16, 14, 500); told(16, 5, 200);
      const [low, step] = [scene.ratio, scene.step];
      told(40, 5, 3);
      return { seen, full, low, step, still: scene.pen.ratios(devicePixelRatio).still };
    }""")
    assert found["seen"] == [0, 0, 1, 3, 3, 2, 3]  # late thrice; as coarse as can be; slow frames stay so; a finer try
    assert 0.0 < found["low"] < found["full"] <= found["still"]
    until(page, "() => !pinbound.scene.isMoving && !pinbound.scene.dirty")
    ratio, across = page.evaluate("() => [pinbound.scene.ratio, pinbound.scene.canvas.width / pinbound.scene.width]")
    assert ratio == found["still"]
    assert abs(across - found["still"]) < 0.01


def test_a_region_is_called_exact_only_where_python_computed_it(
    browser: Any, pages: dict[str, Path], robots: dict[str, pb.Robot], page: Any
) -> None:
    page.evaluate("() => pinbound.set(0, 1.0)")  # nothing depends on q1
    until(page, "() => pinbound.drawn === pinbound.moved")
    assert page.locator("#plane-said").text_content().startswith("Exact region of (q2, q3)")
    page.locator("#across").select_option("0")
    until(page, "() => document.getElementById('plane-said').textContent.includes('144 x 144')")
    assert "Sampled" in page.locator("#plane-said").text_content()
    assert page.locator("#drawing .edge").count() == 0
    other = opened(browser, pages["every mark"])  # its budget was zero
    until(other, "() => document.getElementById('plane-said').textContent.startsWith('Sampled on')")
    assert "No region was computed" in other.locator("#plane-said").text_content()
    assert other.faults == []
    other.close()


def test_the_raster_is_free_where_python_is(browser: Any, tmp_path: Path, robots: dict[str, pb.Robot]) -> None:
    robot = robots["minervabot_v3"]
    page = opened(browser, pb.explorer_page(robot, planes=[("q2", "q3")], at=[0.3, 0.0, 0.0]).save(tmp_path / "p.html"))
    Q = np.column_stack((np.zeros(400), np.random.default_rng(4).uniform(-1.5, 1.5, (400, 2))))
    hits = np.array(page.evaluate("(Q) => Q.map((q) => pinbound.plane.hit(q))", Q.tolist()))
    assert np.array_equal(hits == -1, robot.boundaries.free(Q))
    touching = hits >= 0
    assert np.all(robot.boundaries.signed_clearances(Q)[touching, hits[touching]] <= 0.0)
    page.close()


def test_a_motion_is_played_with_its_certificate(page: Any, robots: dict[str, pb.Robot]) -> None:
    said = page.locator("#motion-verdict").text_content()
    found = pb.certify(robots["minervabot_v3"], np.radians([[0.0, 0.0, 0.0], [60.0, 20.0, 10.0], [0.0, 0.0, 0.0]]))
    assert said.startswith("certified")
    assert f"at least {math.floor(1e6 * found.lower) / 1e3:.3f} mm" in said
    page.evaluate("() => { pinbound.player.lasts = 60; }")
    page.get_by_role("button", name="Play").click()
    until(page, "() => pinbound.q[0] > 0.1")
    page.get_by_role("button", name="Pause").click()
    page.evaluate("() => pinbound.player.show(0.5)")
    assert np.allclose(np.degrees(state(page, "q")), [60.0, 20.0, 10.0])


CONTRAST = """() => {
  const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
  const linear = (v) => (v / 255 <= 0.03928 ? v / 3294.6 : ((v / 255 + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const behind = (one) => {
    const c = rgb(getComputedStyle(one).backgroundColor);
    return c.length < 4 || c[3] > 0 ? c : behind(one.parentElement);
  };
  const found = [];
  for (const one of document.querySelectorAll("body *")) {
    const own = [...one.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim());
    if (!own || !one.getClientRects().length || one.tagName === "SCRIPT") continue;
    const style = getComputedStyle(one);
    const [a, b] = [light(rgb(one.namespaceURI.endsWith("svg") ? style.fill : style.color)), light(behind(one))];
    found.push([(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), one.textContent.slice(0, 30)]);
  }
  return found; }"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_has_contrast(scheme: str, browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["minervabot_v3"], color_scheme=scheme)
    page.evaluate("() => pinbound.choose('beta_4')")
    page.evaluate("() => document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert page.evaluate("() => document.documentElement.dataset.theme") == scheme
    found = page.evaluate(CONTRAST)
    assert len(found) > 60
    assert [one for one in found if one[0] < 4.5] == []
    page.close()


def test_names_are_data(browser: Any, tmp_path: Path) -> None:
    """A name that would end the script, or open an element, is shown as it is."""
    evil = "</script><img src=x onerror=alert(1)>\u2028"
    xml = robot_xml(
        [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
        {"p": ("base", "0.2 0 0.1"), "t": ("b", "0.05 0 0.35")},
        [("p", "t")],
    )
    escaped = evil.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\u2028", "")
    robot = pb.load(xml.replace('name="p_t"', f'name="{escaped}"'))
    made = pb.explorer_page(robot)
    assert "</script><img" in made.data
    assert "</script><img" not in made.text
    page = opened(browser, made.save(tmp_path / "evil.html"))
    page.evaluate("() => pinbound.choose(pinbound.data.boundaries[0].name)")
    assert page.locator("#choice option").nth(1).text_content() == evil.replace("\u2028", "")
    assert page.locator("body img").count() == 0
    assert page.faults == []
    page.close()


def test_speeds_bound_what_clearances_change_by(robots: dict[str, pb.Robot]) -> None:
    """No contact can be stepped over: |s(q + d e_j) - s(q)| <= speed_j |d|."""
    robot = robots["every mark"]
    reach = np.maximum(np.abs(robot.lower), np.abs(robot.upper))
    Q, rng = poses(robot, 400), np.random.default_rng(1)
    for boundary in robot.boundaries:
        for j, way in enumerate(ways(boundary.rule, reach)):
            moved = Q.copy()
            moved[:, j] = rng.uniform(robot.lower[j], robot.upper[j], len(Q))
            change = np.abs(boundary.signed_clearance(moved) - boundary.signed_clearance(Q))
            if way["way"] == "step":
                assert np.all(change <= way["speed"] * np.abs(moved[:, j] - Q[:, j]) + 1e-14)
            elif way["way"] == "none":
                assert change.max() < 1e-14


def test_the_page_states_what_is_missing(robots: dict[str, pb.Robot]) -> None:
    robot = robots["minervabot_v3"]
    made = pb.explorer_page(robot)
    data = json.loads(made.data)
    assert data["coverage"]["summary"] == robot.coverage.summary
    assert len(data["coverage"]["open"]) == len(robot.coverage.open)
    assert data["assumptions"] == list(robot.annotations.assumptions)
    assert made.size < 400_000
    assert "default-src 'none'" in made.text
    assert not re.search(r"(src|href)=\"(?!data:)", made.text)
    (region,) = data["regions"]
    known = pb.feasible_region(robot)
    assert [edge["name"] for loop in region["loops"] for edge in loop] == [edge.name for edge in known.edges]
    assert np.array_equal(np.array(region["corners"]), known.vertices)
    broken = pb.explorer_page(robots["every mark"], planes=[("j2", "j3")], budget=0.0)
    assert "budget" in broken.notes[-1]


def test_meshes_come_along_only_when_asked_for(tmp_path: Path) -> None:
    (tmp_path / "tip.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    body = '<link name="a"><visual><geometry><mesh filename="tip.obj"/></geometry></visual></link>'
    xml = robot_xml([joint("q1", "revolute", "base", "a")], {}, []).replace('<link name="a"/>', body)
    (tmp_path / "arm.urdf").write_text(xml)
    robot = pb.load(tmp_path / "arm.urdf")
    plain, full = pb.explorer_page(robot), pb.explorer_page(robot, meshes=True)
    assert "1 body is not drawn: meshes are left out; --meshes (meshes=True) takes them in" in plain.notes
    assert json.loads(plain.data)["bodies"] == []
    assert len(json.loads(full.data)["bodies"]) == 1
    assert full.size > plain.size


def test_what_cannot_be_explored_is_refused(robots: dict[str, pb.Robot]) -> None:
    robot = robots["minervabot_v3"]
    with pytest.raises(pb.UnknownNameError, match="q9"):
        pb.explorer_page(robot, planes=[("q2", "q9")])
    with pytest.raises(pb.DimensionError, match="a plane has two coordinates"):
        pb.explorer_page(robot, planes=[("q2", "q2")])
    with pytest.raises(pb.DimensionError, match="finite"):
        pb.explorer_page(robot, at=[0.0, math.nan, 0.0])
    with pytest.raises(pb.UnsupportedError, match="has no coordinate"):
        pb.explorer_page(pb.load(robot_xml([joint("f", "fixed", "base", "a")], {}, [])))


@pytest.mark.parametrize("sides", [3, 4, 6, 9])
def test_marks_are_drawn_by_their_surface_and_once(sides: int) -> None:
    """A sum of six edge vectors was hulled in six dimensions: 3,817 triangles, a hundred over another, for 36."""
    rng = np.random.default_rng(sides)
    ways_3d = [*np.eye(3), *rng.normal(size=(sides - 3, 3))]
    for edges in (ways_3d, [np.array([math.cos(k), math.sin(k), 0.0]) for k in range(sides)]):
        shape = pb.Sweep("body", "base", (0.1, 0.2, 0.3), tuple(map(tuple, edges))).shape
        triangles = _triangles(shape)
        a, b, c = (shape.vertices[triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        area = 0.5 * float(np.linalg.norm(normals, axis=1).sum())
        pairs = [(edges[i], edges[j]) for i in range(sides) for j in range(i)]
        assert area == pytest.approx(2.0 * sum(np.linalg.norm(np.cross(one, other)) for one, other in pairs), rel=1e-9)
        middle = shape.vertices.mean(axis=0)
        assert np.einsum("ij,ij->i", normals, a - middle).min() >= -1e-12 * area
