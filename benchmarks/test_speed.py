"""pytest-benchmark suites, peers in the same run: `pytest benchmarks`. Nothing is asserted on time."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import casadi_drake, peers, robots


@pytest.fixture(scope="module")
def minervabot() -> Any:
    return robots.minervabot()


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return robots.panda(Path(tmp_path_factory.mktemp("panda")))


def points(robot: Any, count: int) -> Any:
    return np.random.default_rng(0).uniform(-2 * np.pi, 2 * np.pi, (count, len(robot.coordinates)))


@pytest.mark.parametrize("mode", ["norms", "clearances", "gradients", "smallest", "least"])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.benchmark(group="minervabot, 90,000 configurations")
def test_kernel(benchmark: Any, minervabot: Any, backend: str, mode: str) -> None:
    benchmark(peers.kernel(minervabot, points(minervabot, 90_000), mode, backend))


@pytest.mark.benchmark(group="minervabot, 90,000 configurations")
@pytest.mark.parametrize("what", ["norms", "least"])
def test_hand_written_c(benchmark: Any, minervabot: Any, what: str) -> None:
    calls = peers.hand_written(minervabot, points(minervabot, 90_000))
    if not calls:
        pytest.skip("no C compiler")
    benchmark(calls[what])


@pytest.mark.benchmark(group="minervabot, 500 configurations")
@pytest.mark.parametrize(
    "peer",
    [
        peers.kernel,
        peers.pair_by_pair,
        peers.placements_loop,
        peers.collisions_in_parallel,
        peers.compute_distances,
        peers.coal_pair_by_pair,
    ],
)
def test_peer(benchmark: Any, minervabot: Any, peer: Any) -> None:
    benchmark(peer(minervabot, points(minervabot, 500)))


@pytest.mark.benchmark(group="minervabot, 90,000 configurations")
@pytest.mark.parametrize("what", ["generated C", "virtual machine"])
def test_casadi(benchmark: Any, minervabot: Any, what: str) -> None:
    pytest.importorskip("casadi")
    calls = casadi_drake.casadi_norms(minervabot, points(minervabot, 90_000))
    if what not in calls:
        pytest.skip("no C compiler")
    benchmark(calls[what])


@pytest.mark.benchmark(group="minervabot, 500 configurations")
@pytest.mark.parametrize("peer", [casadi_drake.drake_checker, casadi_drake.drake_distances])
def test_drake(benchmark: Any, minervabot: Any, peer: Any) -> None:
    pytest.importorskip("pydrake")
    benchmark(peer(minervabot, points(minervabot, 500)))


@pytest.mark.benchmark(group="one configuration")
def test_single_q(benchmark: Any, minervabot: Any) -> None:
    benchmark(minervabot.boundaries.norms, points(minervabot, 1)[0])


@pytest.mark.benchmark(group="panda, all sphere pairs, 10,000 configurations")
@pytest.mark.parametrize("peer", ["least", "smallest", "collisions_in_parallel", "drake_collisions"])
def test_panda(benchmark: Any, panda: Any, peer: str) -> None:
    Q = points(panda, 10_000)
    if peer == "drake_collisions":
        pytest.importorskip("pydrake")
        benchmark(casadi_drake.drake_collisions(panda, Q))
        return
    call = peers.collisions_in_parallel(panda, Q) if peer == "collisions_in_parallel" else peers.kernel(panda, Q, peer)
    benchmark(call)
