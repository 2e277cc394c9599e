"""The batch kernel equals the reference interpreter, whatever the backend, layout, number of rows or threads."""

import importlib.metadata
import importlib.util
import logging
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.kernel import arguments, choice, engine
from pinbound.kernel.program import _common_program, compile_program
from pinbound.robot.robot import Robot

BACKENDS = [
    "numpy",
    pytest.param("compiled", marks=pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")),
]
RELATIVE = 1e-12
ABSOLUTE = 4e-15
"""Of the paths' lengths (all about 1 m here): what rounding leaves of a norm near contact."""

SLIDER = """<robot name="slider" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.3" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q2" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0" rpy="0 0.4 1"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="q3" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.25"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q4" type="continuous"><parent link="c"/><child link="d"/>
    <origin xyz="0.1 0.1 0" rpy="1.5707963267948966 0 0"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="q5" type="revolute"><parent link="d"/><child link="e"/><origin xyz="0.1 0 0.1"/>
    <axis xyz="0 1 0"/><mimic joint="q3" multiplier="-1.5" offset="0.2"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="p0" link="base" xyz="0.3 0.2 0.1" radius="0.02"/>
    <pinbound:point name="pa" link="a" xyz="-0.1 0.2 0.1" radius="0.03"/>
    <pinbound:point name="pb" link="b" xyz="0.1 0.12 0.4"/>
    <pinbound:point name="pc" link="c" xyz="0.31 0.02 0.1" radius="0.01"/>
    <pinbound:point name="pd" link="d" xyz="-0.3 0.2 0.17"/>
    <pinbound:point name="pe" link="e" xyz="0.3 0.25 -0.1" radius="0.02"/>
    <pinbound:boundary name="b0" a="p0" b="pe" min_distance="0.01"/>
    <pinbound:boundary name="b1" a="p0" b="pc"/>
    <pinbound:boundary name="b2" a="pa" b="pd"/>
    <pinbound:boundary name="b3" a="pe" b="pc"/>
    <pinbound:boundary name="b4" a="pb" b="pd"/>
    <pinbound:boundary name="b5" a="pa" b="pb"/>
  </pinbound:annotations>
</robot>
"""


def panda(folder: Path) -> Robot:
    """A few dozen sphere pairs of the Panda, many enough for the common frame to win and for several loops."""
    share = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    links = [f"panda_link{i}" for i in range(8)] + ["panda_hand"]
    rng = np.random.default_rng(7)
    points = [(f"{link}_{k}", link, rng.uniform(-0.08, 0.08, 3).round(3)) for link in links for k in range(2)]
    pairs = [
        (a[0], b[0]) for i, a in enumerate(points) for b in points[i + 1 :] if links.index(b[1]) - links.index(a[1]) > 2
    ]
    lines = ["home: {panda_joint4: -1.5, panda_joint6: 1.8}", "points:"]
    lines += [
        f"- {{name: {n}, link: {link}, xyz: {xyz.tolist()}, radius: 0.0{1 + i % 4}}}"
        for i, (n, link, xyz) in enumerate(points)
    ]
    lines += ["boundaries:"] + [f"- {{name: c{i}, a: {a}, b: {b}}}" for i, (a, b) in enumerate(pairs[::3])]
    sidecar = folder / "panda.yaml"
    sidecar.write_text("\n".join(lines))
    return pb.load(share / "example-robot-data/robots/panda_description/urdf/panda.urdf", annotations=sidecar)


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    folder = tmp_path_factory.mktemp("robots")
    (folder / "slider.urdf").write_text(SLIDER)
    return {
        "minervabot": pb.load("minervabot_v3"),
        "slider": pb.load(folder / "slider.urdf"),
        "panda": panda(folder),
    }


NAMES = ["minervabot", "slider", "panda"]


def reference(robot: Robot, Q: Any, what: str = "norm") -> Any:
    return np.stack([getattr(boundary, what)(Q) for boundary in robot.boundaries], axis=1)


def configurations(robot: Robot, count: int, seed: int = 0, reach: float = 6.0) -> Any:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, len(robot.coordinates)))


def close(found: Any, expected: Any) -> bool:
    return bool(np.allclose(found, expected, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True))


def test_the_fixtures_reach_both_programs(robots: dict[str, Robot]) -> None:
    assert not robots["minervabot"].boundaries.kernel.program.is_common
    assert robots["panda"].boundaries.kernel.program.is_common
    assert not all(b.path.minimal.is_planar for b in robots["slider"].boundaries)
    assert any(np.any(b.path.minimal.slides) for b in robots["slider"].boundaries)


@pytest.mark.parametrize("name", NAMES)
def test_local_and_common_programs_give_the_same_norms(name: str, robots: dict[str, Robot]) -> None:
    robot = robots[name]
    kernel, n = robot.boundaries.kernel, len(robot.coordinates)
    Q = configurations(robot, 50, seed=8)
    common = robot.boundaries.common()
    for program in (
        compile_program(kernel.pairs, n),
        engine.Kernel(kernel.pairs, n, kernel.reference, lambda: common).program,
    ):
        one = engine.Kernel(kernel.pairs, n, kernel.reference, lambda: None)
        one.__dict__["program"] = program
        assert close(one.rows(Q, "norms", backend="numpy"), reference(robot, Q))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", NAMES)
def test_norms_clearances_and_gradients_equal_the_reference(name: str, backend: Any, robots: dict[str, Robot]) -> None:
    robot = robots[name]
    B, thresholds = robot.boundaries, np.array([b.threshold for b in robot.boundaries])
    Q = configurations(robot, 1003)
    assert close(B.norms(Q, backend=backend), reference(robot, Q))
    assert close(B.clearances(Q, backend=backend), reference(robot, Q) - thresholds)
    gradients, expected = B.gradients(Q[:201], backend=backend), reference(robot, Q[:201], "gradient")
    far = reference(robot, Q[:201]) > 1e-3
    assert np.allclose(gradients[far], expected[far], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", NAMES)
def test_smallest_is_the_least_clearance_and_its_boundary(name: str, backend: Any, robots: dict[str, Robot]) -> None:
    robot = robots[name]
    B, Q = robot.boundaries, configurations(robots[name], 2001, seed=1)
    expected = reference(robot, Q, "signed_clearance")
    found = B.smallest(Q, backend=backend)
    assert close(B.signed_clearances(Q, backend=backend), expected)
    assert close(found.clearance, expected.min(axis=1))
    assert close(np.take_along_axis(expected, found.index[:, None], 1)[:, 0], expected.min(axis=1))
    assert np.array_equal(B.free(Q, limits=False, backend=backend), expected.min(axis=1) > 0.0)
    within = np.all([limit.holds(Q) for limit in robot.linear_limits], axis=0)
    assert np.array_equal(B.free(Q, backend=backend), within & (expected.min(axis=1) > 0.0))
    one = B.smallest(Q[0])
    assert (one.index, B.free(Q[0], limits=False)) == (found.index[0], bool(expected[0].min() > 0.0))


@pytest.mark.parametrize("name", NAMES)
def test_one_configuration_equals_the_batch(name: str, robots: dict[str, Robot]) -> None:
    robot = robots[name]
    for q in configurations(robot, 20, seed=2):
        assert close(robot.boundaries.norms(q), reference(robot, q[None])[0])
        assert close(robot.boundaries.gradients(q), reference(robot, q[None], "gradient")[0])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", NAMES)
def test_what_is_not_finite_stays_with_the_boundaries_that_use_it(
    name: str, backend: Any, robots: dict[str, Robot]
) -> None:
    robot = robots[name]
    Q = configurations(robot, 700, seed=3)
    for j in range(len(robot.coordinates)):
        Q[10 + 50 * j, j], Q[11 + 50 * j, j] = np.nan, (-1) ** j * np.inf
    B = robot.boundaries
    expected = reference(robot, Q)
    assert close(B.norms(Q, backend=backend), expected)
    with np.errstate(invalid="ignore"):
        expected = np.min(reference(robot, Q, "signed_clearance"), axis=1)
    found = B.smallest(Q, backend=backend)
    assert close(found.clearance, expected)
    assert np.array_equal(found.index == -1, np.isnan(expected))
    assert not np.any(B.free(Q, backend=backend)[np.isnan(expected)])
    assert close(B.norms(Q[10]), reference(robot, Q[10:11])[0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_far_angles_reach_libm(backend: Any, robots: dict[str, Robot]) -> None:
    robot = robots["minervabot"]
    Q = configurations(robot, 600, seed=4)
    Q[5:9] *= [[1e5], [1e7], [1e12], [1e300]]
    single = [b for b in robot.boundaries if len(b.coordinates) == 1]
    columns = [robot.boundaries.names.index(b.name) for b in single]
    expected = np.stack([b.norm(Q) for b in single], axis=1)
    assert close(robot.boundaries.norms(Q, backend=backend)[:, columns], expected)


@pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")
def test_a_row_does_not_depend_on_the_rows_around_it(robots: dict[str, Robot]) -> None:
    robot = robots["panda"]
    Q = configurations(robot, 20_000, seed=5)
    whole = robot.boundaries.norms(Q, backend="compiled")
    for rows in (slice(0, 1), slice(1, 18), slice(777, 1900), slice(19_999, None)):
        assert np.array_equal(robot.boundaries.norms(Q[rows], backend="compiled"), whole[rows])
    assert np.array_equal(robot.boundaries.norms(Q, backend="compiled", threads=3), whole)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("order", ["C", "F"])
def test_out_is_filled_and_returned(order: Any, backend: Any, robots: dict[str, Robot]) -> None:
    robot = robots["minervabot"]
    Q, B = configurations(robot, 300, seed=6), robot.boundaries
    out = np.full((300, len(B)), np.nan, order=order)
    assert B.norms(Q, out, backend=backend) is out
    assert close(out, reference(robot, Q))
    least = np.empty(300)
    assert B.smallest(Q, least, backend=backend).clearance is least
    signed = np.empty((300, len(B)), order=order)
    assert B.signed_clearances(Q, signed, backend=backend) is signed
    assert close(signed, reference(robot, Q, "signed_clearance"))
    assert close(least, signed.min(axis=1))
    slopes = np.empty((300, len(B), 3))
    assert np.shares_memory(B.gradients(Q, slopes, backend=backend), slopes)
    assert np.allclose(slopes, reference(robot, Q, "gradient"), rtol=1e-9, atol=1e-12)
    row = np.empty(len(B))
    B.norms(Q[0], row)
    assert close(row, out[0])


@pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", NAMES)
def test_layouts_and_threads_do_not_change_a_bit(name: str, dtype: Any, robots: dict[str, Robot]) -> None:
    robot, N = robots[name], 9001
    B, Q = robot.boundaries, configurations(robot, 9001, seed=11)
    Q[N - 3, 0], Q[N - 2, 0] = np.nan, 1e9
    m, each = len(B), np.dtype(dtype).itemsize
    whole = B.norms(Q, backend="compiled", dtype=dtype)
    steps = np.zeros((2 * N, 3 * m), dtype)[::-2, ::3]
    uneven = np.zeros(N, np.dtype([("norms", dtype, (m,)), ("rest", np.int8)]))["norms"]
    odd = np.frombuffer(bytearray(N * m * each + 1), dtype=dtype, count=N * m, offset=1).reshape(N, m)
    assert uneven.strides[0] % each
    assert not odd.flags.aligned
    for out in (np.empty((N, m), dtype), np.empty((N, m), dtype, order="F"), steps, uneven, odd):
        B.norms(Q, out, backend="compiled", dtype=dtype, threads=2)
        assert np.array_equal(out, whole, equal_nan=True)
    for rows in (np.asfortranarray(Q), np.repeat(Q, 2, axis=0)[::2], Q[::-1].copy()[::-1]):
        assert np.array_equal(B.norms(rows, backend="compiled", dtype=dtype), whole, equal_nan=True)
    least = B.smallest(Q, backend="compiled", dtype=dtype)
    every = np.zeros((N, 5), dtype)
    again = B.smallest(Q, every[:, 3], backend="compiled", dtype=dtype, threads=2)
    assert np.array_equal(every[:, 3], least.clearance, equal_nan=True)
    assert np.array_equal(again.index, least.index)
    assert not np.any(every[:, [0, 1, 2, 4]])
    assert not np.any(steps.base[::-2, 1::3])


def test_out_of_a_wrong_shape_or_type_is_refused(robots: dict[str, Robot]) -> None:
    B = robots["minervabot"].boundaries
    for out in (np.empty((4, 10)), np.empty((5, 10), dtype=np.float32), [[0.0]]):
        with pytest.raises(pb.DimensionError, match="give a writeable float64 array of shape"):
            B.norms(np.zeros((5, 3)), out)
    with pytest.raises(pb.DimensionError, match="float64 or float32"):
        B.norms(np.zeros((5, 3)), dtype=np.int32)
    with pytest.raises(pb.DimensionError, match="threads is 0"):
        B.norms(np.zeros((5, 3)), threads=0)
    with pytest.raises(pb.UnknownNameError, match="no backend 'numbo'"):
        B.norms(np.zeros((5, 3)), backend="numbo")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", NAMES)
def test_float32_keeps_six_digits(name: str, backend: Any, robots: dict[str, Robot]) -> None:
    robot = robots[name]
    Q = configurations(robot, 1000, seed=9, reach=3.0).astype(np.float32).astype(np.float64)
    found = robot.boundaries.norms(Q, backend=backend, dtype=np.float32)
    scale = max(b.path.minimal.scale for b in robot.boundaries) + 1.5
    assert found.dtype == np.float32
    assert float(np.max(np.abs(found - reference(robot, Q)))) < 1e-6 * scale
    least = robot.boundaries.smallest(Q, backend=backend, dtype=np.float32).clearance
    assert np.allclose(least, robot.boundaries.smallest(Q).clearance, atol=1e-6 * scale)


def test_gradients_are_nan_where_a_norm_is_zero(tmp_path: Path) -> None:
    path = tmp_path / "touch.urdf"
    path.write_text("""<robot name="touch" xmlns:pinbound="urn:pinbound:1"><link name="a"/><link name="b"/>
      <joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
      <pinbound:annotations><pinbound:home q="1"/><pinbound:point name="x" link="a" xyz="1 0 0"/>
      <pinbound:point name="y" link="b" xyz="1 0 0"/><pinbound:boundary name="c" a="x" b="y"/>
      </pinbound:annotations></robot>""")
    B = pb.load(path).boundaries
    assert B.norms([[0.0]], backend="numpy")[0, 0] == 0.0
    for backend in ("numpy", "auto"):
        assert np.isnan(B.gradients([[0.0]], backend=backend)[0, 0, 0])


def test_a_set_without_boundaries_is_free(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text("""<robot name="bare"><link name="a"/><link name="b"/>
      <joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>""")
    B = pb.load(path).boundaries
    assert B.norms(np.zeros((4, 1))).shape == (4, 0)
    assert B.gradients([0.0]).shape == (0, 1)
    assert np.all(B.free(np.zeros((4, 1))))
    assert B.smallest(np.zeros((2, 1))).clearance.tolist() == [np.inf, np.inf]
    assert B.smallest([0.0]).index == -1


def test_a_set_survives_pickling(robots: dict[str, Robot]) -> None:
    for robot in robots.values():
        Q = configurations(robot, 40, seed=10)
        kernel = pickle.loads(pickle.dumps(robot.boundaries.kernel))
        assert np.array_equal(kernel.rows(Q, "norms", backend="numpy"), robot.boundaries.norms(Q, backend="numpy"))


def test_without_numba_there_is_one_notice(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, robots: dict[str, Robot]
) -> None:
    for module in (arguments, choice, engine):
        monkeypatch.setattr(module, "has_numba", lambda: False)
    monkeypatch.setattr(choice, "_noticed", [])
    monkeypatch.setattr(choice, "PAYS", 1e-6)
    B = pb.load("minervabot_v3").boundaries
    with caplog.at_level(logging.WARNING, logger="pinbound"):
        for _ in range(3):
            assert close(B.norms(np.ones((50, 3))), reference(robots["minervabot"], np.ones((50, 3))))
    assert [record.message for record in caplog.records if "pinbound[fast]" in record.message] != []
    assert len(caplog.records) == 1
    with pytest.raises(pb.UnsupportedError, match=r"pinbound\[fast\]"):
        B.norms(np.ones((50, 3)), backend="compiled")


FAR_APART = """<robot name="far" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="a"/><link name="b"/>
  <joint name="q1" type="continuous"><parent link="base"/><child link="a"/><origin xyz="1e5 2e5 -3e5"/>
    <axis xyz="0.36 0.48 0.8"/></joint>
  <joint name="q2" type="continuous"><parent link="base"/><child link="b"/><origin xyz="-4e5 1e5 2e5" rpy="1 2 3"/>
    <axis xyz="0.6 0 0.8"/></joint>
  <pinbound:annotations contact_tolerance="1">
    <pinbound:plane name="wall" link="b" xyz="1e5 -9e5 -7e5" normal="0.48 0.6 0.64"/>
    <pinbound:line name="pole" link="b" xyz="-3e5 5e5 1e5" direction="0.6 0.64 0.48"/>
    <pinbound:segment name="bar" link="a" xyz_a="2e5 4e5 1e4" xyz_b="-8e5 5e5 -8e5"/>
    <pinbound:point name="tip" link="a" xyz="5e5 -3e5 6e5"/>
    <pinbound:sweep name="plate" link="a" xyz="1e5 1e5 1e5" ways="2e5 0 1e5  0 3e5 0"/>
    {pairs}
  </pinbound:annotations></robot>"""


def test_normals_and_directions_are_turned_and_not_subtracted(tmp_path: Path) -> None:
    """On a robot of 1000 km a normal of 1 m, taken as a difference, would be off by 1e-10, and heights by 0.1 mm."""
    pairs = [(flat, mark) for flat in ("wall", "pole") for mark in ("bar", "tip", "plate")]
    marked = "".join(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs)
    path = tmp_path / "far.urdf"
    path.write_text(FAR_APART.format(pairs=marked + '<pinbound:home q1="0.3" q2="2.2"/>'))
    robot = pb.load(path)
    kernel = robot.boundaries.kernel
    Q = np.random.default_rng(5).uniform(-200.0, 200.0, (200, 2))
    expected = np.column_stack([boundary.norm(Q) for boundary in robot.boundaries])
    length = max(boundary.path.minimal.scale for boundary in robot.boundaries)
    for program in (kernel.program, _common_program(kernel.pairs, 2, robot.boundaries.common())):
        kernel.__dict__ |= {"program": program, "_scalar": {}, "_compiled": {}}
        for name in ("_linear", "_values"):
            kernel.__dict__.pop(name, None)
        assert np.abs(robot.boundaries.norms(Q, backend="numpy") - expected).max() < 1e-14 * length
        assert np.abs(robot.boundaries.norms(Q[0]) - expected[0]).max() < 1e-14 * length


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("mode", ["norms", "clearances", "gradients", "smallest"])
def test_out_must_have_memory_of_its_own(robots: dict[str, Robot], backend: Any, mode: str) -> None:
    """Shifted, reversed, interleaved with q, or laid over itself: refused, and what is apart still works."""
    B = robots["slider"].boundaries
    m, n, count = len(B), 4, 300
    shape = {"norms": (count, m), "clearances": (count, m), "gradients": (count, m, n), "smallest": (count,)}[mode]
    ask, size = getattr(B, mode), int(np.prod(shape))
    memory = np.random.default_rng(3).uniform(-1.0, 1.0, size + count * n)
    Q = memory[: count * n].reshape(count, n)
    right = ask(Q.copy(), backend=backend)
    right = right.clearance if mode == "smallest" else right
    for start in (0, 1, n, count * n - 1):
        with pytest.raises(pb.DimensionError, match="shares memory"):
            ask(Q, out=memory[start : start + size].reshape(shape), backend=backend)
        with pytest.raises(pb.DimensionError, match="shares memory"):
            ask(Q[::-1], out=memory[start : start + size].reshape(shape), backend=backend)
    apart = memory[count * n :].reshape(shape)
    found = ask(Q, out=apart, backend=backend)
    assert np.array_equal(apart, right)
    assert (found.clearance if mode == "smallest" else found) is apart
    over_itself = np.lib.stride_tricks.as_strided(np.zeros(size), shape, (0,) * len(shape))
    with pytest.raises(pb.DimensionError, match="in several places"):
        ask(Q, out=over_itself, backend=backend)
    frozen = np.zeros(shape)
    frozen.flags.writeable = False
    for wrong in (frozen, np.zeros(shape, dtype=np.float32), np.zeros((*shape, 1)), [0.0]):
        with pytest.raises(pb.DimensionError, match="out is"):
            ask(Q, out=wrong, backend=backend)


def test_q_and_out_may_take_turns_in_one_block(robots: dict[str, Robot]) -> None:
    """Bounds alone would say that they overlap; no number is in both."""
    B = robots["slider"].boundaries
    block = np.zeros((50, 4 + len(B)))
    block[:, :4] = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 4))
    right = B.norms(block[:, :4].copy())
    assert np.abs(B.norms(block[:, :4], out=block[:, 4:]) - right).max() < 1e-12


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_type_cannot_hold_is_no_number(robots: dict[str, Robot], backend: Any) -> None:
    """float32 ends at 3.4e38; a slide of 1e200 m has no square. Neither is a clearance of infinity."""
    B = robots["slider"].boundaries
    for dtype, value, used in ((np.float32, 1e39, 3), (np.float32, -3.5e38, 0), (np.float64, 1e200, 1)):
        Q = np.zeros((40, 4))
        Q[3, used] = Q[37, used] = value
        norms = B.norms(Q, backend=backend, dtype=dtype)
        depends = np.array([("q1", "q2", "q3", "q4")[used] in boundary.coordinates for boundary in B])
        assert np.any(depends)
        for row in (3, 37):
            assert np.array_equal(np.isnan(norms[row]), depends)
        assert np.all(np.isfinite(np.delete(norms, (3, 37), axis=0)))
        gradients = B.gradients(Q, backend=backend, dtype=dtype)
        assert np.array_equal(np.isnan(gradients[3]).all(axis=1), depends)
        least = B.smallest(Q, backend=backend, dtype=dtype)
        assert np.isnan(least.clearance[[3, 37]]).all()
        assert least.index[[3, 37]].tolist() == [-1, -1]
        assert np.all(least.index[4:37] >= 0)
        if dtype is np.float64:
            assert not np.any(B.free(Q, backend=backend)[[3, 37]])
            assert not B.free(Q[3])
            assert np.array_equal(np.isnan(B.norms(Q[3])), depends)


def test_choices_are_checked_however_few_rows_there_are(robots: dict[str, Robot]) -> None:
    B = robots["slider"].boundaries
    for Q in (np.zeros((0, 4)), np.zeros(4), np.zeros((3, 4))):
        for ask in (B.norms, B.clearances, B.gradients, B.smallest, B.free):
            for threads in (0, 1.5, True):
                with pytest.raises(pb.DimensionError, match="whole number"):
                    ask(Q, threads=threads)
            with pytest.raises(pb.UnknownNameError, match="backend"):
                ask(Q, backend="fortran")
    with pytest.raises(pb.DimensionError, match="out= is for many q"):
        B.smallest(np.zeros(4), out=np.zeros(1))
    assert B.norms(np.zeros((0, 4)), out=np.zeros((0, len(B)))).shape == (0, len(B))


def test_a_row_that_is_no_number_stays_one_where_boxes_are_searched(tmp_path: Path) -> None:
    """The box's boundary does not depend on q2; the other's NaN must not be replaced by its clearance."""
    path = tmp_path / "mixed.urdf"
    path.write_text(
        SLIDER.replace(
            "</pinbound:annotations>",
            '<pinbound:sweep name="box" link="base" xyz="2 2 2" ways="0.1 0 0 0 0.1 0 0 0 0.1"/>'
            '<pinbound:boundary name="b6" a="box" b="pa"/></pinbound:annotations>',
        )
    )
    B = pb.load(path).boundaries
    Q = np.zeros((5, 4))
    Q[2, 1] = np.nan
    for backend in ("auto", "numpy"):
        least = B.smallest(Q, backend=backend)
        assert np.flatnonzero(np.isnan(least.clearance)).tolist() == [2]
        assert least.index[2] == -1
        assert B.free(Q, backend=backend)[2] == np.False_
    assert np.isnan(B.smallest(Q[2]).clearance)
    assert not B.free(Q[2])
