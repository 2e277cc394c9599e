"""The default backend: never much slower than NumPy, soon compiled, and of the same signs as every other."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.kernel import choice
from pinbound.kernel.choice import PAYS, Choice, Work
from pinbound.machine import compiled
from pinbound.machine.compiled import KernelSource

NUMBA = pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")
SOURCE = KernelSource("", 0)


def play(works: list[Work], is_kept: bool, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return where each call runs: in NumPy, in code that is loaded or compiled for it, or in what is there."""
    monkeypatch.setattr(choice, "is_kept", lambda _: is_kept)
    monkeypatch.setattr(choice, "has_numba", lambda: True)
    found, there, counted = list[str](), False, Choice()
    for work in works:
        if there:
            found.append("there")
        elif counted.compiles("norms", work, lambda: SOURCE):
            there = True
            found.append("load" if is_kept else "compile")
        else:
            found.append("numpy")
    return found


@pytest.mark.parametrize("is_kept", [True, False])
@pytest.mark.parametrize("seed", range(20))
def test_no_sequence_of_calls_takes_much_longer_than_numpy(
    seed: int, is_kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    nodes = int(10 ** rng.uniform(1, 4))
    rows = (10 ** rng.uniform(0, 5 + seed % 3, size=400)).astype(int)
    own = {"code": 0.5, "load": 0.12} if seed % 4 == 1 else {}  # tables, whose code is no longer for more nodes
    works = [Work(int(count), 2.0 * nodes, nodes, **own) for count in rows]
    one = works[0].loading if is_kept else works[0].compilation
    numpy, taken = 0.0, 0.0
    for work, where in zip(works, play(works, is_kept, monkeypatch), strict=True):
        numpy += work.seconds
        # machine code is taken to be no faster at all: the bound must not live on it
        taken += work.seconds + (one if where in ("load", "compile") else 0.0)
        assert taken <= numpy * (1.0 + 1.0 / PAYS) + works[0].loading * 1.001


def test_the_first_call_of_a_cold_process_is_numpys_unless_it_pays_for_the_compiler(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    small, large = Work(90_000, 200.0, 116), Work(10**8, 200.0, 116)
    assert play([small], False, monkeypatch) == ["numpy"]
    assert play([small], True, monkeypatch) == ["numpy"]
    assert play([large], False, monkeypatch) == ["compile"]
    assert large.seconds > PAYS * large.compilation


def test_what_is_kept_runs_from_the_third_call_on(monkeypatch: pytest.MonkeyPatch) -> None:
    for rows in (1_000, 90_000):
        assert play([Work(rows, 200.0, 116)] * 4, True, monkeypatch)[2:] == ["there", "there"]
    many = play([Work(90_000, 200.0, 116)] * 1000, False, monkeypatch)
    assert many[:2] == ["numpy", "numpy"]
    assert many[-1] == "there"


@NUMBA
def test_all_answers_run_compiled_once_their_code_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PINBOUND_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiled, "_linked", {})  # what other tests linked is not kept in this folder
    before = pb.load("minervabot_v3").boundaries.kernel
    for mode in ("norms", "gradients"):
        assert before.prepare(mode) == "compiled"
    monkeypatch.setattr(compiled, "_linked", {})  # a new process, so to say
    B, Q = pb.load("minervabot_v3").boundaries, np.random.default_rng(3).uniform(-1, 1, (1000, 3))
    for mode, ask in (("norms", B.norms), ("gradients", B.gradients)):
        first = ask(Q)
        assert (mode, False) not in B.kernel._compiled
        second, third = ask(Q), ask(Q)
        assert (mode, False) in B.kernel._compiled
        assert np.array_equal(third, ask(Q, backend="compiled"))
        assert np.array_equal(second, third)
        assert np.allclose(first, third, rtol=1e-12, atol=1e-15)
    assert ("clearances", False) not in B.kernel._compiled


TWO_ARMS = """<robot name="arms" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="q1" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0.1 0 0.3" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/></joint>
  <joint name="q2" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0.1" rpy="0 0.4 1"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="q3" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.1 0 0.2"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="p" link="base" xyz="0.3 0.2 0.1" radius="0.1"/>
    <pinbound:point name="r" link="base" xyz="-0.7 0.2 0.1" radius="0.1"/>
    <pinbound:point name="s" link="c" xyz="0.05 0.1 0.1" radius="0.2"/>
    <pinbound:plane name="floor" link="base" xyz="0 0 0.2" normal="0.6 0 0.8"/>
    <pinbound:boundary name="ps" a="p" b="s"/>
    <pinbound:boundary name="rs" a="r" b="s"/>
    <pinbound:boundary name="sf" a="s" b="floor"/>
  </pinbound:annotations></robot>"""


def contacts(B: Any, k: int, seed: int) -> np.ndarray:
    """Return configurations at which the clearance of boundary k is zero, to the last digits of q, on both sides."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 3, (4000, 3))
    high = low + rng.uniform(-1, 1, (4000, 3))
    far = rng.integers(0, 4, 4000) == 0
    low[far, :2] += 2 * np.pi * 100
    high[far, :2] += 2 * np.pi * 100
    value = [B.clearances(rows, backend="numpy")[:, k] for rows in (low, high)]
    ends = value[0] * value[1] < 0
    low, high, sign = low[ends], high[ends], np.sign(value[0][ends])
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = np.sign(B.clearances(middle, backend="numpy")[:, k]) == sign
        low, high = np.where(same[:, None], middle, low), np.where(same[:, None], high, middle)
    ulps = rng.integers(-4, 5, (12, *low.shape)) * np.spacing(low)
    return (low + ulps).reshape(-1, 3)


@NUMBA
def test_no_sign_depends_on_the_backend(tmp_path: Path) -> None:
    path = tmp_path / "arms.urdf"
    path.write_text(TWO_ARMS)
    B = pb.load(path).boundaries
    for k in range(3):
        Q = contacts(B, k, seed=k)
        assert len(Q) > 300
        reference = B[k].clearance(Q)
        assert np.abs(reference).max() < 1e-11
        assert 0.1 < np.mean(reference > 0.0) < 0.9
        for backend in ("numpy", "compiled"):
            assert np.array_equal(B.clearances(Q, backend=backend)[:, k] > 0.0, reference > 0.0)
            assert np.array_equal(B.signed_clearances(Q, backend=backend)[:, k] > 0.0, reference > 0.0)
            alone = B.select([B.names[k]])
            assert np.array_equal(alone.smallest(Q, backend=backend).clearance > 0.0, reference > 0.0)
            assert np.array_equal(alone.free(Q, limits=False, backend=backend), reference > 0.0)
        few = Q[:100]
        assert [bool(B.clearances(q)[k] > 0.0) for q in few] == (reference[:100] > 0.0).tolist()
        assert [alone.free(q, limits=False) for q in few] == (reference[:100] > 0.0).tolist()
        assert np.array_equal(B.norms(Q, backend="numpy")[:, 2] > 0.0, B.norms(Q, backend="compiled")[:, 2] > 0.0)
