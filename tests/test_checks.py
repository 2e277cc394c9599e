"""Wrong arguments of Python calls end in one error of pinbound that says what is valid."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import pinbound as pb
from pinbound.batch import RandomSource, SobolSource
from pinbound.region.convex import inscribed_polygon
from robots import ZOO

ROW = [0.15, 0.05, 0.12]


@cache
def arm() -> pb.Robot:
    return pb.load(ZOO["planar_2r"])


@cache
def volume() -> Any:
    return pb.free_volume(arm(), budget=pb.Budget(200, 5.0))


def polytope(seed: Any) -> object:
    return pb.certified_polytope(arm(), arm().home, budget=pb.Budget(50, 5.0), seed=seed)


SEEDED: dict[str, Callable[[Any], object]] = {
    "solve_ik": lambda seed: pb.solve_ik(arm(), "b", ROW, seed=seed),
    "plan": lambda seed: pb.plan(arm(), arm().home, arm().home, seed=seed),
    "cross_check": lambda seed: pb.cross_check(arm(), 2, seed, ("points",)),
    "certified_polytope": polytope,
    "certified_cover": lambda seed: pb.certified_cover(arm(), budget=pb.Budget(50, 5.0), seed=seed),
    "free_projection": lambda seed: pb.free_projection(arm(), ("q1", "q2"), budget=pb.Budget(50, 5.0), seed=seed),
    "inscribed_polygon": lambda seed: inscribed_polygon(shapely.box(0, 0, 1, 1), seed),
    "sampled_volume": lambda seed: polytope(0).sampled_volume(10, seed),
    "RandomSource": lambda seed: RandomSource(2, seed, (0.0,), (1.0,)).read(0, 2),
    "SobolSource": lambda seed: SobolSource(2, seed, (0.0,), (1.0,)).read(0, 2),
}


@pytest.mark.parametrize("name", SEEDED)
def test_a_seed_is_a_whole_number(name: str) -> None:
    for wrong in (-1, "x", 1.5, None, True, [1]):
        with pytest.raises(pb.DimensionError, match=r"^seed is .*; give a whole number of 0 or more$"):
            SEEDED[name](wrong)
    SEEDED[name](np.int64(3))


WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "load(3)": (lambda: pb.load(3), "robot: 3 is of type int. Give the name of a robot, a path, or the text of a URDF"),
    "load(None)": (lambda: pb.load(None), "robot: None is of type NoneType"),
    "load(bytes)": (lambda: pb.load(b"a.urdf"), "robot: b'a.urdf' is of type bytes"),
    "annotations=3": (lambda: pb.load(ZOO["planar_2r"], 3), "annotations: 3 is of type int. Give a path, Annotations"),
    "annotations=[3]": (lambda: pb.load("minervabot_v3", [3]), "annotations: 3 is of type int. Give a path"),
    "preset, annotations=3": (lambda: pb.load("palletizers/fanuc_m410ib_700", 3), "annotations: 3 is of type int"),
    "with_annotations(3)": (lambda: arm().with_annotations(3), "annotations: 3 is of type int"),
    "package_dirs=[3]": (lambda: pb.load(ZOO["planar_2r"], package_dirs=[3]), "package_dirs: 3 is of type int"),
    "package_dirs=None": (lambda: pb.load(ZOO["planar_2r"], package_dirs=None), "package_dirs: None is of type"),
    "xacro_args=[..]": (lambda: pb.load("minervabot_v3", xacro_args=["a=b"]), "Give a dict, e.g. xacro_args={'name'"),
    "Budget('x')": (lambda: pb.Budget("x"), "the budget is Budget(boxes='x', seconds=30.0); give numbers, 0 or more"),
    "Budget(1, None)": (lambda: pb.Budget(1, None), "give numbers, 0 or more"),
    "Budget(True)": (lambda: pb.Budget(True), "give numbers, 0 or more"),
    "budget=3": (lambda: pb.certify(arm(), [arm().home], budget=3), "the budget is 3; give pinbound.Budget(boxes="),
    "on(None)": (lambda: arm().on(None), "the model is of type NoneType; give a pinocchio.Model"),
    "from_pinocchio(None)": (lambda: pb.from_pinocchio(None), "the model is of type NoneType"),
    "Robot.from_pinocchio": (lambda: arm().from_pinocchio("m", [0, 0]), "the model is of type str"),
    "to_pinocchio": (lambda: arm().to_pinocchio(arm().home, arm().home), "the model is of type ndarray"),
    "certify('arm')": (lambda: pb.certify("arm", [[0, 0]]), "robot is of type str; give a Robot"),
    "feasible_region('arm')": (lambda: pb.feasible_region("arm"), "robot is of type str; give a Robot"),
    "solve_ik(None)": (lambda: pb.solve_ik(None, "b", ROW), "robot is of type NoneType; give a Robot"),
    "limit_table(None)": (lambda: pb.limit_table(None, "q1", "q2"), "robot is of type NoneType"),
    "cross_check(None)": (lambda: pb.cross_check(None), "robot is of type NoneType"),
    "levels=3": (lambda: pb.cross_check(arm(), levels=3), "levels is 3; give a name, or a list of names"),
    "samples='x'": (lambda: pb.cross_check(arm(), "x"), "samples is 'x'; give a whole number of 1 or more"),
    "samples=1.5": (lambda: pb.cross_check(arm(), 1.5), "samples is 1.5; give a whole number of 1 or more"),
    "xyz of two": (lambda: arm().positions("b", [0, 0], (1, 2)), "xyz is (1, 2); give three numbers"),
    "xyz text": (lambda: arm().positions("b", [0, 0], "ab"), "xyz is 'ab'; give three numbers"),
    "xyz NaN": (lambda: pb.solve_ik(arm(), "b", ROW, xyz=(0, 0, np.nan)), "give three finite numbers"),
    "link [3]": (lambda: arm().positions([3], [0, 0]), "there is no link [3]"),
    "targets text": (lambda: pb.solve_ik(arm(), "b", "abc"), "targets is not an array of numbers"),
    "max_iterations": (lambda: pb.solve_ik(arm(), "b", ROW, max_iterations=-1), "max_iterations is -1; give a whole"),
    "restarts": (lambda: pb.solve_ik(arm(), "b", ROW, restarts=1.5), "restarts is 1.5; give a whole number"),
    "tolerance": (
        lambda: pb.solve_ik(arm(), "b", ROW, tolerance=np.nan),
        "the tolerance is nan; give metres",
    ),
    "boundaries[None]": (lambda: arm().boundaries[None], "there is no boundary None. Valid: p_s, s_t, p_t"),
    "select(3)": (lambda: arm().boundaries.select(3), "boundaries is 3; give a name, or a list of names"),
    "select([[..]])": (lambda: arm().boundaries.select([["p_s"]]), "boundaries is [['p_s']]; give a name, or a list"),
    "boundaries=3": (lambda: pb.certify(arm(), [[0, 0]], boundaries=3), "boundaries is 3; give a name, or a list"),
    "coordinates=3": (lambda: pb.feasible_region(arm(), coordinates=3), "coordinates is 3; give a name, or a list"),
    "export(path)": (lambda: arm().export("json", None), "path is None; give the path of a file"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_argument_is_one_error_that_says_what_is_valid(name: str) -> None:
    call, message = WRONG[name]
    with pytest.raises(pb.PinboundError) as caught:
        call()
    assert message in str(caught.value)


NAMED: dict[str, Callable[[Any], object]] = {
    "certify_box": lambda name: pb.certify_box(name, [0, 0], [0, 0]),
    "certified_box": lambda name: pb.certified_box(name, [0, 0]),
    "certified_polytope": lambda name: pb.certified_polytope(name, [0, 0]),
    "certified_cover": pb.certified_cover,
    "free_projection": lambda name: pb.free_projection(name, ("q1", "q2")),
    "free_volume": lambda name: pb.free_volume(name, ("q1", "q2")),
    "plan": lambda name: pb.plan(name, [0, 0], [0, 0]),
    "history": lambda name: pb.history(name, [[0, 0]]),
    "propose_marks": pb.propose_marks,
}


@pytest.mark.parametrize("call", NAMED)
def test_the_name_of_a_robot_is_no_robot(call: str) -> None:
    with pytest.raises(pb.DimensionError, match=r"^robot is of type str; give a Robot, e\.g\. pinbound\.load"):
        NAMED[call]("minervabot_v3")


def test_every_kind_of_path_is_accepted(tmp_path: Path) -> None:
    class Here:
        def __fspath__(self) -> str:
            return str(tmp_path / "arm.urdf")

    (tmp_path / "arm.urdf").write_text(ZOO["planar_2r"])
    assert pb.load(Here(), package_dirs=tmp_path).name == pb.load(str(tmp_path / "arm.urdf")).name


def test_a_package_folder_that_is_none_is_noted(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    wrong = [str(tmp_path / "none"), str(tmp_path / "file")]
    noted = [
        note for note in pb.load(ZOO["planar_2r"], package_dirs=[tmp_path, *wrong]).notes if "package_dirs" in note
    ]
    assert noted == [f"package_dirs: there is no folder {one!r}, so no package or mesh is found there" for one in wrong]
    assert not [note for note in arm().notes if "package_dirs" in note]


def names_from_arrays() -> dict[str, Callable[[], Any]]:
    """Return calls with names out of NumPy arrays; the errors of half of them name one that does not exist."""
    q1, q2, none = np.array(["q1", "q2", "none"])
    home = arm().home
    return {
        "region": lambda: pb.feasible_region(arm(), coordinates=np.array(["q1", "q2"]), window={q1: (-1, 1)}).edges,
        "no region": lambda: pb.feasible_region(arm(), coordinates=np.array(["q1", "none"])),
        "no window": lambda: pb.feasible_region(arm(), window={none: (-1, 1)}),
        "limits": lambda: arm().boundaries.limits(q1, home),
        "no limits": lambda: arm().boundaries.limits(none, home),
        "arcs": lambda: arm().boundaries["s_t"].limits(q2, home),
        "select": lambda: arm().boundaries.select(np.array(["s_t"])).names,
        "twice": lambda: arm().boundaries.select(np.array(["s_t", "s_t"])),
        "no boundary": lambda: arm().boundaries[none],
        "certificate": lambda: pb.certify(arm(), [home], boundaries=np.array(["s_t"])).boundaries[0],
        "polytope": lambda: pb.certified_polytope(arm(), home, window={q2: (-1, 1)}, budget=pb.Budget(50, 5.0)).faces,
        "table": lambda: pb.limit_table(pb.load("minervabot_v3"), *np.array(["q2", "q3"])),
        "no link": lambda: arm().positions(none, home),
        "no level": lambda: pb.cross_check(arm(), levels=np.array(["none"])),
        "no preset": lambda: pb.load(np.str_("palletizers/none")),
        "two marks": lambda: pb.Annotations.of([pb.Point(q1, q2, (0, 0, 0))] * 2),
        "mark": lambda: pb.Segment(q1, q2, (0, 0, 0), (0, 0, 1)),
        "boundary": lambda: pb.BoundaryMark(q1, q2, none),
        "rule": lambda: pb.Rule(none, {q1: 1.0}, -1.0, where=(pb.Condition({q2: 1.0}, 0.0),)),
        "hull": lambda: pb.Hull(q1, q2, np.eye(3)),
    }


@pytest.mark.parametrize("name", list(names_from_arrays()))
def test_names_from_arrays_are_shown_as_names(name: str) -> None:
    try:
        found = names_from_arrays()[name]()
    except pb.PinboundError as error:
        found = (str(error), vars(error))
    assert "np.str_" not in repr(found)
    assert "'q1'" in repr(found) or "q2" in repr(found) or "none" in repr(found) or "s_t" in repr(found)
