"""Make a batch job fail at every place where it writes or reads, and see that resuming gives the undisturbed job.

python -m benchmarks.faults --faults 200

Faults: the system refuses a call (disk full, no permission, read error), writes only a part, or the process is killed
at it; files of the job are damaged, swapped or removed between two runs; the input changes or shrinks while it is read.
After each fault the job is started again without one. It must then be complete, with the same bytes as the undisturbed
job, or be refused with one message; and files that are not its own must be as they were.
"""

from __future__ import annotations

import argparse
import dataclasses
import errno
import hashlib
import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from pinbound.batch import FileSource, RandomSource, Source, evaluation_of, open_source, run
from pinbound.batch import files as batch_files

ROWS, CHUNK = 2500, 300
CALLS = ("open", "write", "fsync", "replace", "read", "unlink")
CODES = (errno.ENOSPC, errno.EACCES, errno.EIO)
KILLED = 77


class _System:
    """`os` as the batch room sees it, with a fault at one call."""

    def __init__(self, call: str, at: int, fault: str, code: int) -> None:
        self.call, self.at, self.fault, self.code, self.seen = call, at, fault, code, 0

    def __getattr__(self, name: str) -> Any:
        real = getattr(os, name)
        if name != self.call:
            return real

        def asked(*args: Any, **kwargs: Any) -> Any:
            self.seen += 1
            if self.seen != self.at:
                return real(*args, **kwargs)
            if self.fault == "kill":
                os._exit(KILLED)
            if self.fault == "short" and name == "write":
                return real(args[0], bytes(args[1])[: max(1, len(args[1]) // 3)])
            if self.fault == "half" and name == "write":
                real(args[0], bytes(args[1])[: len(args[1]) // 2])
            raise OSError(self.code, os.strerror(self.code))

        return asked


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
        self.seen: Counter[str] = Counter()
        self.wrong: list[str] = []

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
        where = self.folder / "trial"
        shutil.rmtree(where, ignore_errors=True)
        where.mkdir()
        self.restore_input()
        source = self.source()
        what = kinds[self.random.integers(len(kinds))](where, source)
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
        self.seen[f"{what} -> {ending}"] += 1

    def _refused(self, where: Path, source: Source) -> str:
        call = CALLS[self.random.integers(len(CALLS))]
        fault = ("refuse", "kill", "short", "half")[self.random.integers(4)]
        if fault in ("short", "half") and call != "write":
            fault = "refuse"
        code = CODES[self.random.integers(len(CODES))]
        if self.random.integers(2):  # in a folder that is begun already, so that reading happens too
            with _faulty(_System("replace", int(self.random.integers(2, 15)), "refuse", errno.EIO)):
                try:
                    self._run(source, where)
                except pb.MachineError:
                    pass
        system = _System(call, int(self.random.integers(1, 40)), fault, code)
        if fault == "kill":
            child = os.fork()
            if not child:
                with _faulty(system):
                    try:
                        self._run(source, where)
                    finally:
                        os._exit(0)
            return (
                f"killed at {call}" if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == KILLED else "not reached"
            )
        name = f"{call} {'refused' if fault == 'refuse' else fault} ({errno.errorcode[code]})"
        with _faulty(system):
            try:
                self._run(source, where)
            except pb.MachineError as error:
                if "run the same command again" not in str(error):
                    self.wrong.append(f"{name}: no remedy in {error}")
                return name
            except pb.PinboundError as error:
                self.wrong.append(f"{name}: called a fault of the input: {error}")
                return name
        return f"{name}, ridden out" if system.seen >= system.at else "not reached"

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
        how = ("other numbers", "cut", "longer", "gone")[self.random.integers(4)]
        at = int(self.random.integers(0, 8))

        class Changing(FileSource):
            def read(changing, start: int, stop: int) -> Any:
                if start == at * CHUNK:
                    self._spoil(how)
                return super().read(start, stop)

        changing = Changing(**{f.name: getattr(source, f.name) for f in dataclasses.fields(source)})
        try:
            self._run(changing, where)
        except (pb.PinboundError, FileNotFoundError):
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


def main() -> None:
    """Print a table of what was done; exit 1 if anything came out wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        found = campaign(options.faults, options.seed, Path(name))
    for what, count in sorted(found.seen.items()):
        print(f"| {what} | {count} |")
    print(f"{sum(found.seen.values())} faults, {len(found.wrong)} wrong")
    for line in found.wrong:
        print(f"WRONG {line}")
    sys.exit(1 if found.wrong else 0)


if __name__ == "__main__":
    main()
