"""A batch job: chunks to Parquet files, each complete or absent, and a manifest to resume from.

The folder contains `manifest.json` (robot, options, versions, state), `part-00000012.parquet` for each chunk, and its
record `part-00000012.json` (number, job, rows, SHA-256, counts). First the Parquet file is renamed to its final name,
then the record. So a record means that its chunk is complete. When a job resumes, a chunk counts as done under four
conditions: its record belongs to this job and this chunk, it has as many rows as the source has there, the input has
not changed since, and the checksum of its file is right. All other chunks are made again. At the end the totals must be
those of the source, and a file that was read must still be the one that was opened.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import importlib.metadata
import json
import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from pinbound.batch import files
from pinbound.batch.evaluation import BINS, VERDICTS, Evaluation, Statistics
from pinbound.batch.sources import Source
from pinbound.exceptions import MachineError
from pinbound.tables.columnar import load_arrow
from pinbound.typing import Array

__all__ = ["Outcome", "run", "write_chunk"]

Advance = Callable[[int], None]

FORMAT = 2
MOST_CHUNKS = 10**8
"""The names of the files have eight digits."""


@dataclass(frozen=True)
class Outcome:
    """The result of a finished job.

    Attributes:
        folder: The folder with the files.
        chunks: Number of chunks.
        resumed: Number of chunks that existed already.
        statistics: The statistics of all rows.
        bytes: Size of all Parquet files.
    """

    folder: Path
    chunks: int
    resumed: int
    statistics: Statistics
    bytes: int

    def quantiles(self, evaluation: Evaluation, levels: tuple[float, ...]) -> Array:
        """Return (m, k) quantiles of the clearances [m], each the upper end of its bin: accurate to a bin's width."""
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
    """Run a job, or the rest of it.

    Args:
        evaluation: The evaluation of every row.
        source: The rows.
        folder: The folder for the files; it is created if necessary. An unfinished job of the same kind is resumed.
        chunk_rows: Rows for each file; memory is a small multiple of one chunk.
        threads: Threads of the kernel, in this process.
        scheduler: Address of a Dask scheduler that runs the chunks instead; this process writes the folder.
        advance: Called with the number of rows of each finished chunk, also of those that existed already.

    Returns:
        Counts and sizes.

    Raises:
        InputError: If the source has no row; if the folder contains something else, or a job that differs in anything
            that the numbers depend on; or if the input changes during the job.
        MachineError: If the disk or the cluster fails; the same call resumes.
        UnsupportedError: If PyArrow is not installed.
    """
    load_arrow("pyarrow")
    if chunk_rows < 1 or threads < 1:
        raise files.bad(folder, f"chunks of {chunk_rows} rows by {threads} threads", "Give 1 or more of both")
    if source.rows < 1:  # files without a row would look like a job that found nothing wrong
        where = str(source.describe().get("name", "batch"))
        raise files.bad(Path(where), "there is no row", "Give at least one configuration")
    count = -(-source.rows // chunk_rows)
    if count > MOST_CHUNKS:
        message = f"{source.rows:.3g} rows make {count:.3g} files of {chunk_rows:,} rows; the most are {MOST_CHUNKS:,}"
        raise files.bad(folder, message, "Give fewer rows, or more rows per file (--chunk-rows)")
    files.make_folder(folder)
    manifest = _manifest(evaluation, source, chunk_rows)
    _look(folder, manifest)
    with files.only_one(folder):
        _look(folder, manifest)  # again, because another process may have started in between
        files.remove_leftovers(folder)
        if files.read(folder / "manifest.json") is None:
            files.write(folder / "manifest.json", _json(manifest))
        job = _Job(evaluation, source, folder, chunk_rows, hashlib.sha256(_json(manifest["job"])).hexdigest())
        done = {index: record for index in range(count) if (record := job.record(index)) is not None}
        resumed = len(done)
        for record in done.values():
            _advance(advance, record["rows"])
        wanted = [index for index in range(count) if index not in done]
        for index, (data, statistics) in _results(evaluation, source, chunk_rows, wanted, threads, scheduler):
            done[index] = job.keep(index, data, statistics)
            _advance(advance, statistics.rows)
        job.check(done, count, wanted)
        records = [done[index] for index in range(count)]
        total = _merge(evaluation, [Statistics(**record["statistics"]) for record in records])
        chunks = [
            {"file": f"{_stem(i)}.parquet", **{k: r[k] for k in ("rows", "bytes", "sha256")}}
            for i, r in enumerate(records)
        ]
        state: dict[str, Any] = {"state": "complete", "rows": total.rows, "invalid": total.invalid, "chunks": chunks}
        if total.verdicts:
            state["verdicts"] = dict(zip(VERDICTS, total.verdicts, strict=True))
        files.write(folder / "manifest.json", _json({**manifest, **state}))
    return Outcome(folder, count, resumed, total, sum(record["bytes"] for record in records))


@dataclass(frozen=True)
class _Job:
    """A job in its folder, which defines its chunks."""

    evaluation: Evaluation
    source: Source
    folder: Path
    size: int
    digest: str

    def rows(self, index: int) -> int:
        """Return the number of rows of a chunk."""
        return min(self.size, self.source.rows - index * self.size)

    def keep(self, index: int, data: bytes, statistics: Statistics) -> dict[str, Any]:
        """Write a chunk and then its record."""
        if statistics.rows != self.rows(index):
            message = f"chunk {index} came back with {statistics.rows} rows, not {self.rows(index)}"
            raise MachineError(f"{self.folder}: {message}. Run the same command again to resume.")
        files.write(self.folder / f"{_stem(index)}.parquet", data)
        record = {
            "chunk": index,
            "job": self.digest,
            "input": self.source.stamp(),
            "rows": statistics.rows,
            "bytes": len(data),
            "sha256": hashlib.sha256(data).hexdigest(),
            "statistics": dataclasses.asdict(statistics),
        }
        files.write(self.folder / f"{_stem(index)}.json", _json(record))
        return record

    def record(self, index: int) -> dict[str, Any] | None:
        """Return the record of a complete chunk; None if the chunk must be made."""
        path = self.folder / f"{_stem(index)}.json"
        record = _object(files.read(path))
        if record is None:
            return None
        wanted = {"chunk": index, "job": self.digest, "input": self.source.stamp(), "rows": self.rows(index)}
        if any(record.get(key) != value for key, value in wanted.items()) or not self._counts(record):
            return None
        found = files.digest(path.with_suffix(".parquet"))
        return record if found == (record.get("sha256"), record.get("bytes")) else None

    def _counts(self, record: dict[str, Any]) -> bool:
        """Return whether the counts of a record have the form of this job, and add up."""
        told = record.get("statistics")
        if not isinstance(told, dict):
            return False
        try:
            one = Statistics(**cast(dict[str, Any], told))
            expected = self.evaluation.table(np.zeros((0, len(self.evaluation.coordinates))), 0)[1]
            shapes = all(np.shape(getattr(one, f)) == np.shape(getattr(expected, f)) for f in _COUNTS)
            numbers = all(np.asarray(getattr(one, f)).dtype.kind in "fiu" for f in _COUNTS if getattr(one, f))
        except (TypeError, ValueError):
            return False
        if not (shapes and numbers) or type(one.rows) is not int or type(one.invalid) is not int:
            return False
        return one.rows == record["rows"] and (not one.verdicts or sum(one.verdicts) == one.rows)

    def check(self, done: dict[int, Any], count: int, made: list[int]) -> None:
        """Compare all chunks with the source; chunks made from a changed input are removed.

        Raises:
            InputError: If the input changed.
            MachineError: If a chunk is missing, or the rows are not those of the source.
        """
        rows = sum(record["rows"] for record in done.values())
        if sorted(done) != list(range(count)) or rows != self.source.rows:
            message = f"{len(done)} of {count} chunks came back, with {rows} of {self.source.rows} rows"
            raise MachineError(f"{self.folder}: {message}. Run the same command again to resume.")
        try:
            self.source.check()
        except Exception:
            for index in made:  # none of these may count as a chunk of the file in the manifest
                files.write(self.folder / f"{_stem(index)}.json", _json({"spoilt": "the input changed meanwhile"}))
            raise


_COUNTS = ("verdicts", "minima", "contacts", "histograms")


def write_chunk(evaluation: Evaluation, Q: Array, start: int, threads: int = 1) -> tuple[bytes, Statistics]:
    """Return a chunk's Parquet file as bytes, which are the same wherever this runs, and its statistics."""
    arrow: Any = load_arrow("pyarrow")
    parquet: Any = load_arrow("pyarrow.parquet")
    table, statistics = evaluation.table(Q, start, threads)
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd", compression_level=1, use_dictionary=_dictionaries(table))
    return sink.getvalue().to_pybytes(), statistics


def _dictionaries(table: Any) -> list[str]:
    """Return the columns with few values; a dictionary of floats that never repeat costs time without benefit."""
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
        "coverage": dataclasses.asdict(evaluation.coverage),
        "limits_only": evaluation.limits_only,
        "python": platform.python_version(),
        "machine": platform.machine(),
    }


def _look(folder: Path, manifest: dict[str, Any]) -> None:
    """Refuse a folder that is neither empty nor of this job, before anything in it is changed.

    Raises:
        InputError: If it belongs to something else.
    """
    path = folder / "manifest.json"
    text = files.read(path)
    if text is None:
        others = sorted(entry.name for entry in folder.iterdir() if not files.own(entry.name))
        if others:
            message = f"it holds other files ({', '.join(others[:4])})"
            raise files.bad(folder, message, "Give an empty folder, or that of the same job")
        return
    there = _object(text)
    job: Any = None if there is None else there.get("job")
    if there is None or not isinstance(job, dict):
        raise files.bad(path, "it is no manifest of a batch", "Give an empty folder")
    if there.get("format") != FORMAT:
        message = f"it is of another version of pinbound (format {there.get('format')!r}, not {FORMAT})"
        raise files.bad(path, message, "Give another folder")
    mine, theirs = json.loads(_json(manifest["job"])), cast(dict[str, Any], job)
    differing = [key for key in mine if theirs.get(key) != mine[key]]
    if differing:
        words = "; ".join(f"{key} is {theirs.get(key)} there and {mine[key]} here" for key in differing)
        raise files.bad(path, f"it is of another job: {words}", "Give the same options, or another folder")


def _object(text: bytes | None) -> dict[str, Any] | None:
    """Return a JSON object; None if the text is not one."""
    try:
        value = None if text is None else json.loads(text.decode())
    except (ValueError, RecursionError):
        return None
    return cast(dict[str, Any], value) if isinstance(value, dict) else None


def _advance(advance: Advance | None, rows: int) -> None:
    if advance is not None:
        advance(rows)
