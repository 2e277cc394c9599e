"""Makers' rules: linear limits of several joints, some of which bind where conditions hold only."""

import math
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.boundaries.spans import guarded_spans
from pinbound.exceptions import Problems
from pinbound.model.coupling import Coupling, GuardedLimit, LinearLimit
from pinbound.robot.rules import rule_limits
from robots import joint

SHARED = Path(__file__).resolve().parents[2] / "shared" / "robots"
HEAD = '<robot name="arm" xmlns:pinbound="urn:pinbound:1"><link name="base"/>'
DEGREE = math.pi / 180.0


def arm(rules: str = "", *, more: tuple[str, ...] = (), ranges: tuple[str, str] = ("-25 85", "-25 105")) -> str:
    """Return an arm whose third axis J3 is absolute, by a level link, with ranges in degrees."""
    low, high = (" ".join(str(math.radians(float(end))) for end in one.split()) for one in ranges)
    joints = [
        joint("J2", "revolute", "base", "upper", limit=low),
        joint("level", "revolute", "upper", "elbow", xyz="0 0 0.4", limit="-7 7", mimic="J2 -1 0"),
        joint("J3", "revolute", "elbow", "fore", limit=high),
    ]
    return f"{HEAD}{''.join([*joints, *more])}<pinbound:annotations>{rules}</pinbound:annotations></robot>"


def rule(name: str, coefficients: str, where: str = "", **ends: float) -> str:
    said = " ".join(f'{key}="{value * DEGREE!r}"' for key, value in ends.items())
    return f'<pinbound:rule name="{name}" coefficients="{coefficients}" {said}>{where}</pinbound:rule>'


def condition(coefficients: str, **ends: float) -> str:
    said = " ".join(f'{key}="{value * DEGREE!r}"' for key, value in ends.items())
    return f'<pinbound:where coefficients="{coefficients}" {said}/>'


BETWEEN = rule("between", "J3: 1, J2: -1", lower=-60, upper=60)
FRONT = rule("front", "J2: 1", condition("J3: 1", upper=0), lower=-19)
# a band that binds in a corner only: two ends, two conditions, slanted
BAND = rule("band", "J2: 1, J3: 1", condition("J2: 1", lower=20) + condition("J3: 1, J2: 0.5", lower=10), upper=110)
BOTH = rule("both", "J3: 1", condition("J2: 1", lower=50, upper=70), lower=0, upper=80)
RULES = {"between": BETWEEN, "front": BETWEEN + FRONT, "band": BAND, "both": BOTH, "all": BETWEEN + FRONT + BAND + BOTH}


def load(tmp_path: Path, text: str, **options: object) -> pb.Robot:
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return pb.load(path, **options)  # type: ignore[arg-type]


def keeps(name: str, degrees: np.ndarray) -> np.ndarray:
    """Return which (J2, J3) in degrees keep the rules, written down a second time, by hand."""
    x, y = degrees.T
    kept = np.ones(len(degrees), dtype=bool)
    if name in ("between", "front", "all"):
        kept &= np.abs(y - x) <= 60
    if name in ("front", "all"):
        kept &= (y > 0) | (x >= -19)
    if name in ("band", "all"):
        kept &= ~((x >= 20) & (y + 0.5 * x >= 10)) | (x + y <= 110)
    if name in ("both", "all"):
        kept &= ~((x >= 50) & (x <= 70)) | ((y >= 0) & (y <= 80))
    return kept


@pytest.mark.parametrize("name", RULES)
def test_free_limits_and_regions_follow_the_rules(tmp_path: Path, name: str) -> None:
    robot = load(tmp_path, arm(RULES[name]))
    rng = np.random.default_rng(1)
    degrees = rng.uniform([-25, -25], [85, 105], (2000, 2))
    expected = keeps(name, degrees)
    assert 0 < expected.sum() < len(expected)
    Q = np.radians(degrees)
    free = robot.boundaries.free(Q)
    np.testing.assert_array_equal(free, expected)
    assert [robot.boundaries.free(q) for q in Q[:200]] == expected[:200].tolist()
    regions = pb.feasible_region(robot, ("J2", "J3")).components
    np.testing.assert_array_equal(np.any([one.contains(Q) for one in regions], axis=0), expected)
    share = sum(one.area for one in regions) / (110 * 130 * DEGREE**2)
    assert share == pytest.approx(expected.mean(), abs=0.03)
    for index, coordinate in enumerate(("J2", "J3")):
        ends, stops = robot.boundaries.limits_table(coordinate, Q[:80])
        assert np.array_equal(np.isnan(ends[:, 0]), ~expected[:80])
        for q, end, stop in zip(Q[:80], ends, stops, strict=True):
            if np.isnan(end[0]):
                continue
            for side, sign in ((0, -1.0), (1, 1.0)):
                beside = np.tile(q, (3, 1))
                beside[:, index] = [end[side] - sign * 1e-9, end[side] + sign * 1e-9, 0.5 * (q[index] + end[side])]
                assert robot.boundaries.free(beside).tolist() == [True, False, True]
            found = robot.boundaries.limits(coordinate, q)
            assert (found.lower, found.upper) == tuple(end)
            assert [found.lower_stop, found.upper_stop] == stop.tolist()


def test_a_guarded_rule_gives_the_region_exact_corners(tmp_path: Path) -> None:
    robot = load(tmp_path, arm(BETWEEN + FRONT))
    region = pb.feasible_region(robot)
    corners = [(85, 105), (45, 105), (-25, 35), (-25, 0), (-19, 0), (-19, -25), (35, -25), (85, 25)]
    np.testing.assert_allclose(np.degrees(region.vertices), corners, rtol=0, atol=1e-12)
    names = ["J3 upper", "between upper", "J2 lower", "front where J3 <= 0", "front lower", "J3 lower"]
    assert [edge.name for edge in region.edges] == [*names, "between lower", "J2 upper"]
    assert {edge.source for edge in region.edges} == {"J2", "J3", "between", "front"}
    assert not region.is_convex
    assert region.accuracy == 0.0
    removed = 1.0 - region.area / (110 * 130 * DEGREE**2)
    assert removed == pytest.approx(7 / 26, abs=1e-14)
    # the end belongs to the region, the border of the condition does not: there the rule is asked already
    on_end, on_condition, corner = np.radians([[-19, -10], [-22, 0], [-19, 0]])
    assert [region.contains(q) for q in (on_end, on_condition, corner)] == [True, False, True]
    assert [robot.boundaries.free(q) for q in (on_end, on_condition, corner)] == [True, False, True]
    assert robot.boundaries.free(on_end - [0.9e-12, 0.0])
    assert not robot.boundaries.free(on_end - [1.2e-12, 0.0])
    assert not robot.boundaries.free([on_condition[0], 0.9e-12])
    assert robot.boundaries.free([on_condition[0], 1.2e-12])


def test_makers_examples(tmp_path: Path) -> None:
    """A forearm that may be at most 67 degrees ahead of the arm: 82 at 15, 97 at 30."""
    robot = load(tmp_path, arm(rule("coupling", "J3: 1, J2: -1", upper=67)))
    for arm_at, fore in ((15, 82), (30, 97)):
        found = robot.boundaries.limits("J3", np.radians([arm_at, 20]))
        assert (found.upper_stop, math.degrees(found.upper)) == ("coupling", pytest.approx(fore, abs=1e-12))


@pytest.mark.parametrize("name", RULES)
def test_certificates_of_random_motions(tmp_path: Path, name: str) -> None:
    """CERTIFIED motions keep the rules at every sample; VIOLATED ones have a witness; few are undecided."""
    robot = load(tmp_path, arm(RULES[name]))
    rng = np.random.default_rng(2)
    ends = np.radians(rng.uniform([-25, -25], [85, 105], (30, 2, 2)))
    fractions = np.linspace(0, 1, 400)[:, None]
    verdicts: list[pb.Verdict] = []
    for a, b in ends:
        found = pb.certify(robot, [a, b], limits_only=True)
        kept = keeps(name, np.degrees(a + fractions * (b - a)))
        verdicts.append(found.verdict)
        assert (found.verdict is pb.Verdict.CERTIFIED) == bool(kept.all())
        if found.verdict is pb.Verdict.VIOLATED:
            contact = found.first_contact
            assert contact is not None
            assert not robot.boundaries.free(contact.q)
            first = fractions[np.argmin(kept), 0]
            assert first - 1 / 399 - 1e-6 <= contact.after <= first + 1e-6
    assert {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED} == set(verdicts)


@pytest.mark.parametrize("name", RULES)
def test_certificates_of_random_boxes(tmp_path: Path, name: str) -> None:
    robot = load(tmp_path, arm(RULES[name]))
    rng = np.random.default_rng(3)
    for centre in rng.uniform([-15, -15], [75, 95], (20, 2)):
        half = rng.uniform(0, 12, 2)
        found = pb.certify_box(robot, np.radians(centre - half), np.radians(centre + half), limits_only=True)
        grid = np.stack(np.meshgrid(*(c + h * np.linspace(-1, 1, 41) for c, h in zip(centre, half, strict=True))), -1)
        kept = keeps(name, grid.reshape(-1, 2)).all()
        assert found.verdict is not pb.Verdict.UNDECIDED
        if found.verdict is pb.Verdict.CERTIFIED:
            assert kept
        else:
            assert found.witness is not None
            assert not keeps(name, np.degrees(found.witness)[None])[0]
            assert found.violated is not None
            assert found.violated.split()[0] in RULES


def test_motions_on_the_very_border(tmp_path: Path) -> None:
    robot = load(tmp_path, arm(BETWEEN + FRONT))

    def verdict(*degrees: tuple[float, float]) -> pb.Verdict:
        return pb.certify(robot, np.radians(degrees), limits_only=True).verdict

    assert verdict((-19, -20), (-19, -5)) is pb.Verdict.CERTIFIED  # along the end, which belongs to what is allowed
    assert verdict((-24, 0), (-20, 0)) is pb.Verdict.VIOLATED  # along the condition, which holds there
    assert verdict((-24, 0.001), (-20, 0.001)) is pb.Verdict.CERTIFIED
    assert verdict((-22, 3), (-16, -3)) is not pb.Verdict.CERTIFIED  # through the inner corner
    assert verdict((-22, 3), (-18.9, 0.1), (-16, -3)) is pb.Verdict.CERTIFIED


def test_a_condition_on_a_held_coordinate_makes_a_limit_or_nothing(tmp_path: Path) -> None:
    """In the slice at which the condition holds the rule is an edge of a convex region; in the other it is none."""
    tool = joint("J4", "revolute", "fore", "tool", xyz="0.3 0 0", limit="-1 1")
    robot = load(tmp_path, arm(rule("tool", "J2: 1", condition("J4: 1", lower=0), upper=40), more=(tool,)))
    for at, edge, free in ((0.5, "tool upper", False), (-0.5, "J2 upper", True)):
        region = pb.feasible_region(robot, ("J2", "J3"), at=[0.0, 0.0, at])
        assert region.half_planes
        assert edge in [one.name for one in region.edges]
        assert region.contains([1.0, 0.0, at]) is free
        assert region.fixed == ("J4",)
        with pytest.raises(pb.DimensionError, match="rule tool"):
            region.contains([1.0, 0.0, 0.1])
    region = pb.feasible_region(robot, ("J3", "J4"), at=[1.0, 0.0, -0.5])
    assert {edge.name for edge in region.edges} >= {"tool where J4 >= 0"}
    assert region.contains([1.0, 0.0, -0.1])
    assert not region.contains([1.0, 0.0, 0.1])
    with pytest.raises(pb.DimensionError, match="rule 'tool' forbids it"):
        pb.feasible_region(robot, ("J3", "J4"), at=[1.0, 0.0, 0.5])


def test_rules_of_mimic_joints_are_said_of_q(tmp_path: Path) -> None:
    """`level = -J2`, so that a rule on level + J3 is one on J3 - J2, exactly."""
    robot = load(tmp_path, arm(rule("pair", "level: 1, J3: 1", lower=-60, upper=60)))
    (limit,) = [one for one in robot.linear_limits if one.joint == "pair"]
    assert limit.coefficients.tolist() == [-1.0, 1.0]
    assert limit.offset == 0.0


def test_inverse_kinematics_keeps_guarded_rules(tmp_path: Path) -> None:
    robot = load(tmp_path, arm(BETWEEN + FRONT))
    inside, outside = np.radians([[-10, -20], [-23, -10]])
    targets = [robot.positions("fore", q, (0.3, 0, 0.0)) for q in (inside, outside)]
    found = pb.solve_ik(robot, "fore", targets, xyz=(0.3, 0, 0.0))
    assert found.reached.tolist() == [True, False]
    assert robot.boundaries.free(found.q).all()
    assert "front" in found.limits[1]
    with pytest.raises(pb.DimensionError, match="start"):
        pb.solve_ik(robot, "fore", targets, start=outside, xyz=(0.3, 0, 0.0))


def test_home_is_put_where_the_rules_hold(tmp_path: Path) -> None:
    """At zero the condition holds and the end is passed; the nearest way out is taken."""
    robot = load(tmp_path, arm(rule("front", "J2: 1", condition("J3: 1", upper=5), lower=10)))
    np.testing.assert_allclose(np.degrees(robot.home), [0, 5], atol=1e-6)
    assert robot.boundaries.free(robot.home)
    robot = load(tmp_path, arm(rule("front", "J2: 1", condition("J3: 1", upper=5), lower=3)))
    np.testing.assert_allclose(np.degrees(robot.home), [3, 0], atol=1e-6)
    text = arm(FRONT + '<pinbound:home J2="-0.4" J3="-0.1"/>')
    with pytest.raises(pb.InputError, match="rule 'front' forbids home"):
        load(tmp_path, text)


def test_both_spellings_say_the_same(tmp_path: Path) -> None:
    robot = load(tmp_path, arm(RULES["all"]))
    again = load(tmp_path, arm(), annotations=pb.Annotations(rules=robot.annotations.rules))
    (tmp_path / "rules.yaml").write_text(robot.annotations.to_yaml())
    third = load(tmp_path, arm(), annotations=tmp_path / "rules.yaml")
    fourth = load(tmp_path, arm().replace("<pinbound:annotations></pinbound:annotations>", robot.annotations.to_xml()))
    for other in (again, third, fourth):
        assert [(r.name, r.coefficients, r.lower, r.upper, r.where) for r in other.annotations.rules] == [
            (r.name, r.coefficients, r.lower, r.upper, r.where) for r in robot.annotations.rules
        ]
        assert [one.name for one in other.guarded_limits] == [one.name for one in robot.guarded_limits]
    assert [one.name for one in robot.guarded_limits] == ["front lower", "band upper", "both lower", "both upper"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (rule("r", "J2: 1"), "neither lower nor upper"),
        (rule("r", "J2: 1", lower=3, upper=2), "lower 0.0523599 above upper 0.0349066"),
        (rule("r", "J7: 1", upper=2), "names the joint 'J7', which does not exist"),
        (rule("r", "J2: 1, J2: 2", upper=2), "name 'J2' twice"),
        (rule("r", "J2", upper=2), "coefficients of rule 'r'"),
        (rule("r", "J2: 0", upper=2), "only coefficients of zero"),
        (rule("r", "J2: 1, level: 1", upper=2), "does not depend on q"),
        (rule("r", "J2: 1", condition("J3: 1", lower=1, upper=1), upper=2), "holds at 0.0174533 alone"),
        (rule("r", "J2: 1", condition("J3: 1"), upper=2), "condition 1 of rule 'r' has neither"),
        (rule("r", "J2: 1", condition("J2: 1, level: 1", upper=-1), upper=2), "never holds"),
        (rule("r", "J2: 1", '<pinbound:when upper="1"/>', upper=2), "<when> stands inside"),
        (rule("J2", "J2: 1", upper=2), "has the name of a joint"),
        (rule("r", "J2: 1", upper=2) * 2, "declared twice"),
        ('<pinbound:rule name="r" coefficients="J2: 1" upper="x"/>', "upper of rule 'r'"),
        ('<pinbound:rule name="r" coefficients="J2: 1" uper="1"/>', "unknown attribute 'uper'"),
        ('<pinbound:rule name="r" coefficients="J2: 1" upper="1" where="J3"/>', "where of rule 'r' is 'J3'"),
    ],
)
def test_faults_of_rules_are_told(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(pb.InputError) as caught:
        load(tmp_path, arm(text))
    assert message in str(caught.value)


def test_faults_of_rules_in_a_sidecar_are_told(tmp_path: Path) -> None:
    (tmp_path / "rules.yaml").write_text("rules: [{name: r, coefficients: {J2: 1}, upper: 1, where: {upper: 1}}]")
    with pytest.raises(pb.InputError, match="'where' is not a list"):
        load(tmp_path, arm(), annotations=tmp_path / "rules.yaml")


def test_rules_are_narrower_where_joints_may_leave_the_coupling() -> None:
    """With errors e_j of the joints the rule loses `sum |c_j| e_j` at each end, and its condition gains as much."""
    coupling = Coupling(("a", "b"), ("a", "b", "f"), np.array([[1.0, 0.0], [0.0, 1.0], [1.0, -2.0]]), np.zeros(3))
    low = pb.Condition({"f": 1.0}, upper=0.5)
    rules = [pb.Rule("r", {"f": 2.0, "a": -1.0}, -1.0, 1.0, (low,)), pb.Rule("s", {"f": 2.0, "a": -1.0}, -1.0, 1.0)]
    plain, guarded = rule_limits(rules, coupling, np.array([0.01, 0.0, 0.1]), Problems("test"))
    assert [one.name for one in guarded] == ["r lower", "r upper"]
    assert plain[0].coefficients.tolist() == guarded[0].limit.coefficients.tolist() == [1.0, -4.0]
    limits = (plain[0], guarded[0].limit, guarded[1].limit)
    for one, ends in zip(limits, [(-0.79, 0.79), (-0.79, math.inf), (-math.inf, 0.79)], strict=True):
        assert (one.lower, one.upper) == pytest.approx(ends, abs=1e-15)
    assert guarded[0].where[0].upper == pytest.approx(0.6, abs=1e-15)


def test_what_a_guarded_limit_forbids_of_one_coordinate() -> None:
    """Two conditions that leave one value: it is forbidden, and the way ends there."""
    end = LinearLimit("r", np.array([0.0, 1.0]), 0.0, 5.0, math.inf)
    low = LinearLimit("r", np.array([1.0, 0.0]), 0.0, -math.inf, 1.0)
    high = LinearLimit("r", np.array([1.0, 0.0]), 0.0, 1.0, math.inf)
    spans = guarded_spans(GuardedLimit(end, (low, high)), 0, np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.0, 6.0]]))
    np.testing.assert_array_equal(spans, [[-math.inf, 1], [1, math.inf], [math.nan] * 2, [-math.inf, math.inf]])


def test_a_rule_that_forbids_a_line_has_no_region(tmp_path: Path) -> None:
    where = condition("J3: 1", upper=30) + condition("J3: 1, J2: 1e-14", lower=30)
    robot = load(tmp_path, arm(rule("r", "J2: 1", where, upper=10)))
    with pytest.raises(pb.UnsupportedError, match="has no width"):
        pb.feasible_region(robot)


MG400 = SHARED / "dobot_mg400_official" / "dobot_mg400_official.urdf"
FANUC = SHARED / "fanuc_m410ic_185_botrail" / "fanuc_m410ic_185_botrail_patched.urdf"


@pytest.mark.skipif(not MG400.is_file(), reason="../shared/robots is not there")
def test_mg400_as_published(tmp_path: Path) -> None:
    """Ranges and rule of the maker on its own URDF, unedited: 7/26 of the box are removed, 26.9 %."""
    limits = [f"{{joint: j2, lower: {-25 * DEGREE!r}, upper: {85 * DEGREE!r}}}"]
    limits += [f"{{joint: j3, lower: {-25 * DEGREE!r}, upper: {105 * DEGREE!r}}}"]
    rules = [
        f"{{name: between, lower: {-60 * DEGREE!r}, upper: {60 * DEGREE!r}, coefficients: {{j3: 1, j2: -1}}}}",
        f"{{name: front, lower: {-19 * DEGREE!r}, coefficients: {{j2: 1}}, "
        "where: [{upper: 0.0, coefficients: {j3: 1}}]}",
    ]
    (tmp_path / "mg400.yaml").write_text(f"limits: [{', '.join(limits)}]\nrules: [{', '.join(rules)}]\n")
    robot = pb.load(MG400, annotations=tmp_path / "mg400.yaml")
    region = pb.feasible_region(robot, ("j2", "j3"))
    assert region.area / DEGREE**2 == pytest.approx(10450, abs=1e-9)
    assert 1 - region.area / DEGREE**2 / (110 * 130) == pytest.approx(7 / 26, abs=1e-13)


@pytest.mark.skipif(not FANUC.is_file(), reason="../shared/robots is not there")
def test_fanuc_m410ic_185_by_its_boxes_and_by_the_rule_of_its_sister_arm() -> None:
    robot = pb.load(FANUC)
    box = pb.feasible_region(robot, ("J2", "J3"))
    assert box.area / DEGREE**2 == pytest.approx(144 * 136, abs=1e-9)
    between = pb.Rule("between", {"J2": 1.0, "J3": 1.0}, -70 * DEGREE, 75 * DEGREE)
    ruled = pb.feasible_region(pb.load(FANUC, annotations=pb.Annotations(rules=(between,))), ("J2", "J3"))
    assert ruled.is_convex
    assert ruled.area / DEGREE**2 == pytest.approx(144 * 136 - 35**2 / 2 - 100**2 / 2, abs=1e-9)
    assert {edge.name for edge in ruled.edges} >= {"between upper", "between lower"}


def test_answers_that_know_no_conditions_refuse_them(tmp_path: Path) -> None:
    robot = load(tmp_path, arm(FRONT))
    with pytest.raises(pb.UnsupportedError, match="rule 'front' applies only where"):
        pb.StepBounds(robot)
    with pytest.raises(pb.UnsupportedError, match="Remove the condition"):
        pb.limit_table(robot, "J2", "J3")
    with pytest.raises(pb.UnsupportedError, match="rule 'front' applies only where"):
        robot.export("json", tmp_path / "chains.json")
    everywhere = load(tmp_path, arm(rule("front", "J2: 1", lower=-19)))
    assert pb.StepBounds(everywhere).rows(everywhere.home, 0.1) is not None
    assert pb.limit_table(everywhere, "J2", "J3") is not None
    assert '"front"' in everywhere.export("json", tmp_path / "chains.json")[0].read_text()
