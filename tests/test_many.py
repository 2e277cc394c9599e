"""Many motions at once: the verdicts of one motion each, a witness for each VIOLATED, threads that change nothing."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb

ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="c" type="revolute"><parent link="fore"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="p" link="base" xyz="-0.2 0 0.1" radius="0.08"/>
    <pinbound:point name="u" link="upper" xyz="0.1 0 0.1" radius="0.05"/>
    <pinbound:point name="f" link="fore" xyz="0.25 0 0" radius="0.05"/>
    <pinbound:point name="h" link="hand" xyz="0.2 0 0" radius="0.05"/>
    <pinbound:box name="column" link="base" xyz="0.3 0.35 0.2" rpy="0 0 0.3" size="0.1 0.1 0.4"/>
    <pinbound:boundary name="p_h" a="p" b="h"/>
    <pinbound:boundary name="u_h" a="u" b="h"/>
    <pinbound:boundary name="u_f" a="u" b="f"/>
    <pinbound:boundary name="column_h" a="column" b="h"/>
  </pinbound:annotations>
</robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = Path(tmp_path_factory.mktemp("arm")) / "arm.urdf"
    path.write_text(ARM)
    return pb.load(path)


def motions(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    starts = rng.uniform(-2.4, 2.4, (count, 3))
    return starts, np.clip(starts + rng.normal(0, 0.5, (count, 3)), -2.9, 2.9)


@pytest.mark.parametrize("quick", [True, False])
def test_verdicts_are_those_of_certify(arm: pb.Robot, quick: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if quick:
        pytest.importorskip("numba")
    monkeypatch.setattr("pinbound.bounds.groups.Groups.is_worth", lambda *_: quick)
    starts, ends = motions(60, 4)
    found = pb.certify_many(arm, starts, ends)
    assert set(found) == {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}
    for row, verdict in enumerate(found):
        one = pb.certify(arm, [starts[row], ends[row]])
        assert verdict is one.verdict
        if verdict is pb.Verdict.CERTIFIED:
            assert np.all(np.isnan(found.witnesses[row]))
            assert found.lower[row] > 0.0
            assert found.lower[row] <= one.upper + 1e-12
            assert one.lower <= found.upper[row] + 1e-12
            assert abs(found.lower[row] - one.lower) <= 2.1e-6
        else:
            q = found.witnesses[row]
            t = (q - starts[row]) @ (ends[row] - starts[row]) / np.sum((ends[row] - starts[row]) ** 2)
            assert -1e-12 <= t <= 1.0 + 1e-12
            assert np.allclose(starts[row] + t * (ends[row] - starts[row]), q, atol=1e-12)
            assert not arm.boundaries.free(q)
            assert found.lower[row] == -np.inf


def test_threads_and_order_change_nothing(arm: pb.Robot) -> None:
    starts, ends = motions(90, 7)
    alone, shared = (pb.certify_many(arm, starts, ends, threads=threads) for threads in (1, 3))
    assert np.array_equal(alone.codes, shared.codes)
    finite = np.isfinite(alone.lower)
    assert np.allclose(alone.lower[finite], shared.lower[finite], atol=2.1e-6)
    backwards = pb.certify_many(arm, starts[::-1], ends[::-1])
    assert np.array_equal(alone.codes, backwards.codes[::-1])


def test_limits_count_and_nothing_is_nothing_to_check(arm: pb.Robot) -> None:
    starts, ends = np.zeros((2, 3)), np.array([[0.0, 0.2, 0.1], [2.6, 0.2, 0.1]])
    assert [v.value for v in pb.certify_many(arm, starts, ends, ["p_h"])] == ["certified", "violated"]
    assert [v.value for v in pb.certify_many(arm, starts, ends, ["p_h"], limits=False)] == ["certified", "certified"]
    only = pb.certify_many(arm, starts, ends, limits_only=True)
    assert [v.value for v in only] == ["certified", "violated"]
    assert only.notes
    bare = pb.certify_many(arm, starts, ends, [])
    assert [v.value for v in bare] == ["nothing to check", "violated"]
    assert bare.witnesses[1][0] > 2.5
    assert len(pb.certify_many(arm, np.zeros((0, 3)), np.zeros((0, 3)))) == 0


def test_what_is_no_list_of_motions_is_refused(arm: pb.Robot) -> None:
    good = np.zeros((2, 3))
    for starts, ends, said in (
        (good, np.zeros((3, 3)), "2 starts and 3 ends"),
        (np.zeros(3), np.zeros(3), "one row for each motion"),
        (good, np.array([[0, 0, 0], [0, np.nan, 0]]), "row 1 of ends is not finite"),
    ):
        with pytest.raises(pb.DimensionError, match=said):
            pb.certify_many(arm, starts, ends)
    with pytest.raises(pb.DimensionError, match="precision"):
        pb.certify_many(arm, good, good, precision=float("nan"))


def test_verdicts_are_neither_true_nor_false_and_cannot_be_written(arm: pb.Robot) -> None:
    found = pb.certify_many(arm, np.zeros((1, 3)), np.full((1, 3), 0.1))
    with pytest.raises(TypeError, match="neither true nor false"):
        bool(found)
    with pytest.raises(ValueError, match="read-only"):
        found.codes[0] = 1
    assert "1 certified" in repr(found)
    assert found.are(pb.Verdict.CERTIFIED).tolist() == [True]
