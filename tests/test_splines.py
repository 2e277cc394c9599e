"""SciPy's splines in Bernstein form: against exact arithmetic, at every degree, and refused where they jump."""

from fractions import Fraction
from itertools import pairwise
from math import comb
from pathlib import Path

import numpy as np
import pytest
from scipy import interpolate

import pinbound as pb
from mechanisms import sidecar, write
from pinbound.certificates.trajectory import as_trajectory
from pinbound.robot.robot import Robot

HINGE = """<robot name="hinge"><link name="base"/><link name="arm"/><link name="far"/>
<joint name="a" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="2" effort="1" velocity="1"/></joint>
<joint name="b" type="revolute"><parent link="arm"/><child link="far"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>"""
NAMES = ("a", "b")


def hinge(folder: Path, radius: float = 0.0) -> Robot:
    """Return an arm of 0.2 m that touches a post of its own length where a = pi / 2 or, with a radius, before."""
    points = [("p", "arm", np.array([0.0, 0.0, 0.2]), radius), ("s", "base", np.array([0.2, 0.0, 0.0]), 0.0)]
    return pb.load(write(folder, HINGE, sidecar(points, [("p", "s", 0.0)], {})))


def fractions(values: np.ndarray) -> list[Fraction]:
    return [Fraction(float(value)) for value in values]


def exact_bspline(spline, u: Fraction, column: int) -> Fraction:
    """Return a B-spline's value by the recursion that defines it, in rational arithmetic."""
    t, c, k = fractions(spline.t), fractions(spline.c[:, column]), spline.k
    last = len(t) - k - 2
    basis = [Fraction(int(t[i] <= u < t[i + 1])) for i in range(len(t) - 1)]
    if u == t[last + 1]:
        basis[max(i for i in range(len(t) - 1) if t[i] < t[i + 1] and i <= last)] = Fraction(1)
    for p in range(1, k + 1):
        basis = [
            (0 if t[i + p] == t[i] else (u - t[i]) / (t[i + p] - t[i]) * basis[i])
            + (0 if t[i + p + 1] == t[i + 1] else (t[i + p + 1] - u) / (t[i + p + 1] - t[i + 1]) * basis[i + 1])
            for i in range(len(basis) - 1)
        ]
    return sum((one * value for one, value in zip(basis, c, strict=False)), Fraction(0))


def exact_ppoly(spline, piece: int, u: Fraction, column: int) -> Fraction:
    x, c = fractions(spline.x), fractions(spline.c[:, piece, column])
    step = (x[piece + 1] - x[piece]) * u
    return sum((value * step ** (len(c) - 1 - i) for i, value in enumerate(c)), Fraction(0))


def bernstein(controls: np.ndarray, u: Fraction) -> Fraction:
    d = len(controls) - 1
    return sum(
        (comb(d, i) * u**i * (1 - u) ** (d - i) * Fraction(float(c)) for i, c in enumerate(controls)), Fraction(0)
    )


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 5, 8, 9, 16, 30])
def test_bsplines_of_any_degree_keep_within_their_radius(degree: int) -> None:
    rng = np.random.default_rng(degree)
    inner = np.sort(rng.uniform(0.0, 3.0, 0 if degree == 0 else 4)) + 1e6
    inner[1:2] = inner[:1]  # one knot twice
    ends = np.array([1e6 - 0.5, 1e6 + 4.0])
    t = np.concatenate([np.repeat(ends[0], degree + 1), inner, np.repeat(ends[1], degree + 1)])
    spline = interpolate.BSpline(t, rng.normal(0.0, 10.0 ** rng.uniform(-3, 3), (len(t) - degree - 1, 2)), degree)
    if degree == 1:
        spline.c[2] = spline.c[1]  # a double knot of a polyline is a jump unless both sides agree
    found = as_trajectory(spline, NAMES)
    for piece, (start, width) in enumerate(zip(found.starts, found.durations, strict=True)):
        for u in (Fraction(0), Fraction(1, 3), Fraction(7, 8), Fraction(1)):
            begin = Fraction(float(start))
            end = next(Fraction(float(x)) for x in t if x > start)
            assert float(end - begin) == width
            for column in range(2):
                true = exact_bspline(spline, begin + u * (end - begin), column)
                if u == 1 and piece < len(found.starts) - 1 and degree == 0:
                    continue
                off = abs(bernstein(found.controls[piece][:, column], u) - true)
                assert off <= Fraction(float(found.radius[piece, column]))
    assert np.all(found.radius <= 1e-12 * (1 + degree) * np.abs(spline.c).max())


@pytest.mark.parametrize("degree", [1, 3, 7, 12])
def test_power_bases_keep_within_their_radius(degree: int) -> None:
    rng = np.random.default_rng(degree)
    x = np.array([0.0, 0.3, 2.7])
    c = rng.normal(0.0, 1.0, (degree + 1, 1, 2)) * 10.0 ** rng.uniform(-3, 6, (degree + 1, 1, 1))
    spline = interpolate.PPoly(c, x[1:])
    found = as_trajectory(spline, NAMES)
    for u in (Fraction(0), Fraction(1, 7), Fraction(1, 2), Fraction(1)):
        for column in range(2):
            off = abs(bernstein(found.controls[0][:, column], u) - exact_ppoly(spline, 0, u, column))
            assert off <= Fraction(float(found.radius[0, column]))


def test_restricted_derivatives_hold_what_they_say() -> None:
    rng = np.random.default_rng(2)
    for degree in (1, 2, 5, 11):
        controls = rng.normal(0, 1, (degree + 1, 1, 2))
        found = as_trajectory(interpolate.BPoly(controls, [0.0, 1.0]), NAMES)
        for a, b in [(0.0, 1.0), (0.25, 0.5), (0.5, 0.5 + 2.0**-30), (1.0 - 2.0**-40, 1.0), (0.0, 0.0)]:
            part = found.expand(np.zeros(1, np.intp), np.array([a]), np.array([b]))
            for u in np.linspace(a, b, 5):
                exact = Fraction(float(u))
                for j in range(2):
                    row = [Fraction(float(value)) for value in controls[:, 0, j]]
                    first = [degree * (q - p) for p, q in pairwise(row)]
                    d = degree - 1
                    slope = sum(comb(d, i) * exact**i * (1 - exact) ** (d - i) * v for i, v in enumerate(first))
                    slope *= Fraction(b) - Fraction(a)
                    low, high = part.slopes[0, :, j].min(), part.slopes[0, :, j].max()
                    wide = Fraction(float(np.broadcast_to(part.slope_radius, (1, 2))[0, j])) * (1 + Fraction(1, 10**12))
                    if degree == 1:
                        wide += Fraction(float(abs(high))) / 10**15
                    assert Fraction(float(low)) - wide <= slope <= Fraction(float(high)) + wide


def test_what_people_interpolate_is_continuous() -> None:
    rng = np.random.default_rng(0)
    for _ in range(60):
        count = int(rng.integers(4, 30))
        x = np.cumsum(10.0 ** rng.uniform(-6, 3, count)) + rng.choice([0.0, 1e6])
        y = rng.normal(0, 10.0 ** rng.uniform(-6, 4), (count, 2)) + rng.choice([0.0, 1e5])
        for spline in (
            interpolate.CubicSpline(x, y),
            interpolate.CubicHermiteSpline(x, y, rng.normal(0, 1, y.shape)),
            interpolate.Akima1DInterpolator(x, y),
            interpolate.PchipInterpolator(x, y),
            interpolate.make_interp_spline(x, y, k=3),
            interpolate.make_interp_spline(x, y, k=1),
            interpolate.BPoly.from_derivatives(x, np.stack([y, rng.normal(0, 1, y.shape)], axis=1)),
            interpolate.CubicSpline(x.astype(np.float32).cumsum(), y.astype(np.float32)),
        ):
            assert len(as_trajectory(spline, NAMES).starts) >= 1


def lines(*pieces: tuple[float, float]) -> interpolate.PPoly:
    """Return straight pieces in `a` of one second each, from and to the values given."""
    c = np.zeros((2, len(pieces), 2))
    c[0, :, 0], c[1, :, 0] = [end - start for start, end in pieces], [start for start, _ in pieces]
    return interpolate.PPoly(c, np.arange(len(pieces) + 1.0))


@pytest.mark.parametrize(
    "jumping",
    [
        lines((0.0, 1.9), (0.0, 0.0)),
        lines((0.0, 0.0), (1e-9, 0.0)),
        interpolate.PPoly(np.array([[[0.0, 0.0], [0.5, 0.0]]]), [0.0, 1.0, 2.0]),
        interpolate.BPoly(np.array([[[0.0, 0.0], [0.5, 0.0]], [[0.4, 0.0], [0.0, 0.0]]]), [0.0, 1.0, 2.0]),
        interpolate.BSpline([0, 0, 1, 1, 2, 2], np.array([[0.0, 0], [1.9, 0], [0.0, 0], [0.0, 0]]), 1),
        interpolate.BSpline([0, 0, 0, 1, 1, 1, 2, 2, 2], np.array([[0.0, 0]] * 3 + [[0.5, 0]] * 3), 2),
        interpolate.PPoly(np.array([[[0.0, 0.0], [9.0, 0.0], [0.5, 0.0]]]), [0.0, 1.0, 1.0, 2.0]),
    ],
)
def test_a_motion_that_jumps_is_refused_by_name(tmp_path: Path, jumping) -> None:
    with pytest.raises(pb.DimensionError, match=r"not continuous: 'a' jumps by .* at the breakpoint t = 1,"):
        pb.certify(hinge(tmp_path), jumping)


def test_a_jump_over_a_piece_without_duration_is_none(tmp_path: Path) -> None:
    steady = interpolate.PPoly(np.array([[[0.5, 0.0], [9.0, 0.0], [0.5, 0.0]]]), [0.0, 1.0, 1.0, 2.0])
    assert pb.certify(hinge(tmp_path), steady).verdict is pb.Verdict.CERTIFIED


def test_both_ends_of_each_piece_count_for_angles_and_limits(tmp_path: Path) -> None:
    """The search itself does not rest on continuity: handed pieces that jump, it still finds what they reach."""
    from pinbound.certificates.constraints import families
    from pinbound.certificates.polynomials import Polynomials
    from pinbound.certificates.records import Budget
    from pinbound.certificates.search import Meter, Search

    robot = hinge(tmp_path)
    for reached, names in ((1.9, {"beta_0"}), (-3.5, {"a lower"}), (2.5, {"beta_0", "a upper"})):
        ends = np.array([[[0.0, 0.0], [reached, 0.0]], [[0.0, 0.0], [0.0, 0.0]]])
        motion = Polynomials(ends, np.array([0.0, 1.0]), np.ones(2), np.zeros((2, 2)))
        violated = set()
        for family in families(robot, tuple(robot.boundaries), *motion.extent)[:2]:
            search = Search(family, motion, Meter(Budget()), None)
            search.run(each=False)
            violated |= {finding.name for finding in search.results()[0] if finding.verdict is pb.Verdict.VIOLATED}
        assert violated == names


@pytest.mark.parametrize(
    ("spline", "message"),
    [
        (interpolate.PPoly(np.ones((2, 1, 2)) * (1 + 0.5j), [0.0, 1.0]), "complex"),
        (interpolate.BSpline([0, 0, 1, 1], np.ones((2, 2)) * 1j, 1), "complex"),
        (interpolate.PPoly(np.zeros((2, 2, 2)), [2.0, 1.0, 0.0]), "must increase"),
        (interpolate.PPoly(np.zeros((2, 1, 3)), [0.0, 1.0]), r"values of shape \(3,\); give \(2,\)"),
        (interpolate.PPoly(np.zeros((2, 1)), [0.0, 1.0]), r"values of shape \(\)"),
        (interpolate.BSpline([0, 0, 1, 1], np.zeros(2), 1), r"values of shape \(\)"),
        (interpolate.PPoly(np.zeros((2, 1, 2, 1)), [0.0, 1.0]), r"values of shape \(2, 1\)"),
        (interpolate.PPoly(np.zeros((2, 1, 2)), [1.0, 1.0]), "positive duration"),
        (interpolate.PPoly(np.full((2, 1, 2), np.nan), [0.0, 1.0]), "not finite"),
        (interpolate.PPoly(np.ones((5, 1, 2)), [0.0, 1e200]), "overflow"),
        (interpolate.PPoly(np.full((2, 1, 2), 1e150), [0.0, 1.0]), "may reach"),
    ],
)
def test_bad_splines_get_one_clear_error(tmp_path: Path, spline, message: str) -> None:
    with pytest.raises(pb.DimensionError, match=message):
        pb.certify(hinge(tmp_path), spline)


def test_splines_that_are_none_of_these(tmp_path: Path) -> None:
    many = interpolate.NdPPoly(np.zeros((2, 2, 1, 1, 2)), ([0.0, 1.0], [0.0, 1.0]))
    with pytest.raises(pb.UnsupportedError, match="NdPPoly"):
        pb.certify(hinge(tmp_path), many)
    with pytest.raises(pb.UnsupportedError, match="degree 60"):
        pb.certify(hinge(tmp_path), interpolate.PPoly(np.zeros((61, 1, 2)), [0.0, 1.0]))


def test_high_degrees_are_answered(tmp_path: Path) -> None:
    robot = hinge(tmp_path, 0.01)
    for degree in (8, 20, 50):
        t = np.repeat([0.0, 1.0], degree + 1)
        for last, verdict in ((1.0, pb.Verdict.CERTIFIED), (1.9, pb.Verdict.VIOLATED)):
            c = np.linspace([0.0, 0.0], [last, 1.0], degree + 1)
            found = pb.certify(robot, interpolate.BSpline(t, c, degree))
            assert found.verdict is verdict
            line = pb.certify(robot, [c[0], c[-1]])
            assert found.lower == pytest.approx(line.lower, abs=2e-6)


def test_a_periodic_spline_says_that_one_period_is_looked_at(tmp_path: Path) -> None:
    c = np.zeros((2, 1, 2))
    c[0, 0, 0] = 0.5
    found = pb.certify(hinge(tmp_path), interpolate.PPoly(c, [0.0, 1.0], extrapolate="periodic"))
    assert any("one period" in note and "'a' jumps back by 0.5" in note for note in found.notes)
    x = np.linspace(0, 1, 5)
    y = np.column_stack([np.sin(2 * np.pi * x), np.cos(2 * np.pi * x)])
    y[-1] = y[0]
    found = pb.certify(hinge(tmp_path), interpolate.CubicSpline(x, y, bc_type="periodic"))
    assert [note for note in found.notes if "jumps" in note] == []
    assert any("one period" in note for note in found.notes)


def test_one_straight_piece_is_known_as_the_same_piece_among_others() -> None:
    rng = np.random.default_rng(8)
    Q = np.concatenate((rng.normal(size=(3, 4)) * 10.0 ** rng.integers(-8, 4, size=(3, 4)), [[0.1, 0.3, -0.7, 1e9]]))
    one, several = (as_trajectory(Q[:count], ("a", "b", "c", "d")) for count in (2, 4))
    u = np.concatenate(([0.0, 1.0, np.nextafter(1.0, 0.0), 0.5], rng.uniform(size=50)))
    first = np.zeros(len(u), dtype=np.intp)
    assert np.array_equal(one.at(first, u), several.at(first, u))
    for place, motion in ((0, one), (2, several)):  # the ends are the waypoints themselves, to the last bit
        assert np.array_equal(motion.at(np.full(2, place), np.array([0.0, 1.0])), Q[place : place + 2])
    assert np.array_equal(one.extent, (Q[:2].min(axis=0), Q[:2].max(axis=0)))
