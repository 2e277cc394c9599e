"""Make a batch job fail at every place where it writes or reads, and see that resuming gives the undisturbed job.

python -m benchmarks.faults --faults 200
python -m benchmarks.faults --every

Faults: the system refuses a call (disk full, no permission, read error), does only a part of it, or the process is
killed at it (SIGKILL); files of the job are damaged, swapped or removed between two runs; the input changes, shrinks or
cannot be read while it is read. The calls that a job makes are counted first, so that every fault is at one of them.
After each fault the job is started again without one. It must then be complete, with the same bytes as the undisturbed
job, or be refused with one message; and files that are not its own must be as they were. `--every` kills a job at each
of its calls in turn: one in a new folder, and one in a folder that is half done.
"""

from __future__ import annotations

import argparse
import dataclasses
import errno
import hashlib
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import pinbound as pb
from pinbound.batch import VERDICTS, FileSource, RandomSource, Source, evaluation_of, open_source, run
from pinbound.batch import files as batch_files

ROWS, CHUNK = 2500, 300
CALLS = ("open", "write", "fsync", "replace", "read", "unlink")
CODES = (errno.ENOSPC, errno.EACCES, errno.EIO)


class _System:
    """`os` as the batch room sees it: its calls are counted, and one of them fails."""

    def __init__(self, call: str = "", at: int = 0, fault: str = "", code: int = 0) -> None:
        self.call, self.at, self.fault, self.code = call, at, fault, code
        self.passed: Counter[str] = Counter()

    def __getattr__(self, name: str) -> Any:
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def asked(*args: Any, **kwargs: Any) -> Any:
            self.passed[name] += 1
            if name != self.call or self.passed[name] != self.at:
                return real(*args, **kwargs)
            if self.fault == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            if self.fault == "short" and name == "write":
                return real(args[0], bytes(args[1])[: max(1, len(args[1]) // 3)])
            if self.fault == "short" and name == "read":
                return real(args[0], 7)
            if self.fault == "half" and name == "read":
                return b""  # the file ends here
            if self.fault == "half" and name == "write":
                real(args[0], bytes(args[1])[: len(args[1]) // 2])
            raise OSError(self.code, os.strerror(self.code))

        return asked

    @property
    def points(self) -> list[tuple[str, int]]:
        """Every call that was made, as its name and its number."""
        return [(name, at) for name in CALLS for at in range(1, self.passed[name] + 1)]


@contextmanager
def _faulty(system: _System) -> Iterator[None]:
    real = batch_files.os
    batch_files.os = system  # type: ignore[assignment]
    try:
        yield
    finally:
        batch_files.os = real


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("part-*.parquet")}


class Campaign:
    """One robot, one kind of source, one undisturbed job, and counts of what was seen."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.random = folder, np.random.default_rng(seed)
        robot = pb.load("minervabot_v3")
        self.robot = robot
        columns = ("coordinates", "smallest", "verdict")
        self.evaluation = evaluation_of(robot, columns, summary=True, backend="numpy")
        self.made = RandomSource(ROWS, 5, (-1.0, -2.0, -2.0), (1.0, 2.0, 2.0))
        self.input = folder / "q.npy"
        self.restore_input()
        self.whole = self._run(self.made, folder / "whole")
        self.expected = digests(folder / "whole")
        self.neighbour = folder / "neighbour"
        self.neighbour.mkdir()
        (self.neighbour / "part-00000000.parquet").write_text("mine")
        self.seen: Counter[str] = Counter()
        self.wrong: list[str] = []
        self._compare_with_the_source()

    def _compare_with_the_source(self) -> None:
        """Refuse to measure by an undisturbed job that is itself wrong: its rows and counts are made here once more."""
        parts = sorted((self.folder / "whole").glob("part-*.parquet"))
        table = pa.concat_tables([pq.read_table(part, use_threads=False) for part in parts])
        Q = self.made.read(0, ROWS)
        read = np.stack([table[name].to_numpy() for name in self.robot.coordinates], axis=1)
        free = self.robot.boundaries.free(Q)
        kept = sum(self.whole.statistics.verdicts[VERDICTS.index(name)] for name in ("inside", "free", "outside"))
        if not (np.array_equal(table["row"], np.arange(ROWS)) and np.array_equal(read, Q) and kept == free.sum()):
            raise SystemExit("the undisturbed job does not hold the rows of its source")

    def restore_input(self) -> None:
        np.save(self.input, self.made.read(0, ROWS))

    def source(self) -> Source:
        kind = self.random.integers(2)
        return self.made if kind else open_source(self.input, self.robot.coordinates)

    def _run(self, source: Source, folder: Path) -> Any:
        return run(self.evaluation, source, folder, CHUNK)

    def trial(self) -> None:
        """Do one fault, resume, compare."""
        kinds: tuple[Callable[[Path, Source], str], ...] = (self._refused, self._refused, self._damaged, self._input)
        where, source = self._begin()
        self._resumed(kinds[self.random.integers(len(kinds))](where, source), where, source)

    def kill_everywhere(self) -> None:
        """Kill jobs at every call that they make: in a new folder, and in one that is half done."""
        for source in (self.made, open_source(self.input, self.robot.coordinates)):
            for begun in (False, True):
                where, _ = self._begin()
                for call, at in self._points(where, source, 9 if begun else 0):
                    where, _ = self._begin()
                    self._half_done(where, source, 9 if begun else 0)
                    self._resumed(self._killed(where, source, call, at), where, source)

    def _begin(self) -> tuple[Path, Source]:
        where = self.folder / "trial"
        shutil.rmtree(where, ignore_errors=True)
        where.mkdir()
        self.restore_input()
        return where, self.source()

    def _resumed(self, what: str, where: Path, source: Source) -> None:
        """Start the job again, and compare it with the undisturbed one."""
        foreign = where / "notes.txt"
        if (where / "manifest.json").is_file() and not foreign.exists():
            foreign.write_text("mine")
        before = foreign.read_bytes() if foreign.exists() else None
        self.restore_input()
        fresh = source if isinstance(source, RandomSource) else open_source(self.input, self.robot.coordinates)
        try:
            outcome = self._run(fresh, where)
        except pb.PinboundError as error:
            ending = f"refused: {str(error).split(': ', 1)[-1][:40]}"
            if "no manifest" not in str(error) and "another job" not in str(error):
                self.wrong.append(f"{what}: {error}")
        else:
            ending = "complete"
            if digests(where) != self.expected or outcome.statistics != self.whole.statistics:
                self.wrong.append(f"{what}: other bytes or totals")
            if list(where.glob(".pinbound.*.tmp")):
                self.wrong.append(f"{what}: a half-written file is left")
        if before is not None and foreign.read_bytes() != before:
            self.wrong.append(f"{what}: a foreign file changed")
        if [path.read_text() for path in self.neighbour.iterdir()] != ["mine"]:
            self.wrong.append(f"{what}: a file beside the folder changed")
        self.seen[f"{what} -> {ending}"] += 1

    def _half_done(self, where: Path, source: Source, files: int) -> None:
        """Begin a job and refuse it the given rename; 0 leaves the folder empty."""
        if not files:
            return
        with _faulty(_System("replace", files, "refuse", errno.EIO)):
            try:
                self._run(source, where)
            except pb.MachineError:
                pass
        (where / "notes.txt").write_text("mine")

    def _points(self, where: Path, source: Source, files: int) -> list[tuple[str, int]]:
        """Return the calls of a job that is not disturbed."""
        self._half_done(where, source, files)
        counting = _System()
        with _faulty(counting):
            self._run(source, where)
        return counting.points

    def _killed(self, where: Path, source: Source, call: str, at: int) -> str:
        child = os.fork()
        if not child:
            with _faulty(_System(call, at, "kill")):
                try:
                    self._run(source, where)
                finally:
                    os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != -signal.SIGKILL:
            self.wrong.append(f"kill at {call} {at}: not reached")
        return f"killed at {call}"

    def _refused(self, where: Path, source: Source) -> str:
        files = int(self.random.integers(2, 15)) if self.random.integers(2) else 0
        points = self._points(where, source, files)  # where the code passes
        where, _ = self._begin()
        self._half_done(where, source, files)
        names = sorted({name for name, _ in points})
        call = names[self.random.integers(len(names))]
        at = int(self.random.integers(1, sum(name == call for name, _ in points) + 1))
        fault = ("refuse", "kill", "short", "half")[self.random.integers(4)]
        if fault in ("short", "half") and call not in ("write", "read"):
            fault = "kill"
        if fault == "kill":
            return self._killed(where, source, call, at)
        code = CODES[self.random.integers(len(CODES))]
        system = _System(call, at, fault, code)
        name = f"{call} {'refused' if fault == 'refuse' else fault} ({errno.errorcode[code]})"
        with _faulty(system):
            try:
                self._run(source, where)
            except pb.MachineError as error:
                if "run the same command again" not in str(error):
                    self.wrong.append(f"{name}: no remedy in {error}")
                return name
            except pb.PinboundError as error:
                if not (fault == "half" and call == "read" and "no manifest" in str(error)):  # it looks damaged
                    self.wrong.append(f"{name}: called a fault of the input: {error}")
                return name
        if system.passed[call] < at:
            self.wrong.append(f"{name}, call {at}: not reached")
        return f"{name}, ridden out"

    def _damaged(self, where: Path, source: Source) -> str:
        self._run(source, where)
        names = sorted(path for path in where.iterdir() if path.name.startswith(("part-", "manifest")))
        path = names[self.random.integers(len(names))]
        other = names[self.random.integers(len(names))]
        how = ("flip", "cut", "empty", "remove", "swap", "list", "rows", "garbage")[self.random.integers(8)]
        data = bytearray(path.read_bytes())
        if how == "flip":
            data[self.random.integers(len(data))] ^= 1 << int(self.random.integers(8))
        elif how == "cut":
            data = data[: self.random.integers(len(data))]
        elif how == "empty":
            data = bytearray()
        elif how == "swap":
            data = bytearray(other.read_bytes())
            twin = path.with_suffix(".parquet" if path.suffix == ".json" else ".json")
            source_twin = other.with_suffix(".parquet" if other.suffix == ".json" else ".json")
            if twin.exists() and source_twin.exists() and path.suffix == other.suffix:
                twin.write_bytes(source_twin.read_bytes())  # record and chunk of another number, consistent together
        elif how == "list":
            data = bytearray(b"[]")
        elif how == "rows":
            data = bytearray(bytes(data).replace(b'"rows": 300', b'"rows": 200'))
        elif how == "garbage":
            data = bytearray(self.random.bytes(200))
        if how == "remove":
            path.unlink()
        else:
            path.write_bytes(data)
        return f"{'manifest' if path.name.startswith('m') else path.suffix[1:]} damaged ({how})"

    def _input(self, where: Path, source: Source) -> str:
        if isinstance(source, RandomSource):
            return self._refused(where, source)
        how = ("other numbers", "cut", "longer", "gone", "unreadable")[self.random.integers(5)]
        at = int(self.random.integers(0, 8))

        class Changing(FileSource):
            def read(changing, start: int, stop: int) -> Any:
                if start == at * CHUNK and how == "unreadable":
                    raise OSError(errno.EIO, os.strerror(errno.EIO))
                if start == at * CHUNK:
                    self._spoil(how)
                return super().read(start, stop)

        changing = Changing(**{f.name: getattr(source, f.name) for f in dataclasses.fields(source)})
        try:
            self._run(changing, where)
        except (pb.PinboundError, OSError):
            return f"input changed while read ({how})"
        self.wrong.append(f"input changed while read ({how}, chunk {at}): not noticed")
        return f"input changed while read ({how})"

    def _spoil(self, how: str) -> None:
        data = bytearray(self.input.read_bytes())
        if how == "gone":
            self.input.unlink()
            return
        if how == "other numbers":
            data[-8 * int(self.random.integers(1, 3 * ROWS)) + 6] ^= 1
        elif how == "cut":
            data = data[: len(data) // 2]
        else:
            data += bytes(24)
        self.input.write_bytes(data)


def campaign(faults: int, seed: int, folder: Path) -> Campaign:
    """Run so many trials."""
    made = Campaign(folder, seed)
    for _ in range(faults):
        made.trial()
    return made


def kills(seed: int, folder: Path) -> Campaign:
    """Kill jobs at every call."""
    made = Campaign(folder, seed)
    made.kill_everywhere()
    return made


def main() -> None:
    """Print a table of what was done; exit 1 if anything came out wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", action="store_true", help="kill at every call instead")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        where = Path(name)
        found = kills(options.seed, where) if options.every else campaign(options.faults, options.seed, where)
    for what, count in sorted(found.seen.items()):
        print(f"| {what} | {count} |")
    print(f"{sum(found.seen.values())} faults, {len(found.wrong)} wrong")
    for line in found.wrong:
        print(f"WRONG {line}")
    sys.exit(1 if found.wrong else 0)


if __name__ == "__main__":
    main()
