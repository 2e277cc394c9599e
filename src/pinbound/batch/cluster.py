"""The chunks of a job as tasks of a Dask cluster: same tables, same bytes, written only by this process.

If a worker dies, its tasks run again on the others; a chunk is on disk only when it is complete. If no worker is left,
or the scheduler stops, the job stops with a `MachineError`, and the same call resumes it.
"""

from __future__ import annotations

import asyncio
import importlib
import socket
import urllib.parse
from collections.abc import Iterator
from typing import Any

from pinbound.batch.evaluation import Evaluation, Statistics
from pinbound.batch.job import write_chunk
from pinbound.batch.sources import Source
from pinbound.exceptions import InputError, MachineError, Problem, UnsupportedError
from pinbound.typing import Array

__all__ = ["results"]

_CONNECT = "20s"
_KNOCK = 10.0  # seconds
_RECOVERY = 10.0  # seconds in which a cluster may get a worker again
_ATTEMPTS = 3
_TASKS_PER_THREAD = 2
"""Chunks in progress for each thread of the cluster: enough to keep it busy, with constant memory."""


def results(
    evaluation: Evaluation, source: Source, size: int, wanted: list[int], address: str
) -> Iterator[tuple[int, tuple[bytes, Statistics]]]:
    """Yield each chunk's bytes and statistics as the cluster finishes them.

    Raises:
        InputError: If the address has no protocol.
        MachineError: If no scheduler answers there, or if it loses all its workers.
        UnsupportedError: If Dask is not installed.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise UnsupportedError("a scheduler needs Dask; type: pip install 'pinbound[distributed]'") from error
    _knock(address)
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except ValueError as error:
        raise _no_address(address, f"; {_words(error)}") from error
    except (OSError, ImportError) as error:
        raise MachineError(
            f"no Dask scheduler answers at {address!r} ({_words(error)}); start it, then run again"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=60)
        except (TimeoutError, asyncio.TimeoutError) as error:  # two classes before Python 3.11
            raise MachineError(
                f"the scheduler at {address!r} has no worker after 60 s; start one, then run again"
            ) from error
        lost = (*_lost(distributed), OSError, TimeoutError, asyncio.TimeoutError, asyncio.CancelledError)
        done: set[int] = set()
        for attempt in range(_ATTEMPTS):
            try:
                left = [index for index in wanted if index not in done]
                for index, result in _run(distributed, client, evaluation, source, size, left):
                    done.add(index)
                    yield index, result
                return
            except lost as error:
                if attempt + 1 < _ATTEMPTS and _has_worker(client, lost):
                    continue  # a worker died with data that others needed: the remaining chunks are sent again
                message = f"the cluster at {address!r} lost its scheduler or its workers ({_words(error)})"
                raise MachineError(
                    f"{message}. What is written is kept: run the same command again to resume."
                ) from error


def _run(
    distributed: Any, client: Any, evaluation: Evaluation, source: Source, size: int, wanted: list[int]
) -> Iterator[tuple[int, tuple[bytes, Statistics]]]:
    """Yield each chunk as the cluster finishes it; a few for each thread are in progress at a time."""
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


def _has_worker(client: Any, lost: tuple[type[BaseException], ...]) -> bool:
    """Return whether the scheduler still answers, and has a worker or gets one soon."""
    try:
        client.wait_for_workers(1, timeout=_RECOVERY)
    except (TimeoutError, asyncio.TimeoutError, *lost):
        return False
    return True


def _knock(address: str) -> None:
    """Refuse an address without a listener, before Dask waits for it."""
    parts = urllib.parse.urlsplit(address)
    try:
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _no_address(address, f"; {_words(error)}") from error
    if "://" not in address or not parts.netloc:
        raise _no_address(address)
    if parts.scheme not in ("tcp", "tls"):
        return  # Dask supports other protocols, and reports their errors itself
    if not host or not port:
        raise _no_address(address)
    try:
        socket.create_connection((host, port), timeout=_KNOCK).close()
    except OSError as error:
        message = f"no Dask scheduler answers at {address!r} ({_words(error)}); start it, then run again"
        raise MachineError(message) from error


def _no_address(address: str, why: str = "") -> InputError:
    message = f"the scheduler's address is {address!r}{why}"
    return InputError([Problem(message, "Write it whole, e.g. tcp://127.0.0.1:8786", "--scheduler")])


def _lost(distributed: Any) -> tuple[type[BaseException], ...]:
    """Return the errors by which Dask reports that no worker can run a task; their names depend on the version."""
    client, comm = importlib.import_module("distributed.client"), importlib.import_module("distributed.comm")
    names = [(client, "FutureCancelledError"), (client, "FuturesCancelledError"), (distributed, "KilledWorker")]
    names += [(comm, "CommClosedError"), (importlib.import_module("concurrent.futures"), "CancelledError")]
    return tuple(getattr(module, name) for module, name in names if hasattr(module, name))


def _words(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _take(tasks: Iterator[Any], count: int) -> Iterator[Any]:
    for _ in range(count):
        task = next(tasks, None)
        if task is None:
            return
        yield task


def _tasks(client: Any, evaluation: Any, source: Source, size: int, wanted: list[int]) -> Iterator[Any]:
    """Submit chunks one by one: by row numbers for random-access sources, with data for streamed sources."""
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


def _evaluate(evaluation: Evaluation, Q: Array, index: int, size: int) -> tuple[int, tuple[bytes, Statistics]]:
    return index, write_chunk(evaluation, Q, index * size)
