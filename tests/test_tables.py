"""Tables in files: one set of rules, whatever the kind; damaged files are one fault, never a traceback."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.tables import BLOCK, open_table, read_table
from pinbound.tables import text as text_module

pyarrow = pytest.importorskip("pyarrow")
from pyarrow import csv as arrow_csv  # noqa: E402
from pyarrow import parquet  # noqa: E402

NAMES = ("a", "b", "c")


def written(path: Path, Q: Any) -> Path:
    """Write the same numbers as a file of the kind that the suffix says."""
    columns = {name: np.ascontiguousarray(column) for name, column in zip(NAMES, Q.T, strict=True)}
    if path.suffix == ".npy":
        np.save(path, Q)
    elif path.suffix == ".npz":
        np.savez_compressed(path, **columns)
    elif path.suffix == ".parquet":
        parquet.write_table(pyarrow.table(columns), path, row_group_size=max(1, len(Q) // 3))
    else:
        arrow_csv.write_csv(pyarrow.table({k: pyarrow.array(v, from_pandas=True) for k, v in columns.items()}), path)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".npy", ".npz", ".parquet"])
def test_every_kind_gives_the_same_numbers_in_blocks(suffix: str, tmp_path: Path) -> None:
    Q = np.random.default_rng(1).normal(size=(2 * BLOCK + 17, 3))
    Q[5, 1] = np.nan
    table = open_table(written(tmp_path / f"q{suffix}", Q), NAMES)
    assert table.names == NAMES
    assert table.count(NAMES) == len(Q)
    blocks = list(table.blocks(("c", "a")))
    assert all(0 < len(block) <= BLOCK for block in blocks)
    assert np.array_equal(np.concatenate(blocks), Q[:, [2, 0]], equal_nan=True)
    assert np.array_equal(read_table(table, ("b",))["b"], Q[:, 1], equal_nan=True)


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i2", ">u4", "<f2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_of_any_type_and_order(dtype: str, order: Any, tmp_path: Path) -> None:
    Q = np.arange(30).reshape(10, 3).astype(dtype, order=order)
    np.save(tmp_path / "Q.NPY", Q)
    (tmp_path / "Q.NPY.npy").rename(tmp_path / "Q.NPY")
    table = open_table(tmp_path / "Q.NPY", NAMES)
    assert np.array_equal(np.concatenate(list(table.blocks(NAMES))), Q.astype(np.float64))


def test_python_and_pyarrow_read_text_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "q.csv"
    path.write_bytes(b'\xef\xbb\xbf# rig 3\n\n"a", b,note\r\n1,+2.5,x\r\n\r\n .5 ,,"y,z"\r\n-1e-3,NaN,\r\n\r\n')
    read: list[Any] = []
    for least in (0, 1 << 40):
        monkeypatch.setattr(text_module, "_FAST_FROM", least)
        table = open_table(path)
        assert table.names == ("a", "b", "note")
        read.append(np.concatenate(list(table.blocks(("a", "b")))))
    assert np.array_equal(read[0], [[1.0, 2.5], [0.5, np.nan], [-1e-3, np.nan]], equal_nan=True)
    assert np.array_equal(read[0], read[1], equal_nan=True)


def test_where_pyarrow_gives_up_the_line_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_module, "_FAST_FROM", 0)
    lines = [f"{i},{i}" for i in range(400_000)]
    lines[399_000] = "1_0,2"
    lines[399_001] = "\u0661,2"
    path = tmp_path / "q.csv"
    path.write_text("a,b\n" + "\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(pb.InputError) as raised:
        list(open_table(path).blocks(("a", "b")))
    assert [(p.line, p.message) for p in raised.value.problems] == [(399_002, "a is '1_0'"), (399_003, "a is '\u0661'")]


@pytest.mark.parametrize("least", [0, 1 << 40])
def test_a_stray_byte_is_refused_in_any_column(least: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Large files, which PyArrow reads, keep to the same rule as small ones."""
    monkeypatch.setattr(text_module, "_FAST_FROM", least)
    (tmp_path / "q.csv").write_bytes(b"a,note\n" + b"1,ok\n" * 20_000 + b"2,\x84\n")
    with pytest.raises(pb.InputError, match="no CSV file in UTF-8"):
        list(open_table(tmp_path / "q.csv").blocks(("a",)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "the file is empty"),
        (b"\n\n# only words\n", "the file is empty"),
        (b"a;b\n1;2\n", "not separated by commas"),
        (b"a,b,a\n", "'a' are there twice"),
        (b"0,0\n0.1,0.2\n", "numbers for names.*a line of column names first"),
        (b"a,b\n1\n", "line 2: 1 cells for 2 columns"),
        (b"a,b\n1,true\n", "line 2: b is 'true'"),
        (b"a,b\n1,0x1p3\n", "line 2: b is '0x1p3'"),
        (b"a,b\n1,2+1j\n", "line 2: b is '2"),
        ("a,b\n1,2\n".encode("utf-16"), "no CSV file in UTF-8"),
        (b'a,b\n1,"2\n', "no CSV file in UTF-8"),
        (b"a,b\n1,\x002\n", "no CSV file|b is"),
    ],
)
def test_faults_of_text(text: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "q.csv").write_bytes(text)
    with pytest.raises(pb.InputError, match=message):
        list(open_table(tmp_path / "q.csv").blocks(("a", "b")))


def test_faults_of_arrays(tmp_path: Path) -> None:
    path = tmp_path / "q.npy"
    good = np.arange(30.0).reshape(10, 3)
    for array, message in (
        (good[:, :2], r"array \(10, 2\)"),
        (good.astype(complex), "complex128"),
        (good > 3, "bool"),
        (good.astype("U4"), "<U4"),
        (good[0], r"array \(3,\)"),
    ):
        np.save(path, array)
        with pytest.raises(pb.InputError, match=message):
            open_table(path, NAMES)
    np.save(path, np.array([[{}, 1, 2]], dtype=object), allow_pickle=True)
    with pytest.raises(pb.InputError, match="object"):
        open_table(path, NAMES)
    np.save(path, good)
    whole = path.read_bytes()
    path.write_bytes(whole[:-8])
    with pytest.raises(pb.InputError, match="ends before its last row"):
        open_table(path, NAMES)
    path.write_bytes(whole.replace(b"(10, 3)", b"(99999999999999, 3)".ljust(7))[: len(whole)])
    with pytest.raises(pb.InputError):
        open_table(path, NAMES)
    path.write_bytes(whole.replace(b"(10, 3)", b"(True,3)").replace(b"} ", b"}", 1))
    with pytest.raises(pb.InputError, match="no NPY file"):  # NumPy refuses it too
        open_table(path, NAMES)
    path.write_bytes(whole)
    table = open_table(path, NAMES)
    path.write_bytes(whole[:-8])
    with pytest.raises(pb.InputError, match="became shorter"):
        list(table.blocks(NAMES))


def test_faults_of_archives(tmp_path: Path) -> None:
    path = tmp_path / "q.npz"
    for columns, message in (
        ({"a": np.zeros((2, 2))}, r"'a' is an array \(2, 2\)"),
        ({"a": np.array(["x"])}, "<U1"),
        ({"a": np.zeros(2), "b": np.zeros(3)}, "different lengths"),
        ({}, "there is no column"),
    ):
        np.savez(path, **columns)
        with pytest.raises(pb.InputError, match=message):
            open_table(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(pb.InputError, match="no NPZ file"):
        open_table(path)
    np.savez_compressed(path, a=np.arange(1000.0))
    whole = bytearray(path.read_bytes())
    random = np.random.default_rng(3)
    for _ in range(300):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 3):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        try:
            read_table(open_table(path), ("a",))
        except pb.PinboundError:
            pass
        except ValueError as error:
            assert "not in" in str(error)  # the array has another name now


def test_faults_of_parquet(tmp_path: Path) -> None:
    path = tmp_path / "q.parquet"
    parquet.write_table(pyarrow.table({"a": ["x"], "b": [[1.0]], "c": [True]}), path)
    with pytest.raises(pb.InputError) as raised:
        list(open_table(path).blocks(NAMES))
    assert [p.message.split()[1] for p in raised.value.problems] == ["'a'", "'b'", "'c'"]
    parquet.write_table(pyarrow.table({"a": [1, None]}), path)
    assert np.array_equal(read_table(open_table(path), ("a",))["a"], [1.0, np.nan], equal_nan=True)
    whole = path.read_bytes()
    random = np.random.default_rng(4)
    for _ in range(300):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 4):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        try:
            table = open_table(path)
            read_table(table, table.names)
        except pb.PinboundError:
            pass


def test_a_motion_that_claims_too_much_is_refused_before_memory_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pinbound.tables import table as module

    monkeypatch.setattr(module, "MOST_CELLS", 1000)
    table = open_table(written(tmp_path / "q.npz", np.zeros((2000, 3))))
    with pytest.raises(pb.InputError, match="more than 1,000 numbers"):
        read_table(table, NAMES)


def test_the_suffix_decides(tmp_path: Path) -> None:
    for name in ("q.txt", "q"):
        with pytest.raises(pb.InputError, match=r"Give a \.csv, \.npy, \.npz or \.parquet file"):
            open_table(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        open_table(tmp_path / "q.csv")


def test_an_archive_behind_something_else_is_none(tmp_path: Path) -> None:
    """Zip files are read from their end, so that one may stand behind other bytes; NumPy refuses that."""
    path = tmp_path / "q.npz"
    np.savez(path, q1=np.zeros(3))
    path.write_bytes(b"more" + path.read_bytes())
    with pytest.raises(pb.InputError, match=r"no NPZ file .* does not begin as one"):
        open_table(path)
    np.savez(path, q1=np.zeros(3))
    assert open_table(path).count(("q1",)) == 3
