"""Contact curves: nothing missed, chords within the stated error, however small or close the curves are."""

import numpy as np
import pytest
import shapely

import pinbound as pb
from pinbound.bounds.derivative_bounds import lever_arms, line_bounds
from pinbound.evaluate import numeric
from pinbound.evaluate.planar import arrows
from pinbound.path.chain import Chain
from pinbound.path.restriction import restrict
from pinbound.region.contours import ContactFunction, trace

WINDOW = np.array([[-3.1, -3.0], [3.2, 3.1]])


def random_chain(rng: np.random.Generator, rotations: int, n: int, planar: bool, slides: bool = False) -> Chain:
    axes = np.tile([0.0, 1.0, 0.0], (rotations, 1)) if planar else rng.normal(size=(rotations, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    coefficients = rng.choice([-1.0, 0.0, 1.0, 2.0, 0.5], (rotations, n))
    coefficients[np.arange(rotations), rng.integers(0, n, rotations)] = 1.0
    slide = rng.normal(size=(rotations + 1, 3, n)) * 0.1 if slides else np.zeros((rotations + 1, 3, n))
    return Chain(rng.normal(size=(rotations + 1, 3)) * 0.3, slide, axes, coefficients, 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_lever_arms_bound_the_derivatives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_chain(rng, 3, 2, planar=False, slides=bool(seed % 2))
    arms = lever_arms(chain, np.array([1.5, 1.5]))
    X = rng.uniform(-1.5, 1.5, (4000, 2))
    r, J = numeric.jacobian(chain, X)
    assert np.linalg.norm(r, axis=1).max() <= arms.length
    assert np.all(np.linalg.norm(J, axis=1).max(axis=0) <= arms.first)
    for j in (0, 1):
        e = 1e-5 * np.eye(2)[j]
        second = (numeric.jacobian(chain, X + e)[1] - numeric.jacobian(chain, X - e)[1]) / 2e-5
        assert np.all(np.linalg.norm(second, axis=1).max(axis=0) <= arms.second[j] + 1e-8)
    bounds = line_bounds(chain, np.array([1.5, 1.5]), 0)
    assert bounds[0] == pytest.approx(arms.length)
    assert bounds[1] == pytest.approx(arms.first[0])
    assert bounds[2] == pytest.approx(arms.second[0, 0])
    third = [numeric.along(chain, 0, X + d)[2] for d in ([1e-5, 0.0], [-1e-5, 0.0])]
    assert np.linalg.norm(third[0] - third[1], axis=1).max() / 2e-5 <= bounds[3] + 1e-6


@pytest.mark.parametrize("seed", range(8))
def test_restricting_and_arrows_keep_the_norm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_chain(rng, 4, 4, planar=bool(seed % 2), slides=seed == 3)
    at = rng.uniform(-2, 2, 4)
    X = rng.uniform(-3, 3, (200, 2))
    Q = np.tile(at, (200, 1))
    Q[:, [2, 0]] = X
    expected = numeric.norm(numeric.positions(chain, Q))
    held = restrict(chain, at, [2, 0])
    np.testing.assert_allclose(numeric.norm(numeric.positions(held, X)), expected, rtol=0, atol=1e-13)
    turning = arrows(held)
    if turning is None:
        assert seed == 3 or not held.is_planar or not held.rotations
        return
    length, half, slopes = turning.half_square_gradient(X)
    r, J = numeric.jacobian(held, X)
    np.testing.assert_allclose(length, expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(half, np.einsum("nia,ni->na", J, r), rtol=0, atol=1e-13)
    np.testing.assert_allclose(slopes, np.linalg.norm(J, axis=1), rtol=0, atol=1e-13)


def two_arms(a: float = 1.0, b: float = 1.0, c: float = 1.0) -> Chain:
    offsets = np.array([[0.0, 0.0, a], [0.0, 0.0, b], [0.0, 0.0, c]])
    return Chain(offsets, np.zeros((3, 3, 2)), np.array([[0.0, 1.0, 0.0]] * 2), np.eye(2), a + b + c)


def contour_of(chain: Chain, threshold: float, accuracy: float = 1e-5, window: np.ndarray = WINDOW):
    function = ContactFunction.over(chain, threshold, window)
    return function, trace(function, window, accuracy)


@pytest.mark.parametrize("seed", range(20))
def test_an_island_of_a_ten_thousandth_of_a_radian_is_found(seed: int) -> None:
    """`|a + R(x)(b + R(y) c)| <= T` is an ellipse of area pi T^2 / |det J| around each of the two triangles."""
    rng = np.random.default_rng(seed)
    chain = two_arms(*rng.uniform(0.8, 1.2, 3))
    shift = rng.uniform(-0.5, 0.5, 2)
    window = WINDOW + shift
    _, contour = contour_of(chain, 1e-4, window=window)
    assert len(contour.lines) >= 2
    for line in contour.lines:
        np.testing.assert_array_equal(line[0], line[-1])
        centre = line.mean(axis=0)
        r, J = numeric.jacobian(chain, centre[None])
        assert np.linalg.norm(r) < 1e-5
        expected = np.pi * 1e-8 / np.sqrt(np.linalg.det(J[0].T @ J[0]))
        assert shapely.Polygon(line).area == pytest.approx(expected, rel=0.02)
    # the same by algebra: the angle between the first two arms from the law of cosines, with either sign
    a, b, c = (float(np.linalg.norm(offset)) for offset in chain.offsets)
    y = np.pi - np.arccos((b * b + c * c - a * a) / (2 * b * c))
    expected = [s for s in (y, -y, y - 2 * np.pi, 2 * np.pi - y) if window[0, 1] < s < window[1, 1]]
    np.testing.assert_allclose(sorted(x.mean(axis=0)[1] for x in contour.lines), sorted(expected), atol=1e-5)


@pytest.mark.parametrize("threshold", [0.02, 0.3, 0.95, 0.999, 1.001, 1.7, 2.9, 2.9999])
def test_chords_are_within_the_stated_error(threshold: float) -> None:
    _, coarse = contour_of(two_arms(), threshold, 1e-3)
    _, fine = contour_of(two_arms(), threshold, 1e-8 if threshold != 0.999 else 1e-7)
    assert coarse.chord_error <= 1e-3
    drawn = shapely.union_all([shapely.linestrings(line) for line in coarse.lines])
    exact = np.concatenate(fine.lines)
    assert shapely.distance(shapely.points(exact), drawn).max() <= coarse.chord_error + fine.chord_error


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_no_sign_change_without_a_curve_nearby(seed: int, planar: bool) -> None:
    """Along every grid line, between neighbours of opposite sign, there is a curve; elsewhere there is none odd."""
    rng = np.random.default_rng([seed, planar])
    chain = random_chain(rng, 3, 2, planar, slides=seed == 9)
    norms = numeric.norm(numeric.positions(chain, rng.uniform(-3, 3, (500, 2))))
    threshold = float(np.quantile(norms, 0.25))
    function, contour = contour_of(chain, threshold)
    axes = [np.linspace(*WINDOW[:, i] * 0.999, 80) for i in (0, 1)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    inside = (function.value(X.reshape(-1, 2)) <= 0.0).reshape(80, 80)
    drawn = shapely.union_all([shapely.linestrings(line) for line in contour.lines])
    shapely.prepare(drawn)
    steps = shapely.linestrings(np.stack((X[:-1], X[1:]), axis=2).reshape(-1, 2, 2))
    crossed = shapely.intersects(drawn, steps)
    differ = (inside[1:] != inside[:-1]).ravel()
    assert np.all(shapely.dwithin(drawn, steps[differ], contour.chord_error + 1e-12))
    assert np.mean(crossed[~differ]) < 0.02  # double crossings, which are rare


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, -1e-9, -1e-3])
def test_a_neck_that_closes_is_seen_on_its_right_side(depth: float) -> None:
    """At T = 3 - depth the curve is a loop of radius ~ sqrt(depth) around the stretched arm; above 3 there is none."""
    window = np.array([[-0.9, -0.8], [0.7, 0.85]])
    _, contour = contour_of(two_arms(), 3.0 - depth, window=window)
    assert (len(contour.lines) == 1) == (depth > 0.0)
    if depth > 0.0:
        assert shapely.Polygon(contour.lines[0]).contains(shapely.Point(0.0, 0.0))
        assert len(contour.unresolved) == 0


def test_a_curve_of_touching_points_ends_in_an_error_not_in_hours() -> None:
    """A norm that is equal to the threshold along a whole curve and never below: no budget of boxes would do."""
    chain = Chain(  # r = R_x(x) (z + R_z(y) x) has the norm sqrt(2) everywhere
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        np.zeros((3, 3, 2)),
        np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        np.eye(2),
        2.0,
    )
    with pytest.raises(pb.UnsupportedError, match="boxes"):
        contour_of(chain, 2.0**0.5)
