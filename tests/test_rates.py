"""Boundaries that a coordinate cannot bring near are not looked at, and the limits are the same as if all were."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.boundaries.rates import rates_of
from pinbound.boundaries.spans import CoordinateLimits, linear_span, linear_spans, tighten
from pinbound.robot.robot import Robot
from robots import ARM, ZOO, joint, robot_xml

Load = Callable[[str], Robot]

NEAR = robot_xml(
    ARM,
    {"p": ("base", "0.2 0.1 0.4"), "s": ("b", "0 0.1 0.2"), "t": ("d", "0.05 0.02 0.3"), "u": ("a", "0.1 0 0")},
    [],
    "".join(
        f'<pinbound:boundary name="{name}" a="{a}" b="{b}" min_distance="{gap}"/>'
        for name, a, b, gap in (
            ("pt", "p", "t", 0.25), ("less", "p", "t", 0.2), ("ps", "p", "s", 0.12),
            ("st", "s", "t", 0.2), ("tu", "t", "u", 0.3),
        )
    ),
)  # fmt: skip
BESIDE = robot_xml(
    [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "base", "b", xyz="1 0 0.4")],
    {"p": ("base", "0.2 0 0.1"), "s": ("a", "0.1 0 0.3"), "t": ("b", "0.05 0 0.35")},
    [("p", "s"), ("p", "t")],
)
FLAT = robot_xml(
    ARM,
    {"s": ("b", "0.05 0.1 0.2"), "t": ("d", "0.05 0.02 0.3")},
    [("floor", "t"), ("pole", "t"), ("pole", "s")],
    '<pinbound:line name="pole" link="base" xyz="-0.3 0.3 0" direction="0.1 0 1" radius="0.1"/>'
    '<pinbound:plane name="floor" link="base" xyz="0 -0.4 0" normal="0.6 0.8 0"/>',
)
BODY_MARKS = (
    '<pinbound:segment name="rod" link="b" xyz_a="0 0.05 0" xyz_b="0 0.05 0.3" radius="0.03"/>'
    '<pinbound:box name="block" link="base" xyz="0.3 0.1 0.4" rpy="0.1 0.2 0" size="0.1 0.2 0.3"/>'
    '<pinbound:box name="tray" link="d" xyz="0.05 0 0.2" rpy="0 0.3 0" size="0.2 0.1 0.04"/>'
    '<pinbound:hull name="tip" link="d" vertices="0 0 0.1 0.1 0 0.1 0 0.1 0.15 0.02 0.02 0.3"/>'
    '<pinbound:hull name="rock" link="base" vertices="0.1 -0.3 0.5 0.2 -0.2 0.5 0 -0.2 0.6 0.1 -0.2 0.8"/>'
    '<pinbound:line name="pole" link="base" xyz="-0.3 0.3 0" direction="0.1 0 1" radius="0.05"/>'
    '<pinbound:plane name="floor" link="base" xyz="0 0 0.05" normal="0 0.1 1"/>'
)
BODY_PAIRS = [
    ("rod", "block"), ("tray", "block"), ("tray", "rock"), ("tip", "block"), ("tip", "rock"),
    ("rod", "rock"), ("tip", "pole"), ("tray", "pole"), ("floor", "tip"), ("floor", "tray"),
]  # fmt: skip
FOLLOWED = [
    joint("j1", "revolute", "base", "a", axis="0 0 1", xyz="0 0 0.3", limit="-4 4.5"),
    joint("j2", "revolute", "a", "b", axis="0 1 0", xyz="0.05 0.02 0.1", limit="-2 2"),
    joint("j3", "revolute", "b", "c", xyz="0 0 0.4", rpy="0.1 0 0.2", mimic="j2 0.5 0.1", limit="-3 3"),
    joint("j4", "revolute", "c", "d", axis="1 0 0", xyz="0.1 0 0.2", rpy="0 1.5 0", limit="-7 7"),
]
BODIES = robot_xml(FOLLOWED, {}, BODY_PAIRS, BODY_MARKS)
ENDLESS = BODIES.replace('name="j4" type="revolute"', 'name="j4" type="continuous"')

ROBOTS = {
    "bodies": BODIES,
    "near": NEAR,
    "flat": FLAT,
    "beside": BESIDE,
    **{name: ZOO[name] for name in ("minervabot_v3", "planar_2r", "slides")},
}


ROUNDING = 1e-13
"""rad or m: roots that are isolated for several rows at once may differ in a last digit with the rows beside them."""


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest, load_text: Load) -> Robot:
    text = ROBOTS[request.param]
    return load_text(text) if text.startswith("<") else pb.load(text)


def some(robot: Robot, count: int, seed: int) -> np.ndarray:
    lower, upper = (np.clip(ends, -3.0, 3.0) for ends in (robot.lower, robot.upper))
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(robot.coordinates)))


def test_no_coordinate_changes_a_clearance_faster(robot: Robot) -> None:
    B, Q, reached = robot.boundaries, some(robot, 400, 0), 0
    for index in range(len(robot.coordinates)):
        rates, moved = rates_of(B, index), Q.copy()
        assert np.all(rates >= 0.0)
        step = np.random.default_rng(index).uniform(-1.0, 1.0, len(Q))
        moved[:, index] += step
        before, after = B.signed_clearances(Q), B.signed_clearances(moved)
        with np.errstate(invalid="ignore"):
            most = np.where(rates > 0.0, np.abs(step)[:, None] * rates, 0.0)
        kept = before > 0.0  # of stops beyond contact nothing is said
        assert np.all((before - after <= most + 1e-12)[kept])
        reached += int(
            np.count_nonzero((before - after > 0.5 * most)[kept] & (most > 0.0)[kept] & np.isfinite(most)[kept])
        )
    assert reached > 10  # the bound is not far off


def test_limits_are_those_of_all_boundaries(robot: Robot) -> None:
    B = robot.boundaries
    Q = some(robot, 12 if any(b.path.difference.directions for b in B) else 60, 1)
    clear, stopped = B.signed_clearances(Q) > 0.0, set[str]()
    for index, name in enumerate(robot.coordinates):
        ends, stops = np.tile([-np.inf, np.inf], (len(Q), 1)), np.full((len(Q), 2), "", dtype=object)
        for limit in robot.linear_limits:
            tighten(ends, stops, limit.joint, linear_spans(limit, index, Q))
        held = float(np.nanmin(ends[:, 0])), float(np.nanmax(ends[:, 1]))
        if not np.all(np.isfinite(held)):
            continue
        for k, boundary in enumerate(B):
            tighten(ends, stops, boundary.name, boundary.spans(name, Q, held, clear[:, k]))
        found, named = B.limits_table(name, Q)
        assert np.allclose(found, ends, rtol=0.0, atol=ROUNDING, equal_nan=True)
        assert np.array_equal(named, stops.astype(np.str_))
        stopped |= set(named.ravel().tolist())
        for row in range(0, len(Q), 12):
            q = Q[row]
            spans = [(limit.joint, linear_span(limit, index, q)) for limit in robot.linear_limits]
            window = max(s[0] for _, s in spans if s), min(s[1] for _, s in spans if s)
            spans += [(b.name, b.span(name, q, window, bool(clear[row, k]))) for k, b in enumerate(B)]
            wanted, one = CoordinateLimits.of(name, float(q[index]), spans, B.beyond(q)), B.limits(name, q)
            for field in ("lower", "upper"):
                ends_of = getattr(one, field), getattr(wanted, field)
                assert np.allclose(*ends_of, rtol=0.0, atol=ROUNDING, equal_nan=True), (name, q)
            assert (one.lower_stop, one.upper_stop) == (wanted.lower_stop, wanted.upper_stop)
    if any(boundary.has_size or boundary.is_stop for boundary in B):  # two mere points are hardly ever in the way
        assert stopped & set(B.names)


def test_what_does_not_depend_on_a_coordinate_is_never_brought_near(load_text: Load) -> None:
    B = load_text(BESIDE).boundaries
    assert (rates_of(B, 0) > 0.0).tolist() == [True, False]
    assert (rates_of(B, 1) > 0.0).tolist() == [False, True]
    assert np.all(
        np.isinf(rates_of(load_text(ZOO["slides"]).boundaries, 0))
        | (rates_of(load_text(ZOO["slides"]).boundaries, 0) == 0.0)
    )


def test_of_two_boundaries_that_stop_at_one_place_the_first_is_named(load_text: Load) -> None:
    """All lengths of one are twice those of the other, which changes no angle; the smaller one is looked at first."""
    text = robot_xml(
        [joint("q1", "revolute", "base", "a"), joint("q2", "revolute", "a", "b", xyz="0 0 1")],
        {
            "p": ("base", "0.2 0.01 0.1"),
            "s": ("a", "0.1 0 0.3"),
            "p2": ("base", "0.4 0.02 0.2"),
            "s2": ("a", "0.2 0 0.6"),
        },
        [],
        '<pinbound:boundary name="twice" a="p2" b="s2" min_distance="0.2"/>'
        '<pinbound:boundary name="once" a="p" b="s" min_distance="0.1"/>',
    )
    robot = load_text(text)
    Q = np.array([[0.0, 0.0], [-0.5, 0.1], [2.0, 0.0]])
    found, named = robot.boundaries.limits_table("q1", Q)
    assert "once" not in named
    assert np.count_nonzero(named == "twice") >= 2
    for q, ends, names in zip(Q, found, named, strict=True):
        one = robot.boundaries.limits("q1", q)
        assert (one.lower, one.upper) == tuple(ends)
        assert (one.lower_stop, one.upper_stop) == tuple(names)


def test_bodies_that_a_joint_without_limits_may_meet_are_found(load_text: Load) -> None:
    """A whole turn decides; each end is the one of all boundaries, whether q's value is one turn further or not."""
    B = load_text(ENDLESS).boundaries
    free = [q for q in np.random.default_rng(5).uniform(-1.5, 1.5, (200, 3)) if B.free(q)][:3]
    kinds = set[bool]()
    for q in free:
        found = B.limits("j4", q)
        spans = [(b.name, b.span("j4", q, (-np.inf, np.inf), True)) for b in B]
        wanted = CoordinateLimits.of("j4", float(q[2]), spans, ())
        assert np.allclose((found.lower, found.upper), (wanted.lower, wanted.upper), rtol=0.0, atol=ROUNDING)
        assert (found.lower_stop, found.upper_stop) == (wanted.lower_stop, wanted.upper_stop)
        further = B.limits("j4", q + np.array([0.0, 0.0, 2.0 * np.pi]))
        assert (further.lower_stop, further.upper_stop) == (found.lower_stop, found.upper_stop)
        kinds.add(bool(np.isinf(found.upper)))
    assert kinds == {True, False}


@pytest.mark.parametrize(("kind", "more"), [("prismatic", ""), ("revolute", "q 0.02 0")])
def test_what_slides_repeats_with_no_turn(load_text: Load, kind: str, more: str) -> None:
    """Free over 2 pi of a slide, or of a screw, is not free for ever."""
    joints = [joint("q", kind, "base", "a", axis="0 0 1", limit="-50 50")]
    joints += [joint("s", "prismatic", "a", "b", axis="0 0 1", limit="-9 9", mimic=more)] if more else []
    tip = "b" if more else "a"
    height = 0.6 if more else 20.0
    marks = f'<pinbound:box name="roof" link="base" xyz="0 0 {height}" rpy="0 0 0" size="1 1 0.1"/>'
    marks += f'<pinbound:segment name="rod" link="{tip}" xyz_a="0.1 0 0" xyz_b="0.2 0 0.1" radius="0.01"/>'
    B = load_text(robot_xml(joints, {}, [("roof", "rod")], marks)).boundaries
    found = B.limits("q", [0.0])
    rate = 0.02 if more else 1.0
    assert (found.lower_stop, found.upper_stop) == ("q", "roof_rod")
    assert found.upper == pytest.approx((height - 0.05 - 0.1 - 0.01) / rate, abs=1e-9)


def test_few_bodies_are_looked_for_exactly(load_text: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    B, asked = load_text(BODIES).boundaries, list[str]()
    spanned = type(B[0]).span

    def span(boundary: Any, *arguments: Any) -> Any:
        asked.append(boundary.name)
        return spanned(boundary, *arguments)

    monkeypatch.setattr(type(B[0]), "span", span)
    free = [q for q in some(load_text(BODIES), 100, 3) if B.free(q)][:3]
    for q in free:
        for coordinate in ("j1", "j2", "j4"):
            B.limits(coordinate, q)
    assert len(asked) < 0.2 * len(free) * 3 * len(B)
