"""Values are values: nothing that a user can reach can be written to, and no public call changes what it is given."""

import copy
import dataclasses
import enum
import pickle
import types
import warnings
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.loops.closures import Deviation
from pinbound.path.chain import Chain
from pinbound.region.arrangement import Corner, Edge
from pinbound.region.halfplanes import HalfPlane
from pinbound.values import FrozenDict, MadeMapping, Value, read_only

PLAIN = (str, bytes, int, float, complex, type(None), enum.Enum, type, types.FunctionType, types.BuiltinFunctionType)
BOXES = """
<robot name="boxes" xmlns:pinbound="urn:pinbound:1">
  <link name="base"><collision><geometry><box size="0.4 0.4 0.1"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1"/></geometry></collision></link>
  <link name="tool"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="q1" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="q2" type="prismatic"><parent link="arm"/><child link="tool"/><origin xyz="0 0 1.2"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="p" link="base" xyz="0 0 0" radius="0.1"/>
    <pinbound:point name="s" link="tool" xyz="0 0 0" radius="0.1"/>
    <pinbound:segment name="c" link="arm" xyz_a="0 0 0.6" xyz_b="0 0 0.9" radius="0.05"/>
    <pinbound:boundary name="ps" a="p" b="s"/>
    <pinbound:boundary name="pc" a="p" b="c"/>
  </pinbound:annotations>
</robot>"""


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = tmp_path_factory.mktemp("boxes") / "boxes.urdf"
    path.write_text(BOXES)
    return pb.load(path)


@pytest.fixture(scope="module")
def minerva() -> pb.Robot:
    return pb.load("minervabot_v3")


def answers(robot: pb.Robot) -> dict[str, Any]:
    """Return one of everything that public functions answer with."""
    q, other = robot.home, 0.9 * robot.home + 0.1 * np.clip(robot.upper, -1, 1)
    first = robot.boundaries[0]
    name = first.coordinates[0]
    region = pb.feasible_region(robot)
    return {
        "robot": robot,
        "boundaries": robot.boundaries,
        "contact": first.contact,
        "arcs": first.limits(name, q),
        "arcs table": first.limits(name, np.stack([q, other])),
        "limits": robot.boundaries.limits(name, q),
        "smallest": robot.boundaries.smallest(q),
        "coverage": robot.coverage,
        "region": region,
        "margins": region.clearance(),
        "membership": pb.region_membership(robot, region, q),
        "certificate": pb.certify(robot, [q, other]),
        "box": pb.certified_box(robot, q),
        "polytope": pb.certified_polytope(robot, q),
        "cover": pb.certified_cover(robot, robot.coordinates[:2], share=0.2, limits_only=True),
        "projection": pb.free_projection(robot, robot.coordinates[:2], decided=0.2, limits_only=True),
        "history": pb.history(robot, [q, other], region=region, samples=5),
        "inverse kinematics": pb.solve_ik(robot, list(robot.tree.links)[-1], np.array([[0.1, 0.0, 0.2]])),
    }


def reach(root: Any) -> dict[str, Any]:
    """Return everything that public names lead to from a value, by its path."""
    found: dict[str, Any] = {}
    seen: dict[int, Any] = {}
    stack: list[tuple[str, Any]] = [("", root)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, PLAIN) or id(value) in seen:
            continue
        seen[id(value)] = value  # kept, so that no id is used twice
        found[path] = value
        if isinstance(value, Mapping):
            stack += [(f"{path}[{key!r}]", entry) for key, entry in value.items()]
        elif isinstance(value, (list, tuple, set, frozenset)):
            stack += [(f"{path}[{i}]", entry) for i, entry in enumerate(value)]
        elif type(value).__module__.startswith("pinbound"):
            stack += [(f"{path}.{name}", entry) for name, entry in attributes(value).items()]
    return found


def attributes(value: Any) -> dict[str, Any]:
    names = set(vars(value)) if hasattr(value, "__dict__") else set()
    names |= {one.name for one in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
    kinds = type(value)
    names |= {name for name in dir(kinds) if isinstance(getattr(kinds, name, None), (property, cached_property))}
    found: dict[str, Any] = {}
    for name in sorted(names):
        if name.startswith("_") or name in ("model", "kernel", "signed_kernel", "document", "polygon"):
            continue  # engines and libraries' own objects: copies, or not what is asked for
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)  # old names lead to the same values
                found[name] = getattr(value, name)
        except (pb.PinboundError, AttributeError):
            continue
    return found


@pytest.mark.parametrize("which", ["minerva", "boxes"])
def test_nothing_reachable_can_be_written_to(which: str, request: pytest.FixtureRequest) -> None:
    for label, answer in answers(request.getfixturevalue(which)).items():
        for path, value in reach(answer).items():
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable, f"{label}{path}"
            assert not isinstance(value, (list, set)), f"{label}{path} is a {type(value).__name__}"
            assert not isinstance(value, dict) or isinstance(value, FrozenDict), f"{label}{path} is a dict"


@pytest.mark.parametrize("which", ["minerva", "boxes"])
def test_every_record_hashes_compares_pickles_and_copies(which: str, request: pytest.FixtureRequest) -> None:
    for label, answer in answers(request.getfixturevalue(which)).items():
        for path, value in reach(answer).items():
            if not dataclasses.is_dataclass(value):
                continue
            assert isinstance(hash(value), int), f"{label}{path}"
            assert (value == value) is True, f"{label}{path}"  # noqa: PLR0124
            assert isinstance(value == object(), bool), f"{label}{path}"
            assert repr(value), f"{label}{path}"
    for label, answer in answers(request.getfixturevalue(which)).items():
        for made in (pickle.loads(pickle.dumps(answer)), copy.copy(answer), copy.deepcopy(answer)):
            assert type(made) is type(answer), label
            assert repr(made) == repr(answer), label


def test_writing_where_a_verdict_comes_from_is_refused(minerva: pb.Robot) -> None:
    motion = np.radians([[0, 0, 0], [0, 0, 60]])
    for attempt in (
        lambda: minerva.coupling.S.__setitem__(slice(None), 0.0),
        lambda: minerva.home.__setitem__(0, 9.0),
        lambda: minerva.boundaries[0].path.minimal.offsets.__setitem__(0, 0.0),
        lambda: minerva.linear_limits[0].coefficients.__setitem__(0, 0.0),
        minerva.annotations.marks.clear,
        minerva.tree.children.popitem,
    ):
        with pytest.raises((ValueError, TypeError)):
            attempt()
    model = minerva.model
    model.jointPlacements[1].translation = np.array([9.0, 9.0, 9.0])
    assert not np.any(minerva.model.jointPlacements[1].translation == 9.0)
    assert pb.certify(minerva, motion).verdict is pb.Verdict.VIOLATED


def test_records_do_not_share_the_callers_arrays(minerva: pb.Robot) -> None:
    q, low, high = np.array([0.0, 0.2, 0.1]), np.zeros(3), np.full(3, 0.1)
    region = pb.feasible_region(minerva, ("q2", "q3"), at=q)
    box = pb.certify_box(minerva, low, high)
    motion = np.array([q, q + 0.1])
    found = pb.certify(minerva, motion)
    marks = {"p": pb.Point("p", "base", (0.0, 0.0, 0.0))}
    said = pb.Annotations(marks=marks)
    for array in (q, low, high, motion):
        array[...] = 77.0
    marks.clear()
    assert not any(
        np.any(value == 77.0) for value in reach([region, box, found]).values() if isinstance(value, np.ndarray)
    )
    assert list(said.marks) == ["p"]


@pytest.mark.parametrize(
    ("record", "given"),
    [
        (lambda a: Chain(a, np.zeros((2, 3, 1)), np.eye(3)[:1], np.ones((1, 1)), 1.0), np.ones((2, 3))),
        (lambda a: HalfPlane("q", "q upper", a, 1.0, False), np.ones(2)),
        (lambda a: Edge("e", "e", True, a[0], a[1], a), np.ones((2, 2))),
        (lambda a: Corner(a, "e", "f", True), np.ones(2)),
        (lambda a: Deviation("j", 0.0, a), np.ones(3)),
    ],
)
def test_records_copy_before_they_freeze(record: Callable[[Any], Any], given: Any) -> None:
    made = record(given)
    given[...] = 7.0  # which it would refuse, had the record frozen the caller's own array
    arrays = [value for value in vars(made).values() if isinstance(value, np.ndarray)]
    assert arrays
    assert not any(np.any(array == 7.0) or array.flags.writeable for array in arrays)


CALLS: dict[str, Callable[[pb.Robot, Any], Any]] = {
    "norms": lambda robot, q: robot.boundaries.norms(q),
    "clearances": lambda robot, q: robot.boundaries.clearances(q),
    "signed_clearances": lambda robot, q: robot.boundaries.signed_clearances(q),
    "gradients": lambda robot, q: robot.boundaries.gradients(q),
    "signed_gradients": lambda robot, q: robot.boundaries.signed_gradients(q),
    "hessians": lambda robot, q: robot.boundaries.hessians(q),
    "vectors": lambda robot, q: robot.boundaries.vectors(q),
    "smallest": lambda robot, q: robot.boundaries.smallest(q),
    "free": lambda robot, q: robot.boundaries.free(q),
    "beyond": lambda robot, q: robot.boundaries.beyond(q[0]),
    "limits": lambda robot, q: robot.boundaries.limits(robot.coordinates[0], q[0]),
    "limits_table": lambda robot, q: robot.boundaries.limits_table(robot.coordinates[0], q),
    "certify": pb.certify,
    "certify_box": lambda robot, q: pb.certify_box(robot, np.minimum(q[0], q[1]), np.maximum(q[0], q[1])),
    "certified_box": lambda robot, q: pb.certified_box(robot, q[0]),
    "region": lambda robot, q: pb.feasible_region(robot, at=q[0]),
    "contains": lambda robot, q: pb.feasible_region(robot).contains(q),
    "signed_distance": lambda robot, q: (
        pb.feasible_region(robot).inset(1e-3) if robot.name == "minervabot_v3" else None
    ),
    "history": lambda robot, q: pb.history(robot, q, samples=5),
    "expand": lambda robot, q: robot.coupling.expand(q),
    "to_pinocchio": lambda robot, q: robot.to_pinocchio(robot.model, q),
    "positions": lambda robot, q: robot.positions(list(robot.tree.links)[-1], q),
    "closure_residuals": lambda robot, q: robot.closure_residuals(q),
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("which", ["minerva", "boxes"])
def test_no_call_changes_its_arguments(name: str, which: str, request: pytest.FixtureRequest) -> None:
    robot = request.getfixturevalue(which)
    q = np.stack([robot.home, 0.95 * robot.home + 0.05 * np.clip(robot.upper, -1, 1)])
    before = q.copy()
    answer = CALLS[name](robot, q)
    assert np.array_equal(q, before)
    for value in reach([answer]).values():
        if isinstance(value, np.ndarray):
            assert not np.shares_memory(value, q)
    q.flags.writeable = False
    CALLS[name](robot, q)


def test_a_frozen_dict_is_a_dict_that_cannot_be_changed() -> None:
    frozen = FrozenDict({"a": 1, "b": 2})
    assert frozen == {"a": 1, "b": 2}
    assert hash(frozen) == hash(FrozenDict({"b": 2, "a": 1}))
    for made in (pickle.loads(pickle.dumps(frozen)), copy.copy(frozen), copy.deepcopy(frozen)):
        assert type(made) is FrozenDict
        assert made == frozen
    for change in (
        lambda: frozen.update(c=3),
        lambda: frozen.pop("a"),
        lambda: frozen.setdefault("c", 1),
        lambda: frozen.__ior__({"c": 1}),
        lambda: frozen.__delitem__("a"),
    ):
        with pytest.raises(TypeError, match="cannot be changed"):
            change()


class Lengths(MadeMapping[str, tuple[int, ...]]):
    """Of each name, its length; counts how often it is asked."""

    asked = 0

    def make(self, key: str) -> tuple[int, ...]:
        Lengths.asked += 1
        return (len(key),)


def test_a_made_mapping_is_as_a_frozen_dict_of_the_same_items() -> None:
    made, plain = Lengths(FrozenDict({"three": 0, "one": 0})), FrozenDict({"three": (5,), "one": (3,)})
    assert list(made.items()) == list(plain.items())
    assert made == plain
    assert plain == made
    assert made == Lengths(FrozenDict({"one": 1, "three": 1}))
    assert made != Lengths(FrozenDict({"one": 0}))
    assert hash(made) == hash(plain)
    assert repr(made) == repr(plain)
    for again in (pickle.loads(pickle.dumps(made)), copy.copy(made), copy.deepcopy(made)):
        assert type(again) is Lengths
        assert again == made
    with pytest.raises(KeyError, match="two"):
        made["two"]
    with pytest.raises(TypeError):
        made["one"] = (1,)  # type: ignore[index]


def test_a_record_keeps_a_made_mapping_and_makes_nothing() -> None:
    @dataclasses.dataclass(frozen=True)
    class Holder(Value):
        held: Mapping[str, tuple[int, ...]]

    made, before = Lengths(FrozenDict({"one": 0})), Lengths.asked
    assert Holder(made).held is made
    assert "one" in made
    assert len(made) == 1
    assert Lengths.asked == before


def test_a_value_freezes_what_it_is_given() -> None:
    @dataclasses.dataclass(frozen=True, eq=False)
    class Record(Value):
        array: Any
        mapping: Any
        parts: Any

    array = np.zeros(2)
    made = Record(array, {"a": [array]}, (array, [1, 2]))
    array[0] = 1.0
    assert made.array.tolist() == made.mapping["a"][0].tolist() == made.parts[0].tolist() == [0.0, 0.0]
    assert made.parts[1] == (1, 2)
    assert read_only(made.array) is made.array
