"""The chunks of a job as tasks of a Dask cluster: same tables, same bytes, written by this process alone.

A worker that dies takes nothing along: its tasks run again elsewhere, and a chunk is on disk only once it is whole.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.batch.evaluation import Evaluation, Statistics
from pinbound.batch.job import write_chunk
from pinbound.batch.sources import Source
from pinbound.exceptions import UnsupportedError

__all__ = ["results"]

_TASKS_PER_THREAD = 2
"""Chunks under way for each thread of the cluster: enough to keep it busy, and flat in memory."""


def results(
    evaluation: Evaluation, source: Source, size: int, wanted: list[int], address: str
) -> Iterator[tuple[int, tuple[bytes, Statistics]]]:
    """Yield each chunk's bytes and statistics as the cluster finishes them.

    Raises:
        UnsupportedError: If Dask is not installed, or no scheduler answers at the address.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise UnsupportedError("a scheduler needs Dask; install pinbound[distributed]") from error
    try:
        client = distributed.Client(address, timeout="20s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise UnsupportedError(f"no Dask scheduler answers at {address!r}: {error}") from error
    with client:
        client.wait_for_workers(1, timeout=60)
        threads = sum(client.nthreads().values())
        shared = client.scatter(evaluation, broadcast=True)
        pending = _tasks(client, shared, source, size, wanted)
        first = list(_take(pending, _TASKS_PER_THREAD * max(1, threads)))
        if not first:
            return
        running = distributed.as_completed(first, loop=client.loop)
        for future in running:
            yield future.result()
            future.release()
            for following in _take(pending, 1):
                running.add(following)


def _take(tasks: Iterator[Any], count: int) -> Iterator[Any]:
    for _ in range(count):
        task = next(tasks, None)
        if task is None:
            return
        yield task


def _tasks(client: Any, evaluation: Any, source: Source, size: int, wanted: list[int]) -> Iterator[Any]:
    """Submit chunks one by one: a random-access source by its rows, a streamed one with its data."""
    options = {"retries": 3, "pure": False}
    if source.is_random_access:
        for index in wanted:
            yield client.submit(_make, evaluation, source, index, size, **options)
        return
    for index, Q in source.chunks(size, wanted):
        yield client.submit(_evaluate, evaluation, Q, index, size, **options)


def _make(evaluation: Evaluation, source: Source, index: int, size: int) -> tuple[int, tuple[bytes, Statistics]]:
    Q = source.read(index * size, min((index + 1) * size, source.rows))
    return _evaluate(evaluation, Q, index, size)


def _evaluate(
    evaluation: Evaluation, Q: NDArray[np.float64], index: int, size: int
) -> tuple[int, tuple[bytes, Statistics]]:
    return index, write_chunk(evaluation, Q, index * size)
