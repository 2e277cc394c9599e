"""A user's own Pinocchio model: its q becomes ours and back, and gradients over its v are what integration shows."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
STEP = 1e-5
MODELS = 8  # of each sort; `docs/bridges.md` has the result of 250 of each

HAND = robot_xml(
    [
        joint("a", "continuous", "base", "l1", axis="0 0 1", xyz="0 0 0.3"),
        joint("b", "revolute", "l1", "l2", axis="0 1 0", xyz="0.1 0 0.2", rpy="0.3 0 0"),
        joint("c", "prismatic", "l2", "l3", axis="1 0 1", xyz="0 0 0.4", limit="-0.2 0.3"),
        joint("d", "revolute", "l3", "l4", axis="1 0 0", xyz="0.2 0 0", mimic="b -0.5 0.25"),
        joint("e", "continuous", "l4", "l5", axis="0 1 1", xyz="0.1 0.2 0"),
    ],
    {"p": ("base", "0.2 0.1 0.4"), "s": ("l2", "0 0.3 0.2"), "t": ("l5", "0.1 0 0.3")},
    [("p", "t"), ("s", "t"), ("p", "s")],
)


def random_text(rng: np.random.Generator) -> str:
    """Return a tree of every moving type whose mimic joints stock Pinocchio can build, and boundaries on it."""
    links, above, elements = ["base"], {"base": list[str]()}, list[str]()
    for index in range(int(rng.integers(3, 8))):
        name, child = f"j{index}", f"l{index}"
        kind = str(rng.choice(["revolute", "continuous", "prismatic"]))
        options = {
            "xyz": " ".join(f"{x:.3f}" for x in rng.uniform(-0.5, 0.5, 3)),
            "rpy": " ".join(f"{x:.2f}" for x in rng.uniform(-3, 3, 3)),
            "axis": " ".join(f"{x:.3f}" for x in rng.uniform(-1, 1, 3)),
        }
        parent = links[-1] if rng.random() < 0.8 else str(rng.choice(links))
        sure = above[child] = [*above[parent]]  # joints that Pinocchio has read before this one, whatever their names
        if sure and kind != "continuous" and rng.random() < 0.4:
            options["mimic"] = f"{rng.choice(sure)} {rng.choice([-1.0, 0.5, 2.0])} {rng.choice([0.0, 0.3])}"
        elif kind != "continuous":
            sure.append(name)
        elements.append(joint(name, kind, parent, child, **options))
        links.append(child)
    points, pairs = {}, []
    for index in range(3):
        for end, link in zip("ab", rng.choice(links, 2, replace=False), strict=True):
            points[f"{end}{index}"] = (str(link), " ".join(f"{x:.3f}" for x in rng.uniform(-0.4, 0.4, 3)))
        pairs.append((f"a{index}", f"b{index}"))
    return robot_xml(elements, points, pairs)


def velocity(robot: pb.Robot, model: Any, rate: Any, rng: np.random.Generator) -> Any:
    """Return a random v of the model whose joints move at `rate` of the robot's coordinates."""
    v, joints = rng.uniform(-1, 1, model.nv), robot.coupling.S @ rate
    for name, one in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if one.nv == 1 and "Mimic" not in one.shortname():
            v[one.idx_v] = joints[robot.coupling.joints.index(name)]
    return v


@pytest.mark.parametrize("mimic", [True, False])
@pytest.mark.parametrize("flies", [True, False])
def test_gradients_over_v_are_what_integration_shows(mimic: bool, flies: bool) -> None:
    rng, compared = np.random.default_rng([mimic, flies]), 0
    for _ in range(MODELS):
        text = random_text(rng)
        try:
            robot = pb.load(text)
        except pb.InputError as refused:  # a random home may be in contact, or mimic joints leave it none
            assert "home" in str(refused) or "no configuration" in str(refused)
            continue
        model = pin.buildModelFromXML(text, *([pin.JointModelFreeFlyer()] if flies else []), mimic=mimic)
        view = robot.on(model)
        q = robot.to_pinocchio(model, rng.uniform(-1.5, 1.5, len(robot.coordinates)))
        if flies:
            q[:7] = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))[:7]
        v = velocity(robot, model, rng.uniform(-1, 1, len(robot.coordinates)), rng)
        ahead, behind = (view.clearances(pin.integrate(model, q, sign * STEP * v)) for sign in (1.0, -1.0))
        J = view.gradients(q)
        assert J.shape == (3, model.nv)
        far = view.clearances(q) > 0.05
        assert np.abs(J @ v - (ahead - behind) / (2 * STEP))[far].max(initial=0.0) < 1e-7
        compared += int(far.sum())
    assert compared > MODELS


@pytest.mark.parametrize("mimic", [True, False])
@pytest.mark.parametrize("flies", [True, False])
def test_q_goes_there_and_back(mimic: bool, flies: bool) -> None:
    robot = pb.load(HAND)
    model = pin.buildModelFromXML(HAND, *([pin.JointModelFreeFlyer()] if flies else []), mimic=mimic)
    Q = np.random.default_rng(0).uniform(-3, 3, (50, len(robot.coordinates)))
    back = robot.from_pinocchio(model, robot.to_pinocchio(model, Q))
    assert np.abs(back - Q).max() < 1e-15 * 4
    one = robot.from_pinocchio(model, robot.to_pinocchio(model, Q[0]))
    assert one.shape == (len(robot.coordinates),)
    assert np.array_equal(one, back[0])


def test_windings_are_those_next_to_home_or_to_what_is_asked() -> None:
    robot = pb.load(HAND)
    model = pin.buildModelFromXML(HAND)
    q = np.array([7.0, 0.1, 0.2, -9.0])
    full = robot.to_pinocchio(model, q)
    assert np.allclose(robot.from_pinocchio(model, full), [7.0 - 2 * np.pi, 0.1, 0.2, -9.0 + 2 * np.pi], atol=1e-14)
    assert np.allclose(robot.from_pinocchio(model, full, near=q + 0.5), q, atol=1e-14)


def test_a_reduced_model_has_its_locked_joints_where_they_are_locked() -> None:
    robot = pb.load(HAND)
    full = pin.buildModelFromXML(HAND)
    Q = np.random.default_rng(1).uniform(-1, 1, (5, len(robot.coordinates)))
    Q[:, 0], Q[:, 2] = Q[0, 0], Q[0, 2]
    locked = [full.getJointId(name) for name in ("a", "c")]
    model = pin.buildReducedModel(full, locked, robot.to_pinocchio(full, Q[0]))
    view = robot.on(model)
    there = view.configurations(robot.to_pinocchio(model, Q))
    assert np.abs(there - Q).max() < 1e-14
    assert np.abs(view.clearances(robot.to_pinocchio(model, Q)) - robot.boundaries.signed_clearances(Q)).max() < 1e-14
    J = robot.boundaries.signed_gradients(Q)
    columns = [model.joints[model.getJointId(name)].idx_v for name in ("b", "e")]
    assert np.abs(view.gradients(robot.to_pinocchio(model, Q))[:, :, columns] - J[:, :, [1, 3]]).max() < 1e-13
    assert any("locks 'a'" in note for note in view.notes)


def test_locked_mimic_joints_whose_primaries_move_are_refused() -> None:
    robot = pb.load(HAND)
    full = pin.buildModelFromXML(HAND)
    at = robot.to_pinocchio(full, np.array([0.0, 0.4, 0.0, 0.0]))
    with pytest.raises(pb.DimensionError, match="locks 'd', but moves 'b'"):
        robot.on(pin.buildReducedModel(full, [full.getJointId("d")], at))
    at[full.joints[full.getJointId("d")].idx_q] += 0.01
    with pytest.raises(pb.DimensionError, match=r"the joint that it follows puts it at 0\.05"):
        robot.on(pin.buildReducedModel(full, [full.getJointId("b"), full.getJointId("d")], at))


def test_another_robots_model_is_refused() -> None:
    robot = pb.load(HAND)
    for found, other, mimic, said in (
        ('xyz="0.1 0 0.2"', 'xyz="0.1 0 0.20001"', False, "places link 'l2' elsewhere"),
        ('name="e" type', 'name="z" type', False, "joint 'z' does not move"),
        ('multiplier="-0.5"', 'multiplier="1"', True, "places link 'l4' elsewhere"),
        ('link name="l5"', 'link name="l6"', False, "has no link 'l5'"),
    ):
        text = HAND.replace(found, other).replace('child link="l5"', f'child link="{"l6" if "l6" in other else "l5"}"')
        with pytest.raises(pb.DimensionError, match=said):
            robot.on(pin.buildModelFromXML(text, mimic=mimic))


def test_a_model_whose_angles_were_read_as_printed_pi_is_refused_with_the_remedy() -> None:
    text = HAND.replace('rpy="0.3 0 0"', 'rpy="1.571 0 0"')
    robot = pb.load(text)
    with pytest.raises(pb.DimensionError, match="write such angles with all digits"):
        robot.on(pin.buildModelFromXML(text))


def test_a_mimic_joint_out_of_place_and_no_angle_are_refused() -> None:
    robot = pb.load(HAND)
    model = pin.buildModelFromXML(HAND)
    view = robot.on(model)
    q = robot.to_pinocchio(model, np.array([0.3, 0.4, 0.1, 0.2]))
    wrong = q.copy()
    wrong[model.joints[model.getJointId("d")].idx_q] += 1e-5
    with pytest.raises(pb.DimensionError, match=r"mimic joint 'd' is 1e-05 from 0\.05"):
        view.clearances(wrong)
    wrong = q.copy()
    wrong[0] += 0.1
    with pytest.raises(pb.DimensionError, match="joint 'a', which is continuous"):
        view.gradients(np.array([q, wrong]))
    with pytest.raises(pb.DimensionError, match=r"q has shape \(3,\)"):
        view.clearances(q[:3])
    assert np.isnan(view.clearances(np.full(model.nq, np.nan))).all()


def test_a_free_flyer_is_said(minerva: pb.Robot) -> None:
    model = pin.buildModelFromXML(HAND, pin.JointModelFreeFlyer())
    assert any("move with the base" in note for note in pb.load(HAND).on(model).notes)
    assert minerva.on(minerva.model).notes == ()


def test_some_boundaries_stay_a_set(minerva: pb.Robot) -> None:
    B, Q = minerva.boundaries, np.random.default_rng(2).uniform(-1, 1, (7, 3))
    some = B.select(["beta_8", "beta_2"])
    assert some.names == ("beta_8", "beta_2")
    assert np.abs(some.signed_clearances(Q) - B.signed_clearances(Q)[:, [7, 1]]).max() < 1e-15
    assert np.abs(some.gradients(Q) - B.gradients(Q)[:, [7, 1]]).max() < 1e-14
    assert some.limits("q2", minerva.home).upper_stop == "beta_8"
    assert not some.free([3.0, 0.0, 0.0])
    assert B.select("beta_3").names == ("beta_3",)
    assert len(B.select([])) == 0
    assert B.select(B.names) is B  # no second kernel
    assert B.select(B.names[::-1]).names == B.names[::-1]
    with pytest.raises(pb.UnknownNameError, match="beta_99"):
        B.select(["beta_99"])
    with pytest.raises(pb.DimensionError, match="named twice"):
        B.select(["beta_1", "beta_1"])
    view = minerva.on(minerva.model).select(["beta_8"])
    assert view.gradients(minerva.to_pinocchio(minerva.model, Q)).shape == (7, 1, 11)


TABLE = [
    pb.Plane("table", "base", (0.0, 0.0, -0.2), (0.0, 0.0, 1.0)),
    pb.Point("tip", "l5", (0.0, 0.0, 0.0), radius=0.01),
]


def test_annotations_are_added_as_if_they_had_been_in_the_file(load_text: Load) -> None:
    more = pb.Annotations.of(TABLE, [pb.BoundaryMark("above", "tip", "table")], limits=(pb.LimitMark("c", -0.1, 0.1),))
    at_once, later = load_text(HAND, more.to_yaml()), pb.load(HAND).with_annotations(more)
    Q = np.random.default_rng(3).uniform(-1, 1, (20, len(later.coordinates)))
    assert later.boundaries.names == at_once.boundaries.names == ("p_t", "s_t", "p_s", "above")
    assert np.array_equal(later.boundaries.signed_clearances(Q), at_once.boundaries.signed_clearances(Q))
    assert later.upper.tolist() == at_once.upper.tolist()
    assert later.notes == at_once.notes
    again = pickle.loads(pickle.dumps(later)).with_annotations(
        pb.Annotations.of([], [pb.BoundaryMark("x", "p", "tip")])
    )
    assert again.boundaries.names[-1] == "x"


def test_faults_of_added_annotations_are_said_at_once(tmp_path: Path) -> None:
    robot = pb.load(HAND)
    sidecar = tmp_path / "more.yaml"
    sidecar.write_text("points: [{name: p, link: base, xyz: [0, 0, 0]}, {name: n, link: nowhere, xyz: [0, 0, 0]}]\n")
    with pytest.raises(pb.InputError, match="2 problems") as caught:
        robot.with_annotations(sidecar)
    assert {problem.source for problem in caught.value.problems} == {"more.yaml"}
    high = [pb.Plane("table", "base", (0.0, 0.0, 2.0), (0.0, 0.0, 1.0)), TABLE[1]]
    with pytest.raises(pb.InputError, match="home is outside the feasible region: 'above'"):
        robot.with_annotations(pb.Annotations.of(high, [pb.BoundaryMark("above", "tip", "table")]))


def test_the_text_of_a_urdf_is_a_robot(load_text: Load) -> None:
    Q = np.random.default_rng(4).uniform(-1, 1, (5, 4))
    expected = load_text(HAND).boundaries.norms(Q)
    for text in (HAND, "\n  " + HAND, f'<?xml version="1.0" encoding="iso-8859-1"?>\n{HAND}'):
        assert np.array_equal(pb.load(text).boundaries.norms(Q), expected)
    named = pb.load(HAND.replace('name="zoo"', 'name="Gelenk-ä"'))
    assert named.name == "Gelenk-ä"
    with pytest.raises(pb.InputError, match="URDF text, line 1: is not well-formed"):
        pb.load("<robot>")
    with pytest.raises(pb.InputError, match="xacro_args"):
        pb.load(HAND, xacro_args={"a": "b"})
