"""The same job on a real local Dask cluster of two processes: the same files bit for bit, a dead worker included."""

import hashlib
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.batch import RandomSource, evaluation_of, open_source, run

pytest.importorskip("pyarrow")
distributed: Any = pytest.importorskip("distributed")

# Dask's own noise: sockets and threads of processes that this test kills on purpose.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]

BOX = ((-1.0, -2.0, -2.0), (1.0, 2.0, 2.0))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as made:
            yield made


def digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("part-*.parquet")}


@pytest.mark.parametrize("kind", ["random", "csv"])
def test_a_cluster_writes_the_same_bytes(kind: str, cluster: Any, tmp_path: Path) -> None:
    robot = pb.load("minervabot_v3")
    evaluation = evaluation_of(robot, ("coordinates", "clearances", "smallest", "region", "verdict"), summary=True)
    source: Any = RandomSource(20_000, 3, *BOX)
    if kind == "csv":
        np.savetxt(tmp_path / "q.csv", source.read(0, 5000), delimiter=",", header="q1,q2,q3", comments="")
        source = open_source(tmp_path / "q.csv", robot.coordinates)
    here = run(evaluation, source, tmp_path / "here", chunk_rows=1500)
    there = run(evaluation, source, tmp_path / "there", chunk_rows=1500, scheduler=cluster.scheduler_address)
    assert digests(tmp_path / "there") == digests(tmp_path / "here")
    assert there.statistics == here.statistics


def test_a_worker_killed_in_the_middle_changes_nothing(cluster: Any, tmp_path: Path) -> None:
    robot = pb.load("minervabot_v3")
    evaluation = evaluation_of(robot, ("clearances", "verdict"))
    source = RandomSource(400_000, 8, *BOX)
    run(evaluation, source, tmp_path / "here", chunk_rows=10_000)
    pids = [worker.process.pid for worker in cluster.workers.values()]
    killed: list[int] = []

    def kill() -> None:
        deadline = time.monotonic() + 60
        while len(list((tmp_path / "there").glob("part-*.json"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.002)
        os.kill(pids[0], signal.SIGKILL)
        killed.append(len(list((tmp_path / "there").glob("part-*.json"))))

    thread = threading.Thread(target=kill)
    thread.start()
    run(evaluation, source, tmp_path / "there", chunk_rows=10_000, scheduler=cluster.scheduler_address)
    thread.join()
    assert killed
    assert killed[0] < 40
    assert digests(tmp_path / "there") == digests(tmp_path / "here")


def test_no_scheduler_at_the_address_is_said(tmp_path: Path) -> None:
    evaluation = evaluation_of(pb.load("minervabot_v3"), ("verdict",), backend="numpy")
    for address in ("nonsense://", "nonsense://here:1", "localhost:8786", "tcp://127.0.0.1", "tcp://127.0.0.1:x"):
        with pytest.raises(pb.InputError, match=f"the scheduler's address is '{address}'"):
            run(evaluation, RandomSource(10, 1, *BOX), tmp_path / "o", scheduler=address)
    with pytest.raises(pb.MachineError, match=r"no Dask scheduler answers at 'tcp://127.0.0.1:1'"):
        run(evaluation, RandomSource(10, 1, *BOX), tmp_path / "o", scheduler="tcp://127.0.0.1:1")


def test_a_cluster_that_loses_all_workers_or_its_scheduler_is_a_failure_of_the_machine(tmp_path: Path) -> None:
    """What is written is kept, and the same call completes it elsewhere with the same bytes."""
    evaluation = evaluation_of(pb.load("minervabot_v3"), ("clearances", "verdict"), backend="numpy")
    source = RandomSource(600_000, 8, *BOX)
    run(evaluation, source, tmp_path / "here", chunk_rows=10_000)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as made:

            def stop() -> None:
                deadline = time.monotonic() + 60
                while len(list((tmp_path / "there").glob("part-*.json"))) < 3 and time.monotonic() < deadline:
                    time.sleep(0.002)
                made.scale(0)

            thread = threading.Thread(target=stop)
            thread.start()
            with pytest.raises(pb.MachineError, match="run the same command again to resume"):
                run(evaluation, source, tmp_path / "there", chunk_rows=10_000, scheduler=made.scheduler_address)
            thread.join()
    assert 3 <= len(digests(tmp_path / "there")) < 60
    run(evaluation, source, tmp_path / "there", chunk_rows=10_000)
    assert digests(tmp_path / "there") == digests(tmp_path / "here")
