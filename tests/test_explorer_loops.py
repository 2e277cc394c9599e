"""The explorer's page of robots with loops that are not parallelograms, in a real browser, against Python."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkages
import pinbound as pb
from pages import opened, until
from pinbound.explorer.loops import loops_record
from pinbound.explorer.planes import windows
from pinbound.robot.loop_robot import LoopRobot

NEAR = 1e-12  # what the page's numbers may differ by [m]
STEPPED = 1e-8  # the clearance at which the page stops stepping [m, rad]
KINDS = ["lifter", "cut", "chained", *linkages.KINDS]


def cut() -> LoopRobot:
    """Return a five-bar whose cranks' ends may meet: a cut of its turn leads from there to a limit."""
    parts = [
        linkages.Part("A", "base", "left", 0j, lower=-0.6, upper=2.9),
        linkages.Part("B", "left", "near", 0.3 + 0j, lower=-9.0, upper=9.0),
        linkages.Part("D", "base", "right", 0.4 + 0j, lower=0.2, upper=3.2),
        linkages.Part("E", "right", "far", 0.3 + 0j, lower=-9.0, upper=9.0),
    ]
    home = {"A": 1.6, "B": -1.0, "D": 1.5, "E": 1.0}
    pin = ("five", "near", 0.4 + 0j, "far", 0.3 + 0j)
    marks = '<pinbound:point name="p" link="near" xyz="0.2 0 0" radius="0.02"/>'
    marks += '<pinbound:point name="post" link="base" xyz="0.2 -0.3 0" radius="0.05"/>'
    marks += '<pinbound:boundary name="p_post" a="p" b="post"/>'
    found = pb.load(linkages.Mechanism(parts, [pin], {"five": ("B", "E")}, home).urdf(marks))
    assert isinstance(found, LoopRobot)
    return found


def chained() -> LoopRobot:
    """Return two four-bars, of which the coupler of one moves the other."""
    parts = [
        linkages.Part("A", "base", "crank", 0j, lower=-1.0, upper=3.0),
        linkages.Part("B", "crank", "coupler", 0.22 + 0j, lower=-3.0, upper=3.0),
        linkages.Part("D", "base", "rocker", 0.3 + 0j, lower=-2.0, upper=4.0),
        linkages.Part("E", "coupler", "second", 0.25 + 0.05j, lower=-4.0, upper=4.0),
        linkages.Part("G", "rocker", "third", 0.1 + 0.1j, lower=-4.0, upper=4.0),
        linkages.Part("H", "base", "post", 0.6 + 0.2j, lower=-3.0, upper=3.0),
    ]
    pins = [("one", "coupler", 0.25 + 0j, "rocker", 0.2 + 0j), ("two", "second", 0.3 + 0j, "post", 0.25 + 0j)]
    home = {"A": 1.2, "B": -0.8, "D": 1.6, "E": 0.5, "G": 0.2, "H": 1.0}
    marks = '<pinbound:point name="p" link="second" xyz="0.3 0.1 0" radius="0.02"/>'
    marks += '<pinbound:point name="o" link="third" xyz="0.1 0 0" radius="0.03"/>'
    marks += '<pinbound:boundary name="p_o" a="p" b="o"/>'
    passive = {"one": ("B", "D"), "two": ("E", "H")}
    found = pb.load(linkages.Mechanism(parts, pins, passive, home).urdf(marks))
    assert isinstance(found, LoopRobot)
    return found


@pytest.fixture(scope="module")
def robots() -> dict[str, LoopRobot]:
    seeds = {"four-bar": 7, "five-bar": 7, "slider-crank": 3, "cylinder": 3}  # limits and contacts behind the loops
    found = {kind: linkages.scene(kind, np.random.default_rng(seed), pb.load) for kind, seed in seeds.items()}
    return {"lifter": pb.load(linkages.lifter_urdf(linkages.lifter())), "cut": cut(), "chained": chained()} | found


@pytest.fixture(scope="module")
def pages(robots: dict[str, LoopRobot], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("loops")
    motion = {"lifter": [[1.2, 0.6], [0.4, 0.2], [0.4, -0.4]]}
    return {
        kind: pb.explorer_page(
            robot, None if kind in ("lifter", "cut") else [], motion=motion.get(kind), width=0.02
        ).save(folder / f"{kind}.html")
        for kind, robot in robots.items()
    }


def poses(robot: LoopRobot, count: int) -> np.ndarray:
    """Return poses in the page's windows: some of them beyond toggles."""
    low, high = np.array(windows(robot, robot.home, {})).T
    return np.random.default_rng(7).uniform(low, high, (count, len(low)))


def is_closed(robot: LoopRobot, Q: np.ndarray) -> np.ndarray:
    return np.asarray(robot.boundaries.closed(robot.lift(Q)))


ASK = """(Q) => { const { robot, data } = pinbound; return JSON.stringify({
  clearances: Q.map((q) => [...robot.evaluate(q)]),
  free: Q.map((q) => robot.contact(q, data.boundaries.map((_, k) => k)) < 0 && robot.broken(q).length === 0),
  open: Q.map((q) => robot.open(q).length),
  z: Q.map((q) => [...robot.loops.at(q)]),
  places: Q.map((q) => robot.places(q)),
  slopes: Q.map((q) => robot.clearances.map((one) => one.gradient(q).gradient).map((g) => g && [...g])),
}); }"""


@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_poses_have_pythons_numbers(
    kind: str, browser: Any, pages: dict[str, Path], robots: dict[str, LoopRobot]
) -> None:
    robot, page = robots[kind], opened(browser, pages[kind])
    Q = poses(robot, 1000)
    found = json.loads(page.evaluate(ASK, Q.tolist()))
    assert page.faults == []
    page.close()
    B, closed = robot.boundaries, is_closed(robot, Q)
    assert np.array_equal(np.array(found["open"]) == 0, closed)
    assert 50 < closed.sum()
    Q = Q[closed]
    z = np.array(found["z"])[closed]
    assert np.abs(z - robot.lift(Q)).max() < NEAR
    signed = B.signed_clearances(Q)
    assert np.abs(np.array(found["clearances"])[closed] - signed).max() < NEAR
    decided = np.abs(signed).min(axis=1) > NEAR
    assert np.array_equal(np.array(found["free"])[closed][decided], B.free(Q)[decided])
    assert not np.any(np.array(found["free"])[~closed])
    places = np.array(found["places"])[closed].reshape(len(Q), -1, 4, 4)
    for k, link in enumerate(robot.tree.links):
        origin = robot.positions(link, Q)
        assert np.abs(places[:, k, 3, :3] - origin).max() < NEAR
        for axis, unit in enumerate(np.eye(3).tolist()):
            assert np.abs(places[:, k, axis, :3] - (robot.positions(link, Q, unit) - origin)).max() < NEAR
    slopes, tried = B.signed_gradients(Q), 0
    for row, q in enumerate(np.flatnonzero(closed).tolist()):
        for k, slope in enumerate(found["slopes"][q]):
            known = slopes[row, k]
            if slope is not None and np.all(np.isfinite(known)) and abs(signed[row, k]) > 1e-3:
                tried += 1
                assert np.abs(np.array(slope) - known).max() < 1e-10 * (1.0 + np.abs(known).max() ** 2)
    assert tried > 100


def test_numbers_stay_pythons_at_the_last_pose_before_a_toggle(
    browser: Any, pages: dict[str, Path], robots: dict[str, LoopRobot]
) -> None:
    """Where rounding counts most: the page asks whether the loop closes by the same ends as Python."""
    robot, page = robots["lifter"], opened(browser, pages["lifter"])
    toggle = next(one for one in robot.opened.linear_limits if one.joint == "four_bar toggle" and one.coefficients[0])
    ends = sorted((end - toggle.offset) / toggle.coefficients[0] for end in (toggle.lower, toggle.upper))
    Q = np.array([[ends[1] - off, 0.3] for off in (1e-3, 1e-6, 1e-9, -1e-6, -1e-3)])
    found = json.loads(page.evaluate(ASK, Q.tolist()))
    page.close()
    assert found["open"] == [0, 0, 0, 1, 1]
    off = np.abs(np.array(found["z"]) - robot.lift(Q)).max(axis=1)
    assert off[0] < NEAR
    assert off.max() < 1e-11


def limits(page: Any, Q: np.ndarray) -> list[Any]:
    ask = """(Q) => Q.map((q) => { const s = pinbound.robot.evaluate(q); return q.map((_, j) => {
      const { lower, upper } = pinbound.reach.of(Float64Array.from(q), j, s);
      return [lower, upper].map(({ value, name, how }) => [String(value), name, how]); }); })"""
    return page.evaluate(ask, Q.tolist())


@pytest.mark.parametrize("kind", KINDS)
def test_live_limits_never_pass_pythons(
    kind: str, browser: Any, pages: dict[str, Path], robots: dict[str, LoopRobot]
) -> None:
    """What is stepped is free up to its end, and its margin is used up there: Python has the contact or limit there."""
    robot, page = robots[kind], opened(browser, pages[kind])
    B, Q = robot.boundaries, poses(robot, 3000)
    Q = Q[np.asarray(B.free(Q))][:12]
    assert len(Q) > 3
    seen: dict[str, int] = {}
    stops = set[str]()
    for q, rows in zip(Q, limits(page, Q), strict=True):
        for j, ends in enumerate(rows):
            known = B.limits(robot.coordinates[j], q)
            for (text, stop, how), value, side in zip(ends, (known.lower, known.upper), (-1.0, 1.0), strict=True):
                seen[how] = seen.get(how, 0) + 1
                stops.add(stop)
                short = 0.0 if float(text) == value else side * (value - float(text))
                if how in ("exact", "closed form"):
                    assert abs(short) < 1e-7, (q, j, stop)
                elif how == "sampled":
                    assert abs(short) < 1e-6, (q, j, stop)
                else:
                    assert -1e-7 < short, (q, j, stop)  # Python's own end may be short of a toggle by some 1e-9
                    moved = np.repeat(q[None], 33, axis=0)
                    moved[:, j] = np.linspace(q[j], float(text), 33)
                    assert np.all(B.free(moved)), (q, j, stop)
                    assert how != "stepped" or 0.0 <= room(robot, stop, moved[-1]) <= 2.0 * STEPPED, (q, j, stop)
    assert seen.get("stepped", 0) > 0
    assert seen.get("at least", 0) <= (12 if kind in ("five-bar", "cut") else 1)  # of 72 and 48
    assert kind != "cut" or "five turn" in stops
    page.close()


def room(robot: LoopRobot, name: str, q: np.ndarray) -> float:
    """Return how far q is from a contact or from the limits of a name."""
    if name in robot.boundaries.names:
        return float(robot.boundaries[name].signed_clearance(q))
    z = robot.lift(q)
    values = [
        (float(one.coefficients @ z) + one.offset, one) for one in robot.opened.linear_limits if one.joint == name
    ]
    return min(min(value - one.lower, one.upper - value) for value, one in values)


@pytest.mark.parametrize("kind", KINDS)
def test_rates_bound_what_the_loop_changes_by(kind: str, robots: dict[str, LoopRobot]) -> None:
    """No limit can be stepped over: |dz_k/dq_j| is at most the bound of its part, anywhere in the windows."""
    robot = robots[kind]
    shown = windows(robot, robot.home, {})
    record = loops_record(robot, shown)
    Q = poses(robot, 4000)
    Q = Q[is_closed(robot, Q)]
    J, tried = robot.lift.jacobians(Q), 0
    for j, rates in enumerate(record["rates"]):
        moved = np.flatnonzero(np.any(J[:, :, j] != 0.0, axis=0))
        assert (rates is None) == (len(moved) == 1)
        if rates is None:
            continue
        cells = np.floor((Q[:, j] - rates["from"]) / (rates["to"] - rates["from"]) * rates["cells"]).astype(int)
        if rates["rows"] > 1:
            low, high = shown[rates["other"]]
            cells += rates["cells"] * np.floor((Q[:, rates["other"]] - low) / (high - low) * rates["rows"]).astype(int)
        for k in moved.tolist()[1:]:
            bounds = np.array([np.inf if one is None else one for one in rates["of"][str(k)]])
            assert np.all(np.abs(J[:, k, j]) <= bounds[cells])
            tried += int(np.isfinite(bounds[cells]).sum())
    assert tried > 500


def test_the_page_says_where_the_loop_cannot_be_closed(
    browser: Any, pages: dict[str, Path], robots: dict[str, LoopRobot]
) -> None:
    robot, page = robots["lifter"], opened(browser, pages["lifter"])
    labels = page.locator("#joints label").all_text_contents()
    assert labels == ["crank_joint", "tool_joint"]  # the independent ones
    assert page.locator("#verdict").text_content().startswith("● Free: smallest clearance")
    page.evaluate("() => pinbound.choose('tool_post')")
    assert "knee = four_bar(crank_joint), solved from the loop" in page.locator("#detail").text_content()
    assert page.locator("#detail math").count() == 3
    page.evaluate("() => pinbound.set(0, 2.5)")
    until(page, "() => document.getElementById('verdict').textContent.includes('cannot be closed here')")
    assert page.locator("#now").text_content() == "none: a loop cannot be closed here"
    assert page.locator("#nearest li:visible").count() == 0
    until(
        page, "() => document.querySelector('.joint .ends').textContent === 'no limits: a loop cannot be closed here'"
    )
    page.get_by_role("button", name="four_bar toggle upper", exact=True).click()
    until(page, "() => document.getElementById('detail').textContent.includes('is where loop four_bar toggles')")
    page.get_by_role("button", name="Go home").click()
    until(page, "() => document.getElementById('verdict').textContent.startsWith('● Free')")
    region = pb.feasible_region(robot, width=0.02)
    names = page.locator("#edges button").all_text_contents()
    assert names == list(dict.fromkeys(edge.name for edge in region.edges))
    assert page.locator("#motion-verdict").text_content().startswith("certified")
    assert page.faults == []
    page.close()


def test_the_raster_is_free_where_python_is(browser: Any, pages: dict[str, Path], robots: dict[str, LoopRobot]) -> None:
    for kind, robot in robots.items():
        page, Q = opened(browser, pages[kind]), poses(robot, 400)
        hits = np.array(page.evaluate("(Q) => Q.map((q) => pinbound.plane.hit(q))", Q.tolist()))
        assert np.array_equal(hits == -1, robot.boundaries.free(Q))
        assert page.faults == []
        page.close()


def test_a_cut_is_drawn_and_named(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["cut"])
    until(page, "() => document.getElementById('plane-said').textContent.includes('dashed cut (five turn)')")
    assert page.locator("#drawing path.path").count() == 1
    assert page.faults == []
    page.close()
