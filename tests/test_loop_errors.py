"""Loops whose sides differ: every joint and link is within what is stated of the linkage as written."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import pinbound as pb
from loops import Joint, Loop, judge, marked, random_loop
from pinbound.boundaries.boundary_set import BoundarySet
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

GROUND, CRANK = 0.3, 0.12


def crank_loop(off: float, lower: float = 0.2, upper: float = 2.9, **more: object) -> Loop:
    """Return a four-bar along x, its coupler longer by `off`."""
    joints = [
        Joint("A", "base", "crank", 0j, 1, lower, upper),
        Joint("B", "crank", "coupler", complex(CRANK), 1),
        Joint("D", "base", "rocker", complex(GROUND), 1),
    ]
    pins = ("coupler", complex(GROUND + off)), ("rocker", complex(CRANK))
    return Loop(joints, pins, {"A": 1.0, "B": -1.0, "D": 1.0}, **more)  # type: ignore[arg-type]


WALL = (
    '<pinbound:point name="tip" link="rocker" xyz="0.4 0 0"/><pinbound:point name="wall" link="base" '
    'xyz="0.1 -0.25 0" radius="0.02"/><pinbound:boundary name="beta" a="tip" b="wall"/>'
)


def test_random_loops_stay_within_their_stated_errors(load_text: Load) -> None:
    """Newton at 45 digits on the loop as written; `benchmarks/closures_campaign.py` does the same at length."""
    answered = 0
    for number in range(60):
        rng = np.random.default_rng([17, number])
        loop = random_loop(rng)
        try:
            robot = load_text(loop.urdf(marked(loop, rng)))
        except pb.InputError as error:
            assert "flat pose" in str(error) or "home is outside" in str(error)
            continue
        if robot.closures[0].deviations:
            found = judge(loop, robot, rng, poses=1)
            assert found.holds, (number, found)
            answered += 1
    assert answered > 50


def test_of_a_loop_that_is_not_exact_every_side_counts(load_text: Load) -> None:
    """A shoulder 1.4 pm wide is rounding in an exact loop, and a seventh of what a loop of 8 pm is off."""
    joints = [
        Joint("arm", "base", "upper", 0j, 1, -1.0, 1.0),
        Joint("elbow", "upper", "fore", 0.5 + 0j, 1, 0.1, 1.6),
        Joint("crank", "base", "short", 1.2e-12 + 0.7e-12j, 1, -1.0, 3.0),
        Joint("rod", "short", "bar", 0.1 + 0j, -1),
    ]
    home = {"arm": 0.0, "elbow": 1.0, "crank": 1.0, "rod": 1.0}
    loop = Loop(joints, (("bar", 0.5 + 8e-12 + 0j), ("fore", 0.1 + 0j)), home)
    rng = np.random.default_rng(3)
    robot = load_text(loop.urdf(marked(loop, rng)))
    assert robot.closures[0].deviations
    found = judge(loop, robot, rng, poses=8)
    assert found.holds
    assert found.angle > 0.5
    elbow = next(one for one in robot.closures[0].deviations if one.joint == "elbow")
    assert elbow.bound > (8e-12 + abs(joints[2].at)) / (0.1 * np.sin(0.1))


@pytest.mark.parametrize("off", [0.9e-6, -0.9e-6])
def test_a_loop_that_passes_through_its_flat_pose_needs_equal_sides(load_text: Load, off: float) -> None:
    passes = r"differ by 0\.9 um .* passes through its flat pose \(at 'A' = 0 deg\)"
    with pytest.raises(pb.InputError, match=passes) as said:
        load_text(crank_loop(off, lower=-1.0).urdf(WALL))
    assert "limit 'A' to 0.0174533 .. 3.12414 rad" in str(said.value)
    with pytest.raises(pb.InputError, match=r"comes within 0\.229 deg of its flat pose"):
        load_text(crank_loop(off, lower=0.004).urdf(WALL))
    assert load_text(crank_loop(off, lower=0.0174533, upper=3.12414).urdf(WALL)).coordinates == ("A",)


def test_a_loop_of_a_sidecar_is_refused_by_its_file_and_line(load_text: Load) -> None:
    text = crank_loop(0.9e-6, lower=-1.0).urdf(WALL)
    (mark,) = re.findall(r"<pinbound:closure ([^>]*)/>", text)
    fields = {
        key: re.sub(r"^(\S+) (\S+) (\S+)$", r"[\1, \2, \3]", value)
        for key, value in re.findall(r'(\w+)="([^"]*)"', mark)
    }
    fields["passive"] = f"[{', '.join(fields['passive'].split())}]" if "passive" in fields else "[]"
    sidecar = f"closures:\n\n  - {{{', '.join(f'{key}: {value}' for key, value in fields.items() if value != '[]')}}}\n"
    with pytest.raises(pb.InputError, match="passes through its flat pose") as said:
        load_text(text.replace(f"<pinbound:closure {mark}/>", ""), sidecar)
    assert [(one.source, one.line) for one in said.value.problems] == [("robot.pinbound.yaml", 3)]


def test_near_the_flat_pose_a_micrometre_is_not_certified_away(load_text: Load) -> None:
    """The coupling clears the obstacle by a tenth of a millimetre; the linkage as written is in it."""
    loop = crank_loop(0.9e-6, lower=0.02)
    robot = load_text(loop.urdf(WALL))
    end = float(robot.lower[0])
    true = loop.solved({"A": end, "B": -end, "D": end}, ("B", "D"))
    tip, coupled = loop.place("rocker", 0.4 + 0j, true), loop.place("rocker", 0.4 + 0j, {"A": end, "B": -end, "D": end})
    away = complex(tip - coupled)
    assert abs(away) > 1.2e-4
    centre = complex(tip) + away / abs(away) * 0.05
    wall = (
        '<pinbound:point name="tip" link="rocker" xyz="0.4 0 0"/><pinbound:point name="wall" link="base" '
        f'xyz="{centre.real!r} {centre.imag!r} 0" radius="0.05001"/><pinbound:boundary name="beta" a="tip" b="wall"/>'
    )
    robot = load_text(loop.urdf(wall))
    assert robot.boundaries["beta"].clearance([end]) > 1e-4
    assert pb.certify(robot, [[1.0], [end]]).verdict is pb.Verdict.UNDECIDED
    assert pb.certify_box(robot, [end], [1.0]).verdict is pb.Verdict.UNDECIDED
    assert not robot.boundaries.free([end])
    assert not robot.boundaries.free([[end]])[0]
    stop = robot.boundaries.limits("A", [1.0])
    assert stop.lower_stop == "beta"
    assert pb.certify(robot, [[1.0], [stop.lower + 1e-5]]).verdict is pb.Verdict.CERTIFIED


def test_what_is_proven_within_the_limits_is_not_said_outside_them(load_text: Load) -> None:
    robot = load_text(crank_loop(0.9e-6).urdf(WALL))
    for limits in (True, False):
        found = pb.certify(robot, [[1.0], [0.1]], limits=limits)
        assert found.verdict is (pb.Verdict.VIOLATED if limits else pb.Verdict.UNDECIDED)
        assert found.boundaries[0].verdict is pb.Verdict.UNDECIDED
        assert found.lower == -np.inf
        assert "within the joint limits only" in found.notes[-1]
    assert pb.certify_box(robot, [0.1], [1.0], limits=False).verdict is pb.Verdict.UNDECIDED
    inside = pb.certify(robot, [[1.0], [2.0]], limits=False)
    assert (inside.verdict, inside.notes) == (pb.Verdict.CERTIFIED, ())


def test_a_contact_inside_the_band_of_error_costs_no_more_than_one_outside(load_text: Load) -> None:
    """Parts in the band were halved down to rounding, two million boxes for one motion."""
    robot = load_text(crank_loop(8e-5, tolerance=1e-4).urdf(WALL))
    near = replace(robot.boundaries["beta"], min_distance=float(robot.boundaries["beta"].norm([2.5])) - 0.02 + 5e-4)
    whole = replace(robot, boundaries=BoundarySet([near], robot.coordinates, robot.linear_limits, robot.home))
    assert near.place_error > 1e-5
    assert pb.certify(whole, [[1.0], [2.5]]).boxes < 5_000


def test_limits_of_passive_joints_are_narrower_by_their_error(load_text: Load) -> None:
    loop = crank_loop(0.9e-6)
    loop.joints[2].lower, loop.joints[2].upper = 0.5, 2.0
    robot = load_text(loop.urdf(WALL))
    errors = {one.joint: one.bound for one in robot.closures[0].deviations}
    limit = next(limit for limit in robot.linear_limits if limit.joint == "D")
    assert (limit.lower, limit.upper) == (0.5 + errors["D"], 2.0 - errors["D"])
    assert 0.9e-6 / CRANK < errors["D"] < 1.2 * 0.9e-6 / (CRANK * np.sin(0.5))


def test_exact_loops_have_no_error_anywhere(minerva: pb.Robot, load_text: Load) -> None:
    for robot in (minerva, load_text(crank_loop(0.0, lower=-1.0).urdf(WALL))):
        assert [closure.deviations for closure in robot.closures] == [()] * len(robot.closures)
        assert {boundary.place_error for boundary in robot.boundaries} == {0.0}
    assert "(at 'A' = 0 deg): there the linkage can change to its other assembly" in robot.notes[-1]


def test_mimics_that_stand_for_a_loop_carry_its_error(load_text: Load) -> None:
    """The pin is within half a micrometre for every q; the links are off by more where the loop is nearly flat."""
    mimic = {"B": ("A", -1.0, 0.0), "D": ("A", 1.0, 0.0)}
    with pytest.raises(pb.InputError, match="passes through its flat pose"):
        load_text(crank_loop(0.5e-6, lower=-1.0, mimic=mimic).urdf(WALL))
    robot = load_text(crank_loop(0.5e-6, lower=0.02, mimic=mimic).urdf(WALL))
    assert robot.coupling.offset.tolist() == [0.0, 0.0, 0.0]
    errors = {one.joint: one.bound for one in robot.closures[0].deviations}
    assert errors["D"] > 40 * 0.5e-6 / CRANK
    assert load_text(crank_loop(0.0, lower=-1.0, mimic=mimic).urdf(WALL)).closures[0].deviations == ()


def test_a_mimic_whose_offset_misses_the_loop_is_off_by_that(load_text: Load) -> None:
    mimic = {"B": ("A", -1.0, 0.0), "D": ("A", 1.0, 1e-6)}
    robot = load_text(crank_loop(0.0, mimic=mimic).urdf(WALL))
    errors = {one.joint: one.bound for one in robot.closures[0].deviations}
    assert errors["D"] == pytest.approx(1e-6, rel=1e-3)
    assert robot.boundaries["beta"].place_error == pytest.approx(0.4e-6, rel=0.5)
    assert "offsets are 1e-06 rad from those" in " ".join(robot.notes)


def test_loops_that_share_joints_respond_to_each_other(load_text: Load) -> None:
    """A second parallelogram hangs on the first one's rocker: its joints inherit the error, and add none."""
    joints = [
        joint("j1", "revolute", "base", "a", limit="0.3 2.8", axis="0 -1 0"),
        joint("j2", "revolute", "a", "b", xyz="0.2 0 0", axis="0 -1 0", mimic="j1 -1 0"),
        joint("j3", "revolute", "base", "c", xyz="0.3 0 0", axis="0 -1 0", mimic="j1 1 0"),
        joint("j4", "revolute", "c", "d", xyz="0.2 0 0", axis="0 -1 0", mimic="j1 -1 0"),
        joint("j5", "revolute", "base", "e", xyz="0.8 0 0", axis="0 -1 0", mimic="j1 1 0"),
    ]
    loops = (
        '<pinbound:home j1="1.0"/>'
        '<pinbound:closure name="first" link_a="b" xyz_a="0.3000005 0 0" link_b="c" xyz_b="0.2 0 0"/>'
        '<pinbound:closure name="second" link_a="d" xyz_a="0.5 0 0" link_b="e" xyz_b="0.2 0 0"/>'
    )
    points = {"p": ("e", "0.3 0 0"), "w": ("base", "0.5 0 -0.2")}
    robot = load_text(robot_xml(joints, points, [("p", "w")], loops))
    first, second = robot.closures
    assert max(one.bound for one in second.deviations) == 0.0
    rocker = next(one for one in first.deviations if one.joint == "j3")
    assert rocker.response[robot.coupling.joints.index("j5")] == pytest.approx(1.0)
    assert robot.boundaries["p_w"].place_error == pytest.approx(0.3 * rocker.bound, rel=1e-6)
    assert any("'second' shares joints" in note for note in robot.notes)


def test_no_tolerance_makes_the_sides_of_a_tiny_loop_equal(load_text: Load) -> None:
    """A loop of a micrometre is shorter than the tolerance of the pin, and still no parallelogram."""
    joints = [
        Joint("A", "base", "crank", 0j, 1, 0.2, 2.9),
        Joint("B", "crank", "coupler", 2e-7 + 0j, 1),
        Joint("D", "base", "rocker", 3e-7 + 0j, 1),
    ]
    home = {"A": 1.0, "B": -1.0, "D": 1.0}
    other = load_text(Loop(joints, (("coupler", 3e-7 + 0j), ("rocker", 2.5e-7 + 0j)), home).urdf())
    assert any("not equal in two pairs" in note for note in other.notes)  # a four-bar, solved as one
    assert other.closure_residuals(other.home).max() < 1e-20
    mimic = {"B": ("A", -1.0, 0.0), "D": ("A", 1.0, 0.0)}
    with pytest.raises(pb.InputError, match="does not close"):
        load_text(Loop(joints, (("coupler", 3e-7 + 0j), ("rocker", 2.5e-7 + 0j)), home, mimic=mimic).urdf())
    assert load_text(Loop(joints, (("coupler", 3e-7 + 0j), ("rocker", 2e-7 + 0j)), home).urdf()).coordinates == ("A",)


def test_a_stop_is_kept_away_from_by_what_its_arms_may_be_off(load_text: Load) -> None:
    marks = (
        '<pinbound:point name="s" link="rocker" xyz="0.1 0 0"/><pinbound:point name="t" link="base" '
        'xyz="0.3 0.1 0"/><pinbound:boundary name="beta" a="s" b="t"/>'
    )
    robot = load_text(crank_loop(0.9e-6).urdf(marks))
    stop = robot.boundaries["beta"]
    assert stop.is_stop
    meets, arms = 0.5 * np.pi, 2.0 * np.arcsin(stop.place_error / 0.1)
    off = 2.0 * arms  # what certificates keep: no less
    assert stop.place_error > 1e-6
    assert pb.certify(robot, [[1.0], [meets - 1.1 * off]]).verdict is pb.Verdict.CERTIFIED
    assert pb.certify(robot, [[1.0], [meets - 0.2 * off]]).verdict is pb.Verdict.UNDECIDED
    assert pb.certify(robot, [[1.0], [meets + 1.1 * off]]).verdict is pb.Verdict.VIOLATED
    assert robot.boundaries.limits("A", [1.0]).upper == pytest.approx(meets - arms, abs=1e-12)
    assert robot.boundaries.free([[meets - 1.01 * arms], [meets - 0.99 * arms]]).tolist() == [True, False]


def test_a_batch_calls_nothing_free_within_the_error(load_text: Load) -> None:
    from pinbound.batch.evaluation import evaluation_of

    robot = load_text(crank_loop(0.9e-6).urdf(WALL))
    q, boundary = np.array([[2.0]]), robot.boundaries["beta"]
    for share, verdict in ((0.5, "contact"), (1.5, "inside")):
        near = replace(boundary, min_distance=float(boundary.norm(q[0])) - 0.02 - share * boundary.place_error)
        whole = replace(robot, boundaries=BoundarySet([near], robot.coordinates, robot.linear_limits, robot.home))
        with_verdicts = evaluation_of(whole, ("smallest", "verdict"))
        found = replace(with_verdicts, region=None).table(q, 0)[0]["verdict"].to_pylist()
        assert found == [verdict if verdict == "contact" else "free"]


def test_a_pin_within_one_rigid_body_may_miss_by_its_tolerance(load_text: Load) -> None:
    joints = [
        joint("j", "revolute", "base", "a"),
        joint("f", "fixed", "a", "b", xyz="0.1 0 0"),
        joint("g", "fixed", "a", "c", xyz="0 0 0.1"),
    ]
    pin = '<pinbound:closure name="weld" link_a="b" xyz_a="0 0 0.1000005" link_b="c" xyz_b="0.1 0 0"/>'
    robot = load_text(robot_xml(joints, {}, [], pin))
    assert robot.closures[0].deviations == ()
    assert robot.closures[0].bound == pytest.approx(5e-7, rel=1e-6)
