"""A batch job: chunks to Parquet files, each written whole or not at all, and a manifest to resume from.

In the folder: `manifest.json` (robot, options, versions, state), `part-00000012.parquet` for each chunk, and beside it
`part-00000012.json` (rows, SHA-256, counts). The Parquet file is renamed into place first, the record second, so that
a record stands for a chunk that is complete; on resuming, a chunk counts as done if its record is there and the
checksum of its file is right. Rows and their numbers follow from the source alone, so none is lost and none is there
twice.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import importlib.metadata
import json
import os
import platform
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.batch.evaluation import BINS, VERDICTS, Evaluation, Statistics
from pinbound.batch.sources import Source, load_arrow
from pinbound.exceptions import InputError, Problem

__all__ = ["Outcome", "run", "write_chunk"]

Array = NDArray[np.float64]
Advance = Callable[[int], None]

FORMAT = 1


@dataclass(frozen=True)
class Outcome:
    """What a finished job found.

    Attributes:
        folder: Where the files are.
        chunks: Number of chunks.
        resumed: How many of them were there already.
        statistics: Of all rows.
        bytes: Size of all Parquet files.
    """

    folder: Path
    chunks: int
    resumed: int
    statistics: Statistics
    bytes: int

    def quantiles(self, evaluation: Evaluation, levels: tuple[float, ...]) -> Array:
        """Return (m, k) quantiles of the clearances [m], each the upper end of its bin: good to one bin's width."""
        result = np.full((len(evaluation.boundaries), len(levels)), np.nan)
        for k, (counts, (low, high)) in enumerate(zip(self.statistics.histograms, evaluation.spans, strict=True)):
            cumulative = np.cumsum(counts)
            if cumulative[-1]:
                bins = np.asarray(np.searchsorted(cumulative, np.array(levels) * cumulative[-1]), dtype=np.int64)
                result[k] = low + (bins + 1) * (high - low) / BINS
        return result


def run(
    evaluation: Evaluation,
    source: Source,
    folder: Path,
    chunk_rows: int = 1_000_000,
    threads: int = 1,
    scheduler: str | None = None,
    advance: Advance | None = None,
) -> Outcome:
    """Run a job, or what is left of it.

    Args:
        evaluation: What is asked of every row.
        source: The rows.
        folder: Where the files go; made if it is not there. An unfinished job of the same kind is resumed.
        chunk_rows: Rows a file; memory is a small multiple of one chunk.
        threads: Threads of the kernel, here.
        scheduler: Address of a Dask scheduler that runs the chunks instead; the folder is written by this process.
        advance: Called with the rows of each chunk that is done, those found done included.

    Returns:
        Counts and sizes.

    Raises:
        InputError: If the folder holds something else, or a job that differs in anything that the numbers depend on.
        UnsupportedError: If PyArrow is not installed.
    """
    load_arrow("pyarrow")
    if chunk_rows < 1 or threads < 1:
        raise _bad(folder, f"chunks of {chunk_rows} rows by {threads} threads", "Give 1 or more of both")
    folder.mkdir(parents=True, exist_ok=True)
    with _only_one(folder):
        manifest = _manifest(evaluation, source, chunk_rows)
        _claim(folder, manifest)
        count = -(-source.rows // chunk_rows)
        done = {index: record for index in range(count) if (record := _record(folder, index)) is not None}
        resumed = len(done)
        for record in done.values():
            _advance(advance, record["rows"])
        wanted = [index for index in range(count) if index not in done]
        for index, (data, statistics) in _results(evaluation, source, chunk_rows, wanted, threads, scheduler):
            done[index] = _keep(folder, index, data, statistics)
            _advance(advance, statistics.rows)
        records = [done[index] for index in range(count)]
        total = _merge(evaluation, [Statistics(**record["statistics"]) for record in records])
        chunks = [
            {"file": f"{_stem(i)}.parquet", **{k: r[k] for k in ("rows", "bytes", "sha256")}}
            for i, r in enumerate(records)
        ]
        state: dict[str, Any] = {"state": "complete", "rows": total.rows, "invalid": total.invalid, "chunks": chunks}
        if total.verdicts:
            state["verdicts"] = dict(zip(VERDICTS, total.verdicts, strict=True))
        _write(folder / "manifest.json", _json({**manifest, **state}))
    return Outcome(folder, count, resumed, total, sum(record["bytes"] for record in records))


def write_chunk(evaluation: Evaluation, Q: Array, start: int, threads: int = 1) -> tuple[bytes, Statistics]:
    """Return a chunk's Parquet file as bytes, the same ones wherever this runs, and its statistics."""
    arrow: Any = load_arrow("pyarrow")
    parquet: Any = load_arrow("pyarrow.parquet")
    table, statistics = evaluation.table(Q, start, threads)
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd", compression_level=1, use_dictionary=_dictionaries(table))
    return sink.getvalue().to_pybytes(), statistics


def _dictionaries(table: Any) -> list[str]:
    """Return the columns of few values; a dictionary of floats that never repeat costs time and gains nothing."""
    return [name for name in ("smallest_boundary", "verdict") if name in table.column_names]


def _results(
    evaluation: Evaluation, source: Source, size: int, wanted: list[int], threads: int, scheduler: str | None
) -> Iterator[tuple[int, tuple[bytes, Statistics]]]:
    if scheduler is not None:
        cluster = importlib.import_module("pinbound.batch.cluster")
        yield from cluster.results(evaluation, source, size, wanted, scheduler)
        return
    for index, Q in source.chunks(size, wanted):
        yield index, write_chunk(evaluation, Q, index * size, threads)


def _keep(folder: Path, index: int, data: bytes, statistics: Statistics) -> dict[str, Any]:
    """Write a chunk and then its record, each by an atomic rename."""
    _write(folder / f"{_stem(index)}.parquet", data)
    record = {
        "rows": statistics.rows,
        "bytes": len(data),
        "sha256": hashlib.sha256(data).hexdigest(),
        "statistics": dataclasses.asdict(statistics),
    }
    _write(folder / f"{_stem(index)}.json", _json(record))
    return record


def _record(folder: Path, index: int) -> dict[str, Any] | None:
    """Return the record of a chunk that is complete; None if it has to be made."""
    path = folder / f"{_stem(index)}.json"
    data = path.with_suffix(".parquet")
    if not path.is_file() or not data.is_file():
        return None
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError:
        return None
    digest = hashlib.sha256()
    with data.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return record if digest.hexdigest() == record.get("sha256") else None


def _merge(evaluation: Evaluation, parts: list[Statistics]) -> Statistics:
    rows, invalid = sum(part.rows for part in parts), sum(part.invalid for part in parts)
    verdicts = [sum(counts) for counts in zip(*(part.verdicts for part in parts), strict=True)]
    if not evaluation.summary or not parts:
        return Statistics(rows, invalid, verdicts)
    minima = np.min([part.minima for part in parts], axis=0).tolist()
    contacts = np.sum([part.contacts for part in parts], axis=0).tolist()
    histograms = np.sum([part.histograms for part in parts], axis=0).tolist()
    return Statistics(rows, invalid, verdicts, minima, contacts, histograms)


def _stem(index: int) -> str:
    return f"part-{index:08d}"


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, default=list) + "\n").encode()


def _write(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all, also after a power cut."""
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def _manifest(evaluation: Evaluation, source: Source, chunk_rows: int) -> dict[str, Any]:
    makers = ("pinbound", "numpy", "pyarrow", *(("numba",) if evaluation.backend == "compiled" else ()))
    versions = {name: importlib.metadata.version(name) for name in makers}
    return {
        "format": FORMAT,
        "state": "running",
        "job": {
            "robot": evaluation.robot,
            "robot_sha256": evaluation.digest(),
            "coordinates": evaluation.coordinates,
            "boundaries": evaluation.boundaries,
            "columns": evaluation.columns,
            "summary": evaluation.summary,
            "backend": evaluation.backend,
            "chunk_rows": chunk_rows,
            "source": source.describe(),
            "versions": versions,
        },
        "region_note": evaluation.region_note,
        "python": platform.python_version(),
        "machine": platform.machine(),
    }


def _claim(folder: Path, manifest: dict[str, Any]) -> None:
    """Start a job in an empty folder, or check that the one there is the same."""
    path = folder / "manifest.json"
    for left in folder.glob(".*.tmp"):
        left.unlink()
    if not path.is_file():
        others = sorted(entry.name for entry in folder.iterdir() if entry.name != _LOCK)
        if others:
            raise _bad(
                folder, f"holds other files ({', '.join(others[:4])})", "Give an empty folder, or that of the same job"
            )
        _write(path, _json(manifest))
        return
    try:
        there = json.loads(path.read_text(encoding="utf-8"))["job"]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise _bad(path, f"is no manifest of pinbound ({error})", "Give an empty folder") from error
    mine = json.loads(_json(manifest["job"]))
    differing = [key for key in mine if there.get(key) != mine[key]]
    if differing:
        words = "; ".join(f"{key} is {there.get(key)} there and {mine[key]} here" for key in differing)
        raise _bad(path, f"is of another job: {words}", "Give the same options, or another folder")


_LOCK = ".lock"


@contextmanager
def _only_one(folder: Path) -> Generator[None, None, None]:
    """Keep a second process out of the folder; the system lets go of the lock when a process dies."""
    try:
        fcntl: Any = importlib.import_module("fcntl")
    except ImportError:
        yield
        return
    with (folder / _LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise _bad(folder, "another process is writing there", "Wait for it, or give another folder") from error
        yield


def _advance(advance: Advance | None, rows: int) -> None:
    if advance is not None:
        advance(rows)


def _bad(path: Path, message: str, remedy: str) -> InputError:
    return InputError([Problem(message, remedy, str(path))])
