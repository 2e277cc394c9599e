"""Allowed arcs: round-trip laws on robots we did not make, and oracles for every way a path may use a coordinate."""

import importlib.metadata
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.evaluate import numeric
from pinbound.limits.isolation import common_period
from pinbound.limits.univariate import AllowedArcs, allowed_arcs_table
from pinbound.path.chain import Chain, HullChain
from pinbound.path.kind import Kind
from pinbound.path.relative import RelativePath

ROBOTS = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ARMS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", ("shoulder_link", "forearm_link", "wrist_2_link", "wrist_3_link")),
    "panda": ("panda_description/urdf/panda.urdf", ("panda_link1", "panda_link3", "panda_link5", "panda_hand")),
    "talos": (
        "talos_data/robots/talos_left_arm.urdf",
        ("arm_left_1_link", "arm_left_3_link", "arm_left_5_link", "arm_left_7_link"),
    ),
}
END = 1e-10  # m, the clearance allowed at an end
STEP = 1e-7  # rad, to either side of it


def path_of(chain: Chain) -> RelativePath:
    """Return a path between two points that is only known by its reduced chain."""
    whole = HullChain(chain)
    return RelativePath(Kind.BRANCHED, "base", whole, whole, whole, 0)


def allowed_arcs(chain: Chain, index: int, name: str, q: Any, *rest: Any, **more: Any) -> AllowedArcs:
    return allowed_arcs_table(path_of(chain), index, name, q[None], *rest, **more)[0]


@pytest.fixture(scope="module", params=sorted(ARMS))
def arm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    """A spatial robot with spheres on four links, every pair of them a boundary."""
    file, links = ARMS[request.param]
    rng = np.random.default_rng(5)
    lines = ["points:"]
    for i, link in enumerate(links):
        x, y, z = rng.uniform(-0.05, 0.05, 3)
        lines.append(f"- {{name: p{i}, link: {link}, xyz: [{x:.4f}, {y:.4f}, {z:.4f}], radius: {0.03 + 0.02 * i:.3f}}}")
    lines.append("boundaries:")
    for a, b in itertools.combinations(range(len(links)), 2):
        if b > a + 1:
            lines.append(f"- {{name: beta_{a}{b}, a: p{a}, b: p{b}, min_distance: 0.08}}")
    lines.append("home: {}")
    sidecar = tmp_path_factory.mktemp("arm") / "marks.yaml"
    sidecar.write_text("\n".join(lines).replace("home: {}", ""))
    return pb.load(ROBOTS / "example-robot-data" / "robots" / file, annotations=sidecar)


def ends_of(arcs: AllowedArcs) -> list[tuple[float, float]]:
    """Return each finite end with the direction that leads inside, ends of the window left out."""
    found = []
    for lower, upper in arcs.intervals:
        if np.isfinite(lower) and lower > arcs.window[0]:
            found.append((lower, 1.0))
        if np.isfinite(upper) and upper < arcs.window[1]:
            found.append((upper, -1.0))
    return found


def test_arcs_end_in_contact_on_spatial_robots(arm: pb.Robot) -> None:
    rng = np.random.default_rng(11)
    low, high = np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0)
    Q = rng.uniform(low, high, (150, len(low)))
    seen = 0
    for boundary in arm.boundaries:
        for name in boundary.coordinates:
            index = arm.coordinates.index(name)
            table = boundary.limits(name, Q, window=(-4.0, 4.0))
            for row, q in enumerate(Q):
                for end, inwards in ends_of(table[row]):
                    at, inside, outside = np.tile(q, (3, 1))
                    at[index], inside[index], outside[index] = end, end + inwards * STEP, end - inwards * STEP
                    clearance = boundary.clearance(np.stack((at, inside, outside)))
                    assert abs(clearance[0]) < END
                    slope = abs(boundary.gradient(at)[index])
                    if slope * STEP > 1e-11:  # otherwise it grazes, and there is no outside at this step
                        assert clearance[1] > 0.0 > clearance[2]
                        seen += 1
    assert seen > 300


def test_arcs_agree_with_dense_sampling(arm: pb.Robot) -> None:
    rng = np.random.default_rng(12)
    grid = np.linspace(-3.0, 3.0, 2001)
    for boundary in arm.boundaries:
        for name in boundary.coordinates:
            index = arm.coordinates.index(name)
            q = rng.uniform(-1.5, 1.5, len(arm.coordinates))
            Q = np.tile(q, (len(grid), 1))
            Q[:, index] = grid
            clearance = boundary.clearance(Q)
            arcs = boundary.limits(name, q, window=(-3.1, 3.1))
            allowed = np.array([arcs.contains(x) for x in grid])
            sure = np.abs(clearance) > 1e-9
            np.testing.assert_array_equal(allowed[sure], clearance[sure] > 0.0)


def test_many_equals_one(arm: pb.Robot) -> None:
    Q = np.random.default_rng(13).uniform(-1.5, 1.5, (40, len(arm.coordinates)))
    for boundary in arm.boundaries:
        for name in boundary.coordinates:
            index = arm.coordinates.index(name)
            table = boundary.limits(name, Q)
            around = table.around(Q[:, index])
            for row, q in enumerate(Q):
                one = boundary.limits(name, q)
                np.testing.assert_array_equal(table[row].intervals, one.intervals)
                assert (one.around(q[index]) or (np.nan, np.nan)) == pytest.approx(tuple(around[row]), nan_ok=True)


def test_limits_of_a_set_agree_one_by_one_and_in_a_table(arm: pb.Robot) -> None:
    Q = np.random.default_rng(14).uniform(np.maximum(arm.lower, -2), np.minimum(arm.upper, 2), (60, len(arm.lower)))
    for name in arm.coordinates:
        ends, stops = arm.boundaries.limits_table(name, Q)
        for row, q in enumerate(Q):
            one = arm.boundaries.limits(name, q)
            np.testing.assert_allclose(ends[row], [one.lower, one.upper], rtol=0, atol=1e-14)
            assert (one.lower_stop or "", one.upper_stop or "") == tuple(stops[row])


def chain(kind: str, rng: np.random.Generator) -> tuple[Chain, float]:
    """Return a random chain of one coordinate used in several ways, and a threshold near its norms."""
    factors = {
        "twice": [1.0, 1.0],
        "thrice": [1.0, -2.0, 0.5],
        "incommensurate": [1.0, 2.0**0.5],
        "screw": [1.0],
        "slider": [],
    }[kind]
    k = len(factors)
    axes = rng.normal(size=(k, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    slides = np.zeros((k + 1, 3, 1))
    if kind in ("screw", "slider"):
        slides[-1, :, 0] = rng.normal(size=3) * 0.1
    offsets = rng.normal(size=(k + 1, 3)) * 0.2
    made = Chain(offsets, slides, axes.reshape(k, 3), np.array(factors).reshape(k, 1), 1.0)
    norms = numeric.norm(numeric.positions(made, rng.uniform(-3, 3, (200, 1))))
    return made, float(rng.uniform(norms.min(), norms.max()))


@pytest.mark.parametrize("kind", ["twice", "thrice", "incommensurate", "screw", "slider"])
@pytest.mark.parametrize("seed", range(12))
def test_every_use_of_a_coordinate(kind: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(kind)])
    made, threshold = chain(kind, rng)
    arcs = allowed_arcs(made, 0, "q", np.zeros(1), threshold, 1e-9, window=(-5.0, 5.0))
    grid = np.linspace(-4.99, 4.99, 4001)
    clearance = numeric.norm(numeric.positions(made, grid[:, None])) - threshold
    sure = np.abs(clearance) > 1e-9
    allowed = np.array([arcs.contains(x) for x in grid])
    np.testing.assert_array_equal(allowed[sure], clearance[sure] > 0.0)
    for end, _ in ends_of(arcs):
        assert abs(float(numeric.norm(numeric.positions(made, np.array([[end]])))[0]) - threshold) < END


def test_angles_of_several_coordinates_end_in_contact() -> None:
    """MinervaBotV3's elbow turns by q3 - q2: the other coordinate shifts the arc."""
    robot = pb.load("minervabot_v3")
    Q = np.random.default_rng(17).uniform(-3.0, 3.0, (50, 3))
    for boundary in robot.boundaries:
        for name in boundary.coordinates:
            index = robot.coordinates.index(name)
            table = allowed_arcs_table(boundary.path, index, name, Q, 0.005, 2e-5)
            for row, q in enumerate(Q):
                for end, inwards in ends_of(table[row]):
                    at = np.tile(q, (3, 1))
                    at[:, index] = end + inwards * np.array([0.0, STEP, -STEP])
                    clearance = boundary.norm(at) - 0.005
                    assert abs(clearance[0]) < END
                    assert clearance[1] > 0.0 > clearance[2]


def test_commensurate_contacts_repeat() -> None:
    made, threshold = chain("thrice", np.random.default_rng(3))
    arcs = allowed_arcs(made, 0, "q", np.zeros(1), threshold, 1e-9)
    assert arcs.period == pytest.approx(4 * np.pi)
    grid = np.linspace(-30, 30, 3001)
    clearance = numeric.norm(numeric.positions(made, grid[:, None])) - threshold
    sure = np.abs(clearance) > 1e-9
    np.testing.assert_array_equal(np.array([arcs.contains(x) for x in grid])[sure], clearance[sure] > 0.0)


@pytest.mark.parametrize("depth", [1e-6, 1e-9, 1e-11, 0.0, -1e-6])
def test_roots_that_almost_or_just_touch(depth: float) -> None:
    """R(q) R(q) about one axis and a tilted one: the norm's minimum is lowered to the threshold, and past it."""
    made, _ = chain("twice", np.random.default_rng(8))
    grid = np.linspace(-np.pi, np.pi, 200001)
    norms = numeric.norm(numeric.positions(made, grid[:, None]))
    i = int(np.argmin(norms))
    fine = np.linspace(grid[i - 1], grid[i + 1], 200001)
    least = numeric.norm(numeric.positions(made, fine[:, None])).min()
    arcs = allowed_arcs(made, 0, "q", np.zeros(1), float(least + depth), 1e-12)
    if depth < 0.0:
        assert np.isinf(arcs.intervals).all()
    elif depth >= 1e-11:
        width = arcs.period - (arcs.intervals[0, 1] - arcs.intervals[0, 0])
        assert len(arcs.intervals) == 1
        assert 0.0 < width < 50 * depth**0.5
        beyond = (arcs.intervals[0, 0] - grid[i]) % arcs.period  # contact begins at the minimum, not elsewhere
        assert min(beyond, arcs.period - beyond) < width + 1e-4
    else:  # at rounding: contact there or not, but nothing else is lost
        width = 0.0 if np.isinf(arcs.intervals).all() else arcs.period - float(np.ptp(arcs.intervals))
        assert width < 1e-5


def test_a_slider_is_stopped_in_closed_form() -> None:
    slides = np.zeros((1, 3, 1))
    slides[0, :, 0] = 1.0, 0.0, 0.0
    made = Chain(np.array([[0.1, 0.03, 0.0]]), slides, np.empty((0, 3)), np.empty((0, 1)), 1.0)
    arcs = allowed_arcs(made, 0, "q", np.zeros(1), 0.05, 2e-5)
    np.testing.assert_allclose(arcs.intervals, [[-np.inf, -0.14], [-0.06, np.inf]])
    assert allowed_arcs(made, 0, "q", np.zeros(1), 0.02, 2e-5).contains(-0.1)
    cut = allowed_arcs(made, 0, "q", np.zeros(1), 0.03, 2e-5)  # grazes: one point is cut out
    assert not cut.contains(-0.1)
    assert cut.contains(-0.1 + 1e-9)


def test_no_window_for_contacts_that_never_repeat() -> None:
    made, threshold = chain("screw", np.random.default_rng(1))
    with pytest.raises(pb.UnsupportedError, match="window"):
        allowed_arcs(made, 0, "q", np.zeros(1), threshold, 1e-9)


def test_no_configuration_gives_no_row() -> None:
    made, threshold = chain("twice", np.random.default_rng(1))
    assert len(allowed_arcs_table(path_of(made), 0, "q", np.empty((0, 1)), threshold, 1e-9)) == 0


def test_common_period_of_irrational_angles_is_none() -> None:
    assert common_period(np.array([1.0, np.pi])) is None
    assert common_period(np.array([2.0, 3.0])) == pytest.approx(2 * np.pi)


def test_bad_input_is_refused() -> None:
    boundary = pb.load("minervabot_v3").boundaries["beta_4"]
    with pytest.raises(pb.UnknownNameError, match="q9"):
        boundary.limits("q9", [0.0, 0.0, 0.0])
    with pytest.raises(pb.DimensionError, match="finite"):
        boundary.limits("q3", [0.0, np.nan, 0.0])
    with pytest.raises(pb.UnsupportedError, match="does not depend"):
        boundary.limit_expressions("q1")


def test_symbolic_limits_equal_the_numbers(arm: pb.Robot) -> None:
    rng = np.random.default_rng(21)
    checked = 0
    for _ in range(200):
        boundary = arm.boundaries[int(rng.integers(len(arm.boundaries)))]
        name = boundary.coordinates[int(rng.integers(len(boundary.coordinates)))]
        q = rng.uniform(np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0))
        arcs = boundary.limits(name, q)
        if not len(arcs.intervals) or not np.isfinite(arcs.intervals).all():
            continue
        found = boundary.limit_expressions(name)
        values = dict(zip(arm.coordinates, q.tolist(), strict=True))
        substitution = {s: values[s.name] for s in (found.upper + found.period).free_symbols}
        for symbolic, number in ((found.upper, arcs.intervals[0, 0]), (found.lower, arcs.intervals[0, 1])):
            difference = float(symbolic.subs(substitution)) - number
            assert abs((difference + np.pi) % (2 * np.pi) - np.pi) < 1e-7
        assert r"\operatorname{a" in found.latex()
        checked += 1
        if checked == 2:
            return
    pytest.fail("no configuration with contacts was drawn")


def test_the_ten_contacts_in_symbols() -> None:
    robot = pb.load("minervabot_v3")
    for boundary in robot.boundaries:
        contact = boundary.contact
        found = boundary.limit_expressions(boundary.coordinates[-1])
        others = dict.fromkeys(found.aligned.free_symbols, 0)
        assert float(found.aligned.subs(others)) == pytest.approx(contact.angle, abs=1e-13)
        assert found.half_width == 0


ONE = (
    '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="w"/><link name="m"/><joint name="q" type="{kind}">'
    '<parent link="w"/><child link="m"/><axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="1" '
    'velocity="1"/></joint><pinbound:annotations>{marks}<pinbound:boundary name="beta" a="A" b="B"/>'
    "</pinbound:annotations></robot>"
)


def box(name: str, link: str, corner: str, size: str, radius: float = 0.0) -> str:
    x, y, z = size.split()
    return (
        f'<pinbound:sweep name="{name}" link="{link}" xyz="{corner}" ways="{x} 0 0 0 {y} 0 0 0 {z}" radius="{radius}"/>'
    )


def bar(name: str, link: str, start: str, end: str, radius: float) -> str:
    return f'<pinbound:segment name="{name}" link="{link}" xyz_a="{start}" xyz_b="{end}" radius="{radius}"/>'


SLIDING = {
    "face to face": (
        "0 0 1",
        box("A", "w", "-0.75 -0.75 2.25", "1.5 1.5 1.5") + box("B", "m", "-0.75 -0.75 -0.75", "1.5 1.5 1.5"),
        1.5 - 2e-5,
    ),
    "parallel capsules": ("1 0 0", bar("A", "w", "3 0 0", "3 0 2", 0.1) + bar("B", "m", "0 0 0", "0 0 2", 0.1), 2.8),
    "along itself": ("0 0 1", bar("A", "w", "0 0 4", "0 0 6", 0.0) + bar("B", "m", "0 0 0", "0 0 1", 0.0), 3.0 - 2e-5),
    "into a box": (
        "1 0 0",
        box("A", "w", "2 -1 -1", "2 2 2") + '<pinbound:point name="B" link="m" xyz="0 0 0"/>',
        2.0 - 2e-5,
    ),
    "prism into a box": (
        "1 0 0",
        box("A", "w", "2 -1 -1", "4 4 4")
        + '<pinbound:sweep name="B" link="m" xyz="0 0 0" ways="0.5 0 0 0.2 0.4 0 -0.2 0.4 0 0 0 0.5"/>',
        1.3 - 2e-5,
    ),
    "plates in one plane": (
        "1 0 0",
        '<pinbound:sweep name="A" link="w" xyz="3 0 0" ways="1 0 0 0 1 0"/>'
        '<pinbound:sweep name="B" link="m" xyz="0 0 0" ways="1 0 0 0 1 0"/>',
        2.0 - 2e-5,
    ),
    "bar on a pole": (
        "1 0 0",
        '<pinbound:line name="A" link="w" xyz="3 0 0" direction="0 0 1"/>' + bar("B", "m", "0 0 0", "0 0 1", 0.1),
        2.9,
    ),
    "box to the floor": (
        "0 0 -1",
        '<pinbound:plane name="A" link="w" xyz="0 0 -3" normal="0 0 1"/>' + box("B", "m", "0 0 0", "1 1 1"),
        3.0,
    ),
}


@pytest.mark.parametrize("travel", [4.5, 100.0, 1e8, 1e200])
@pytest.mark.parametrize("name", SLIDING)
def test_bodies_that_slide_stop_where_they_meet_however_far_they_may_go(
    name: str, travel: float, load_text: Any
) -> None:
    """They overlap for whole stretches beyond: the distance is zero there, not the contact distance."""
    axis, marks, stop = SLIDING[name]
    robot = load_text(ONE.format(kind="prismatic", axis=axis, lower=-1, upper=travel, marks=marks))
    found = robot.boundaries.limits("q", [0.0])
    assert (found.lower, found.lower_stop, found.upper_stop) == (-1.0, "q", "beta")
    assert found.upper == pytest.approx(stop, abs=4e-15)
    ends, stops = robot.boundaries.limits_table("q", [[0.0], [-0.5]])
    assert np.all(ends[:, 1] == found.upper)
    assert stops[:, 1].tolist() == ["beta", "beta"]
    beyond = robot.boundaries.limits("q", [min(travel, 1e3)])
    arcs = robot.boundaries["beta"].limits("q", [0.0])
    assert arcs.contains(min(travel, 1e3)) == (beyond.blocked_by == ())


TURNING = {
    "corner into a box": (box("A", "w", "1 1 -1", "0.9 0.9 2"), '<pinbound:point name="B" link="m" xyz="1.4 0 0"/>'),
    "over a face, with room": (box("A", "w", "-1 -1 -1", "2 2 2"), box("B", "m", "-0.5 -0.5 1.05", "1 1 1")),
    "plates in one plane": (
        '<pinbound:sweep name="A" link="w" xyz="0.5 0.5 0" ways="1 0 0 0 1 0"/>',
        '<pinbound:sweep name="B" link="m" xyz="0.3 -0.6 0" ways="1 0 0 0 0.5 0"/>',
    ),
    "a side that lands flat": (box("A", "w", "1 -2 -1", "2 2 2"), box("B", "m", "1 0.05 -1", "2 1.9 2")),
    "a face that slides at the contact distance": (
        box("A", "w", "1 1 -1", "0.9 0.9 2"),
        box("B", "m", "0.9 -0.1 1.1", "0.5 0.2 0.1", 0.1),
    ),
}


@pytest.mark.parametrize("name", TURNING)
def test_bodies_that_turn_stop_where_they_meet(name: str, load_text: Any) -> None:
    """A stop is a contact, and all before it is free, by dense sampling."""
    robot = load_text(ONE.format(kind="revolute", axis="0 0 1", lower=-3, upper=3, marks="".join(TURNING[name])))
    boundary = robot.boundaries["beta"]
    found = robot.boundaries.limits("q", [0.0])
    free = np.linspace(found.lower, found.upper, 20_001)[1:-1, None]
    level = boundary.contact_distance - boundary.threshold
    assert boundary.clearance(free).min() > level - 1e-12
    for end, stop, side in ((found.lower, found.lower_stop, -1.0), (found.upper, found.upper_stop, 1.0)):
        if stop == "beta":
            assert abs(boundary.clearance([end]) - level) < 1e-11
            assert boundary.clearance([end + 1e-6 * side]) <= level + 1e-12
        else:
            assert abs(end) == 3.0


def test_a_joint_that_turns_and_slides_is_searched_outwards(load_text: Any) -> None:
    """A screw of 10^7 turns: the nearest contacts are found, and lists of all are refused with their number."""
    text = ONE.format(
        kind="revolute",
        axis="0 0 1",
        lower=-6e7,
        upper=6e7,
        marks='<pinbound:segment name="A" link="w" xyz_a="0.2 0 2" xyz_b="0.3 0 2" radius="0.05"/>'
        '<pinbound:segment name="B" link="n" xyz_a="0.25 0 0" xyz_b="0.25 0 0.01" radius="0.05"/>',
    )
    screw = (
        '<link name="n"/><joint name="s" type="prismatic"><parent link="m"/><child link="n"/><axis xyz="0 0 1"/>'
        '<limit lower="-1e9" upper="1e9" effort="1" velocity="1"/><mimic joint="q" multiplier="0.01"/></joint>'
    )
    robot = load_text(text.replace("<pinbound:annotations>", screw + "<pinbound:annotations>"))
    boundary = robot.boundaries["beta"]
    found = robot.boundaries.limits("q", [0.5])
    assert (found.lower_stop, found.upper_stop) == ("q", "beta")
    assert abs(boundary.clearance([found.upper])) < 1e-11
    assert boundary.clearance(np.linspace(0.0, found.upper, 50_001)[:-1, None]).min() > 0.0
    high = robot.boundaries.limits("q", [5e7])  # behind all contacts
    assert (high.lower_stop, high.upper_stop) == ("beta", "q")
    assert abs(boundary.clearance([high.lower])) < 1e-11
    assert boundary.clearance(np.linspace(high.lower, 400.0, 50_001)[1:, None]).min() > 0.0
    ends, _ = robot.boundaries.limits_table("q", [[0.5], [5e7]])
    np.testing.assert_allclose(ends, [[found.lower, found.upper], [high.lower, high.upper]], rtol=1e-15)
    with pytest.raises(pb.UnsupportedError, match=r"rotates the path 1\.91e\+07 times"):
        boundary.limits("q", [0.5], window=(-6e7, 6e7))


@pytest.mark.parametrize("multiplier", ["0", "1e6", "-1e6", "2", "0.5"])
def test_multipliers_of_any_size(multiplier: str, load_text: Any) -> None:
    """A coordinate that turns two joints, one of them not at all, or a million times as fast."""
    text = ONE.format(
        kind="revolute",
        axis="0 0 1",
        lower=-3,
        upper=3,
        marks='<pinbound:point name="A" link="w" xyz="0.9 0.8 0" radius="0.1"/>'
        '<pinbound:point name="B" link="n" xyz="0.2 0 0" radius="0.05"/>',
    )
    elbow = (
        '<link name="n"/><joint name="s" type="continuous"><parent link="m"/><child link="n"/>'
        f'<origin xyz="1 0 0"/><axis xyz="0 0 1"/><mimic joint="q" multiplier="{multiplier}"/></joint>'
    )
    robot = load_text(text.replace("<pinbound:annotations>", elbow + "<pinbound:annotations>"))
    boundary = robot.boundaries["beta"]
    values = [0.0, -2.0, 2.0]
    if abs(float(multiplier)) == 1e6:  # where the elbow is near, contact comes within a turn; elsewhere not for 10,000
        with pytest.raises(pb.UnsupportedError, match="within 10000 turns"):
            robot.boundaries.limits("q", [0.0])
        assert robot.boundaries.limits("q", [0.0], window=(-0.05, 0.05)).upper_stop == "q"
        turns = 0.7 + np.arange(64) * 1e-7
        values = turns[boundary.clearance(turns[:, None]) > 0.01][:3].tolist()
    for value in values:
        found = robot.boundaries.limits("q", [value])
        assert not found.blocked_by
        inside = np.linspace(max(found.lower, -3), min(found.upper, 3), 20_001)[1:-1, None]
        assert boundary.clearance(inside).min() > -1e-9
        for end, stop, side in ((found.lower, found.lower_stop, -1.0), (found.upper, found.upper_stop, 1.0)):
            if stop == "beta":
                assert abs(boundary.clearance([end])) < 1e-9
                assert boundary.clearance([end + side * 1e-9]) < 1e-8
        ends, _ = robot.boundaries.limits_table("q", [[value]])
        np.testing.assert_allclose(ends, [[found.lower, found.upper]], rtol=1e-12)


def test_windows_that_cannot_be_meant_are_refused(arm: pb.Robot) -> None:
    name, q = arm.coordinates[1], arm.home
    for window in ((1.0, -1.0), (0.0, 0.0), (np.nan, 1.0), (0.0,), (0.0, 1.0, 2.0), "low", 3.0):
        for ask in (arm.boundaries.limits, arm.boundaries[0].limits):
            with pytest.raises(pb.DimensionError, match="window"):
                ask(name, q, window=window)
    value = float(q[1])
    with pytest.raises(pb.DimensionError, match="outside the window"):
        arm.boundaries.limits(name, q, window=(value + 1.0, value + 2.0))
    assert not arm.boundaries.limits(name, q, window=(value, value + 1.0)).blocked_by


def test_limits_with_its_arguments_exchanged_says_what_a_coordinate_is() -> None:
    robot = pb.load("minervabot_v3")
    with pytest.raises(pb.UnknownNameError, match="q1, q2, q3"):
        robot.boundaries.limits(robot.home, "q2")  # type: ignore[arg-type]
    with pytest.raises(pb.UnknownNameError, match="q1, q2, q3"):
        robot.boundaries["beta_4"].limits(robot.home, "q2")  # type: ignore[arg-type]
