"""Bounds of separations in machine code: the numbers of NumPy's bounds, and below all that is sampled."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.bounds import separation_tables
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.separation_tables import SeparationTables
from pinbound.bounds.swept_bounds import along_motion, over_box
from pinbound.certificates.constraints import families
from robots import ARM, HEAD, joint
from test_swept_bounds import MARKS, PAIRS

Load = Callable[..., pb.Robot]

SLIDING = (
    joint("j1", "revolute", "base", "a", axis="0 0 1", limit="-3.2 3.2"),
    joint("j2", "prismatic", "a", "b", xyz="0 0 0.3", axis="0.6 0 0.8", limit="-2 2"),
    joint("j3", "revolute", "b", "c", xyz="0.2 0 0.1", axis="0 1 0", limit="-3.2 3.2"),
    joint("j4", "prismatic", "c", "d", xyz="0.3 0.1 0", axis="1 0 0", limit="-2 2"),
)
PRISM = "{name: stick, link: d, xyz: [0, 0, 0.1], ways: [[0.1, 0, 0], [0, 0.1, 0], [0, 0.02, 0.1], [0.05, 0.05, 0.1]]}"


@pytest.fixture(params=["turning", "sliding"])
def arm(load_text: Load, request: pytest.FixtureRequest) -> pb.Robot:
    pairs = [pair.split() for pair in [*PAIRS, "gem stick", "pole tip", "crate rod", "crate tile"]]
    rows = "".join(f"- {{name: {a}_{b}, a: {a}, b: {b}}}\n" for a, b in pairs)
    joints = ARM if request.param == "turning" else SLIDING
    urdf = f'{HEAD}<link name="base"/>{"".join(joints)}</robot>'
    return load_text(urdf, f"sweeps: [{PRISM}]\n{MARKS}{rows}")


def tables_of(family: object) -> SeparationTables:
    tables = family.tables()  # type: ignore[attr-defined]
    assert isinstance(tables, SeparationTables)
    return tables


def compare(found: tuple[np.ndarray, np.ndarray], known: object, fits: np.ndarray, reach: np.ndarray) -> None:
    """Sums are rounded otherwise, and faces have their vertices in another order: some 100 roundoffs of the path."""
    value, lower = known.value[fits], np.maximum(known.lower[fits], -reach)  # type: ignore[attr-defined]
    assert np.all(np.abs(found[0] - value) <= 1e-14 * reach)
    overlap = value <= 1e-14 * reach
    assert np.all((np.abs(np.maximum(found[1], -reach) - lower) <= 1e-5 * (value - lower) + 1e-13 * reach)[~overlap])


def test_along_pieces_the_bounds_are_those_of_numpy_and_hold_all_that_is_sampled(arm: pb.Robot) -> None:
    rng = np.random.default_rng(0)
    m, zero = len(arm.boundaries), np.zeros(4)
    which, tight = np.arange(m), 0
    for size in (0.5, 0.05, 1e-3, 1e-6):
        for _ in range(5):
            middle, slope, bend = rng.uniform(-1.5, 1.5, 4), size * rng.normal(size=4), size**2 * rng.normal(size=4)
            q, v, b = middle[None], slope[None], bend[None]
            ends = np.stack((v - b / 2, v + b / 2), axis=1)
            piece = Expansion(
                q, zero, v, np.stack((q - v / 2 + b / 8, q + v / 2 + b / 8), axis=1), zero, ends, zero, b[:, None], zero
            )
            reach = np.abs(middle) + np.abs(slope) + np.abs(bend)
            family = families(arm, tuple(arm.boundaries), -reach, reach, 2)[-1]
            tables = tables_of(family)
            assert tables.fits.sum() == m - 1  # a prism of four edge vectors is left to NumPy
            rows = np.zeros(m, dtype=np.intp)
            known = along_motion(family.swept, which, piece.take(rows), family.error)
            fits = tables.fits
            found = tables.along_motion(which[fits], piece, rows[fits], family.error)
            compare(found, known, fits, np.maximum(1.0, family.swept.reach[fits]))
            tau = np.linspace(-0.5, 0.5, 41)[:, None]
            values = (family.signed(middle + tau * slope + tau**2 / 2 * bend) + family.threshold).min(axis=0)
            assert np.all(known.lower <= values + 1e-15)
            assert np.all(found[1] <= values[fits] + 1e-15)
            tight += int(np.sum(values[fits] - found[1] < 0.1 * size))
    assert tight > 100


def test_over_boxes_the_bounds_are_those_of_numpy_and_hold_all_that_is_sampled(arm: pb.Robot) -> None:
    rng = np.random.default_rng(1)
    which = np.arange(len(arm.boundaries))
    for size in (0.3, 0.03, 1e-4):
        for kept in (4, 2, 1):
            low, width = rng.uniform(-1.5, 1.5, 4), np.zeros(4)
            width[rng.permutation(4)[:kept]] = 2 * size
            family = families(arm, tuple(arm.boundaries), low, low + width)[-1]
            tables = tables_of(family)
            fits = tables.fits
            centre, half = np.tile(low + width / 2, (len(which), 1)), np.tile(width / 2, (len(which), 1))
            known = over_box(family.swept, which, centre, half, family.error)
            found = tables.over_box(which[fits], centre[fits], half[fits], family.error)
            compare(found, known, fits, np.maximum(1.0, family.swept.reach[fits]))
            corners = low + width * (0.5 + 0.5 * np.sign(rng.uniform(-1, 1, (40, 4))))
            values = family.signed(np.vstack((low + width * rng.random((40, 4)), corners))) + family.threshold
            assert np.all(known.lower <= values.min(axis=0) + 1e-15)
            assert np.all(found[1] <= values.min(axis=0)[fits] + 1e-15)


def test_of_many_coordinates_what_other_vertices_cost_is_counted_over_boxes(load_text: Load) -> None:
    """A body at the end of six joints: more coordinates than those all of whose corners are looked at."""
    links = ["base", *"uvwxyz"]
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    joints = "".join(
        joint(f"q{i}", "revolute", links[i], links[i + 1], xyz="0.1 0.02 0.2", axis=axis, limit="-3 3")
        for i, axis in enumerate(axes)
    )
    marks = """
boxes:
- {name: crate, link: base, xyz: [0.7, 0.2, 0.4], rpy: [0.3, 0.2, 0.1], size: [0.3, 0.3, 0.2]}
- {name: hand, link: z, xyz: [0, 0, 0.1], rpy: [0, 0, 0], size: [0.1, 0.2, 0.2]}
boundaries: [{name: beta, a: crate, b: hand}]
"""
    robot = load_text(f'{HEAD}<link name="base"/>{joints}</robot>', marks)
    rng = np.random.default_rng(2)
    none = np.zeros(1, dtype=np.intp)
    for size in (0.1, 0.01, 1e-3):
        for _ in range(4):
            low = rng.uniform(-1, 1, 6)
            family = families(robot, tuple(robot.boundaries), low, low + 2 * size)[-1]
            centre, half = (low + size)[None], np.full((1, 6), size)
            known = over_box(family.swept, none, centre, half, family.error)
            found = tables_of(family).over_box(none, centre, half, family.error)
            compare(found, known, np.ones(1, dtype=np.bool_), np.ones(1))
            corners = low + size * (1 + np.sign(rng.uniform(-1, 1, (300, 6))))
            assert found[1][0] <= family.signed(corners).min() + family.threshold[0] + 1e-15


def test_certificates_are_the_same_whichever_bounds_them(arm: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    motions = [np.array(arm.home) + np.cumsum(0.5 * rng.normal(size=(3, 4)), axis=0) for _ in range(6)]
    boxes = [np.array(arm.home) + 0.8 * rng.normal(size=4) for _ in range(6)]
    found: list[list[str]] = []
    for is_coded in (False, True):
        monkeypatch.setattr("pinbound.certificates.swept.is_worth", lambda rows, seconds, said=is_coded: said)
        first = [pb.certify(arm, one, limits=False, each=True) for one in motions]
        again = [pb.certify_box(arm, q - 0.02, q + 0.02, limits=False, budget=pb.Budget(4_000)) for q in boxes]
        found.append([str((one.verdict, [b.verdict for b in one.boundaries])) for one in first])
        found[-1] += [str(one.verdict) for one in again]
    assert found[0] == found[1]
    assert len(set(found[0])) > 3


def test_machine_code_is_loaded_once_it_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    code = separation_tables.Code(lambda: pytest.fail("not yet"), loading=100, compiling=1000)  # type: ignore[arg-type]
    assert not code.is_worth(99, 60.0)
    monkeypatch.setattr("pinbound.bounds.code.is_kept", lambda source: False)
    code = separation_tables.Code(separation_tables.separation_source, loading=100, compiling=1000)
    assert not code.is_worth(999, 60.0)
    assert not code.is_worth(1, 1.0)  # too little is left for compiling
    assert code.is_worth(1, 60.0)
    monkeypatch.setattr("pinbound.bounds.code.is_kept", lambda source: True)
    assert separation_tables.Code(separation_tables.separation_source, loading=100, compiling=1000).is_worth(100, 1.0)


def test_the_folder_of_machine_code_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr("pinbound.bounds.code.is_kept", lambda source: bool(asked.append(source)))
    code = separation_tables.Code(separation_tables.separation_source, loading=1, compiling=1000)
    assert not any(code.is_worth(1, 60.0) for _ in range(20))
    assert len(asked) == 1


def test_what_is_not_a_number_proves_nothing(load_text: Load) -> None:
    """A passive joint of a loop that cannot close has no angle: what it turns is nowhere, and so not clear."""
    marks = """
segments: [{name: rod, link: a, xyz_a: [0, 0, 0], xyz_b: [0.1, 0, 0.3]}]
planes: [{name: floor, link: base, xyz: [0, 0, -1], normal: [0, 0, 1]}]
boundaries: [{name: beta, a: rod, b: floor}]
"""
    turn = joint("q", "revolute", "base", "a", axis="0 1 0", limit="-3.2 3.2")
    robot = load_text(f'{HEAD}<link name="base"/>{turn}</robot>', marks)
    family = families(robot, tuple(robot.boundaries), -np.ones(1), np.ones(1))[-1]
    nowhere, half = np.full((1, 1), np.nan), np.full((1, 1), 0.01)
    _, lower = tables_of(family).over_box(np.zeros(1, dtype=np.intp), nowhere, half, family.error)
    assert lower[0] == -np.inf
    assert not family.enclose_box(np.zeros(1, dtype=np.intp), nowhere, half).clear[0]
