"""Tables for `benchmarks.fuzz_readers`: CSV, NPY, NPZ and Parquet files that are nearly right, with plain readers.

Each is written as a program might write it (types, orders, compressions, headings, encodings), and then damaged as
copies and editors damage files. `check` and `batch` must refuse a file with one InputError, or read the numbers that
Python's `csv`, NumPy or PyArrow read from it.
"""

from __future__ import annotations

import contextlib
import csv
import functools
import io
import random
import re
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import typer
from numpy.lib import format as npy

import pinbound as pb
from pinbound.batch import Evaluation, evaluation_of, open_source, run
from pinbound.cli import app
from pinbound.motion.history import read_motion
from pinbound.tables import text

__all__ = ["TABLES", "invoke", "table_case", "write_table"]

COLUMNS = ("time", "lift", "lift_rod", "reach")
ARM = """<robot name="crane" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="boom"/><link name="rod"/>
  <link name="hook"/>
  <joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="2" effort="10" velocity="1"/></joint>
  <joint name="lift_rod" type="revolute"><parent link="boom"/><child link="rod"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-4" upper="4" effort="10" velocity="1"/><mimic joint="lift" multiplier="-1"/>
  </joint><joint name="reach" type="prismatic"><parent link="rod"/><child link="hook"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.4" effort="10" velocity="1"/></joint>
  <pinbound:annotations><pinbound:point name="p" link="base" xyz="1 0 0.4" radius="0.01"/>
    <pinbound:point name="s" link="hook" xyz="0 0 0"/><pinbound:boundary name="b" a="p" b="s"/></pinbound:annotations>
</robot>"""
CELLS = ["nan", "inf", "-inf", "1e400", "1e308", "1e-320", "-0", "1_0", "0x10", "\u0661", '"1,5"', "", " ", "1e", "+1"]
CELLS += [".5", "5.", "1 2", "true", "--1", "1d3", '"', '""', '"0.1"', "\0", "\x1a", "1;2", "\t0.1", "'0.1", "é", "NaN"]
HEADS = ["row", "time", "lift", "reach", "Lift", "", " lift", '"reach"', "q", "\u202etime", "x" * 300, "[/]", "verdict"]
TYPES = ["<f8", ">f8", "<f4", "<f2", "<i8", "<i4", "|u1", "|b1", "<c16", "|O", "<U5", "|S3", "<M8[s]", "|V8", "<f16"]
TYPES += ["[('a', '<f8')]", "(2,)<f8", "<m8[ns]", "<u8"]


def _rows(rng: random.Random) -> np.ndarray[Any, Any]:
    """Return rows of `COLUMNS` that are a motion of the arm."""
    count = rng.choice([0, 1, 2, 5, 5, 30, 30, 300])
    lift = np.array([rng.uniform(-1, 1) for _ in range(count)])
    reach = np.array([rng.uniform(0, 0.4) for _ in range(count)])
    return np.column_stack((np.arange(count, dtype=float), lift, -lift, reach)).reshape(count, 4)


def _chosen(rng: random.Random) -> list[str]:
    names = (
        list(COLUMNS) if rng.random() < 0.5 else [n for n in COLUMNS if n in ("lift", "reach") or rng.random() < 0.5]
    )
    if rng.random() < 0.2:
        rng.shuffle(names)
    if rng.random() < 0.1:
        names.insert(rng.randrange(len(names) + 1), rng.choice(HEADS))
    if rng.random() < 0.05:
        names.pop(rng.randrange(len(names)))
    return names


def _column(values: np.ndarray[Any, Any], name: str, rng: random.Random) -> np.ndarray[Any, Any]:
    return values[:, COLUMNS.index(name)] if name in COLUMNS else np.full(len(values), rng.uniform(-1, 1))


def _damaged(data: bytes, rng: random.Random, odds: float) -> bytes:
    """Flip, cut, repeat or insert bytes, or not."""
    if rng.random() >= odds or not data:
        return data
    changed = bytearray(data)
    kind, at = rng.randrange(5), rng.randrange(len(changed))
    if kind < 2:
        for _ in range(rng.choice([1, 1, 3, 20])):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    elif kind == 2:
        del changed[at : at + rng.choice([1, 8, len(changed)])]
    elif kind == 3:
        changed[at:at] = changed[at : at + rng.randint(1, 64)]
    else:
        changed[at:at] = rng.randbytes(rng.randint(1, 16))
    return bytes(changed)


def _csv(rng: random.Random) -> bytes:
    values, names = _rows(rng), _chosen(rng)
    table = [
        [repr(float(x)) for x in row] for row in np.stack([_column(values, n, rng) for n in names], axis=1).tolist()
    ]
    lines = [list(names), *table]
    for _ in range(rng.choice([0, 0, 1, 1, 2, 4])):
        line = lines[rng.randrange(len(lines))]
        kind = rng.randrange(8)
        if kind < 4 and line:
            line[rng.randrange(len(line))] = rng.choice(HEADS if line is lines[0] else CELLS)
        elif kind == 4:
            line.append(rng.choice(CELLS))
        elif kind == 5 and line:
            line.pop()
        else:
            lines.insert(rng.randrange(len(lines) + 1), rng.choice([[], [""], ["# note"], [" "], ["#"], list(line)]))
    comma, end = rng.choice([",", ",", ",", ",", ", ", ";", "\t"]), rng.choice(["\n", "\n", "\r\n", "\r", "\n\n"])
    whole = end.join(comma.join(line) for line in lines) + rng.choice([end, "", end * 3])
    encoding = rng.choice(["utf-8"] * 12 + ["utf-8-sig", "utf-16", "latin-1", "utf-32"])
    return _damaged(whole.encode(encoding, errors="replace"), rng, 0.15)


def _npy(values: np.ndarray[Any, Any], rng: random.Random) -> bytes:
    """Return an array as numpy.save writes it, or with another header."""
    if rng.random() < 0.5:
        kind = rng.choice(["f8", "f4", "i8", ">f8", "f2", "u1", "?", "c16", "U5", "O"])
        with np.errstate(all="ignore"):
            values = values.astype(kind)
    if rng.random() < 0.2:
        values = np.asfortranarray(values)
    if rng.random() < 0.1:
        values = rng.choice([values.ravel(), values[None], values[:, :1] if values.ndim > 1 else values])
    stream = io.BytesIO()
    npy.write_array(stream, values, version=rng.choice([(1, 0), (1, 0), (2, 0), (3, 0)]), allow_pickle=True)
    data = stream.getvalue()
    if rng.random() < 0.4:
        size = int.from_bytes(data[8:10], "little") if data[6] == 1 else int.from_bytes(data[8:12], "little")
        start = 10 if data[6] == 1 else 12
        head = data[start : start + size].decode("latin-1")
        head = _edited(head, rng)
        head = head.rstrip("\n ")[: size - 1].ljust(size - 1) + "\n"
        data = data[:start] + head.encode("latin-1", errors="replace") + data[start + size :]
    return _damaged(data, rng, 0.2)


def _edited(head: str, rng: random.Random) -> str:
    """Change an NPY header: another type, shape, order, key, or text."""
    kind = rng.randrange(5)
    if kind == 0:
        one = rng.choice(TYPES)
        return re.sub(r"'descr': [^,]*,", lambda _: f"'descr': {one if one[0] == '[' else repr(one)},", head)
    if kind == 1:
        shapes = ["()", "(0,)", "(-1, 2)", "(1, 2, 3)", "(10**14, 2)", "(100000000000000, 2)", "(0, 2)", "2", "(2, 0)"]
        shapes += ["(1e3, 2)", "(True, 2)", "(9223372036854775807, 9223372036854775807)", "(3, 2)", "None", "('a', 2)"]
        return re.sub(r"'shape': \([^)]*\)", lambda _: f"'shape': {rng.choice(shapes)}", head)
    if kind == 2:
        order = rng.choice(["True", "False", "None", "1", "'x'"])
        return re.sub(r"'fortran_order': \w+", lambda _: f"'fortran_order': {order}", head)
    if kind == 3:
        return head.replace(
            rng.choice(["descr", "shape", "fortran_order", "'", "{", ":", ","]), rng.choice(["", "x", "["])
        )
    return rng.choice(["", "{}", "{'descr': '<f8'}", "(" * 500, "[" * 4000, "1" * 5000, "{" + "'a':1," * 900 + "}"])


def _npz(rng: random.Random) -> bytes:
    values, names = _rows(rng), _chosen(rng)
    method = rng.choice(
        [zipfile.ZIP_STORED, zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
    )
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", method) as archive:
        warnings.simplefilter("ignore", UserWarning)  # a name twice, on purpose
        for name in names:
            array = np.ascontiguousarray(_column(values, name, rng))
            plain = io.BytesIO()
            np.save(plain, array)
            data = _npy(array, rng) if rng.random() < 0.15 else plain.getvalue()
            entry = f"{name}{rng.choice(['.npy'] * 20 + ['', '.txt', '.npy/', '.NPY'])}"
            archive.writestr(entry or "/", data)  # zipfile writes no empty name
        if rng.random() < 0.03:
            archive.comment = rng.randbytes(40)
    data = bytearray(stream.getvalue())
    if rng.random() < 0.2:  # flags, method, sizes of an entry's header: encrypted, unknown, wrong
        marks = [found.start() for found in re.finditer(rb"PK\x01\x02|PK\x03\x04", bytes(data))]
        at = rng.choice(marks)
        field = rng.choice([6, 8, 10, 14, 18, 22, 24, 26, 28, 30])
        data[at + field] = rng.randrange(256)
    return _damaged(bytes(data), rng, 0.2)


def _parquet(rng: random.Random) -> bytes:
    values, names = _rows(rng), _chosen(rng)
    arrays = [_arrow(pa.array(_column(values, name, rng)), rng) for name in names]
    stream = io.BytesIO()
    options: dict[str, Any] = {
        "compression": rng.choice(["none", "snappy", "zstd", "gzip", "lz4", "brotli"]),
        "row_group_size": rng.choice([1, 7, 1000]),
        "use_dictionary": rng.random() < 0.5,
        "version": rng.choice(["1.0", "2.4", "2.6"]),
        "data_page_version": rng.choice(["1.0", "2.0"]),
        "write_page_checksum": rng.random() < 0.3,
    }
    pq.write_table(pa.Table.from_arrays(arrays, names=names), stream, **options)
    return _damaged(stream.getvalue(), rng, 0.45)


def _arrow(array: Any, rng: random.Random) -> Any:
    """Return a column in another type, now and then."""
    if rng.random() < 0.85:
        return array
    values = array.to_pylist()
    makers: list[Callable[[], Any]] = [
        lambda: array.cast(pa.float32()),
        lambda: pa.array([int(10 * x) for x in values], pa.int16()),
        lambda: pa.array([abs(int(10 * x)) for x in values], pa.uint64()),
        lambda: pa.array([None if rng.random() < 0.3 else x for x in values], pa.float64()),
        lambda: pa.array([str(x) for x in values], pa.string()),
        lambda: pa.array([x > 0 for x in values], pa.bool_()),
        lambda: pa.array([[x] for x in values], pa.list_(pa.float64())),
        lambda: pa.array([{"a": x} for x in values], pa.struct([("a", pa.float64())])),
        lambda: pa.array([int(x) for x in values], pa.timestamp("s")),
        lambda: pa.array([None] * len(values), pa.null()),
        array.dictionary_encode,
        lambda: pa.array(np.array(values, dtype=np.float16), pa.float16()),
        lambda: pa.array([round(x, 3) for x in values], pa.float64()).cast(pa.decimal128(12, 3), safe=False),
    ]
    return rng.choice(makers)()


TABLES: dict[str, Callable[[random.Random], bytes]] = {
    "csv": _csv,
    "npy": lambda rng: _npy(_rows(rng)[:, [1, 3]], rng),
    "npz": _npz,
    "parquet": _parquet,
}


def write_table(kind: str, folder: Path, rng: random.Random) -> Path:
    """Write a table of one kind and return its path."""
    suffix = kind if rng.random() < 0.9 else rng.choice([kind.upper(), *TABLES])
    path = folder / f"q.{suffix}"
    path.write_bytes(TABLES[kind](rng))
    return path


def table_case(kind: str, folder: Path, rng: random.Random) -> str:
    """Read a table as `check` and as `batch` do; return what is wrong, "" if nothing is.

    Raises:
        InputError: If both refuse it.
    """
    for old in folder.glob("q.*"):
        old.unlink()
    path = write_table(kind, folder, rng)
    kept = text._FAST_FROM
    text._FAST_FROM = rng.choice([0, kept])  # both ways to read a CSV, which is small here
    try:
        return _compared(_arm(folder), folder, path, rng)
    finally:
        text._FAST_FROM = kept


def _compared(robot: pb.Robot, folder: Path, path: Path, rng: random.Random) -> str:
    motion: pb.Motion | None = None
    refused: pb.InputError | None = None
    try:
        motion = read_motion(robot, path)
        pb.certify(robot, motion.waypoints, motion.times, budget=pb.Budget(boxes=100))
    except pb.InputError as error:
        refused = error
    except (pb.DimensionError, pb.UnsupportedError):  # read, and not certified: one q twice, numbers too large
        pass
    try:
        rows, counted = _batch(robot, path, folder / "job")
    except pb.InputError as error:
        if motion is not None:
            return f"`check` reads it, `batch` does not: {error}"
        if rng.random() < 0.05 and (wrong := _commands(folder, path, rng, refused=True)):
            return wrong
        raise refused or error from error
    plain = _plain(path, robot.coordinates)
    if isinstance(plain, str):
        return plain
    if motion is not None and not _same(motion.waypoints, plain):
        return "`check` reads other numbers than a plain reader"
    if not _same(rows, plain):
        return "`batch` reads other numbers than a plain reader"
    if counted != len(plain):
        return f"`batch` counts {counted} rows, the file has {len(plain)}"
    return _commands(folder, path, rng) if rng.random() < 0.05 else ""


def _batch(robot: pb.Robot, path: Path, out: Path) -> tuple[np.ndarray[Any, Any], int]:
    """Return the rows that a job reads and writes, and how many it counts."""
    _empty(out)
    outcome = run(_evaluations[robot.name], open_source(path, robot.coordinates), out, chunk_rows=200)
    parts = [pq.read_table(part) for part in sorted(out.glob("part-*.parquet"))]
    read = [np.column_stack([part[name].to_numpy() for name in robot.coordinates]) for part in parts]
    return np.concatenate(read) if read else np.empty((0, 2)), outcome.statistics.rows


def _empty(folder: Path) -> None:
    for old in folder.glob("*"):
        old.unlink()


_arms: dict[Path, pb.Robot] = {}
_evaluations: dict[str, Evaluation] = {}


def _arm(folder: Path) -> pb.Robot:
    if folder not in _arms:
        (folder / "arm.urdf").write_text(ARM)
        _arms[folder] = pb.load(folder / "arm.urdf")
        columns = ("coordinates", "verdict")
        _evaluations[_arms[folder].name] = evaluation_of(_arms[folder], columns, backend="numpy")
    return _arms[folder]


def _same(a: Any, b: Any) -> bool:
    return np.shape(a) == np.shape(b) and np.array_equal(a, b, equal_nan=True)


def _commands(folder: Path, path: Path, rng: random.Random, refused: bool = False) -> str:
    """Give the file to both commands; exit codes other than those documented, and other endings, are wrong."""
    _empty(folder / "job")
    check = ["check", str(folder / "arm.urdf"), str(path)]
    batch = ["batch", str(folder / "arm.urdf"), "--in", str(path), "--out", str(folder / "job")]
    for words, valid in ((check, (0, 1, 2)), (batch, (0, 2))):
        code, said = invoke([*words, *(["--json"] if rng.random() < 0.5 else [])])
        if code not in valid or (refused and code != 2):
            return f"{words[0]} exits with {code}: {said}"
    return ""


@functools.cache
def _command() -> Any:
    return typer.main.get_command(app)  # building it costs more than most commands


def invoke(words: list[str]) -> tuple[int, str]:
    """Run a command line here; return its exit code and what it printed. What it raises otherwise comes through."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            _command().main(args=words, prog_name="pinbound")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        return code, said.getvalue()
    return 0, said.getvalue()


def _plain(path: Path, columns: tuple[str, ...]) -> np.ndarray[Any, Any] | str:
    """Return the columns as a plain reader has them; or how it fails, which pinbound should have told."""
    suffix = path.suffix.lower()
    try:
        if suffix == ".npy":
            return np.load(path, allow_pickle=False).astype(np.float64)
        if suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                return np.stack([archive[name].astype(np.float64) for name in columns], axis=1)
        if suffix == ".parquet":
            table = pq.read_table(path, columns=list(columns), use_threads=False)
            return np.stack([table[name].to_numpy().astype(np.float64) for name in columns], axis=1)
        return _plain_csv(path, columns)
    except Exception as error:  # of any kind: it says that the file is not right
        return f"a plain reader refuses it: {type(error).__name__}: {error}"


def _plain_csv(path: Path, columns: tuple[str, ...]) -> np.ndarray[Any, Any]:
    lines = list(csv.reader(io.StringIO(path.read_bytes().decode("utf-8-sig"), newline="")))
    while not any(lines[0]) or lines[0][0].lstrip().startswith("#"):
        lines.pop(0)
    names = [cell.strip() for cell in lines[0]]
    rows: list[Mapping[str, str]] = [dict(zip(names, line, strict=True)) for line in lines[1:] if line]
    numbers = [[float(row[name].strip() or "nan") for name in columns] for row in rows]
    return np.array(numbers, dtype=float).reshape(len(rows), len(columns))
