"""Machine code from the cache folder: linked without Numba, and only if it is whole, ours and made for this machine."""

import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.kernel.source import kernel_source
from pinbound.machine import compiled, object_cache
from pinbound.machine.compiled import KernelSource

pytest.importorskip("numba")

CODE = """
import numpy as np, pinbound as pb, sys
B, Q = pb.load('minervabot_v3').boundaries, np.linspace(-9, 1e7, 3000).reshape(-1, 3)
print(B.norms(Q, backend='compiled', threads=2).tobytes().hex())
print('numba' in sys.modules, file=sys.stderr)
"""
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="owners and modes of POSIX")
Q = np.linspace(-2.0, 2.0, 60).reshape(20, 3)


@pytest.fixture(scope="module")
def source() -> KernelSource:
    return kernel_source(pb.load("minervabot_v3").boundaries.kernel.program, "norms")


@pytest.fixture(scope="module")
def code(source: KernelSource) -> bytes:
    return compiled._compile(source.text)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PINBOUND_CACHE_DIR", str(tmp_path))
    return tmp_path / "kernels"


@pytest.fixture
def compiles(source: KernelSource, code: bytes, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], int]]:
    """A function that gives the kernel to a new process, so to say, and returns how often it was compiled so far."""
    counted: list[str] = []

    def compile_once(text: str) -> bytes:
        counted.append(text)
        return code

    monkeypatch.setattr(compiled, "_compile", compile_once)
    expected = pb.load("minervabot_v3").boundaries.norms(Q, backend="numpy")

    def run() -> int:
        monkeypatch.setattr(compiled, "_linked", {})
        out = np.empty_like(expected)
        compiled.compile_source(source)(Q, out, np.empty(0, np.int64))
        assert np.allclose(out, expected, rtol=1e-12)
        return len(counted)

    yield run
    assert set(counted) <= {source.text}


def start(folder: Path) -> Any:
    environment = {**os.environ, "PINBOUND_CACHE_DIR": str(folder)}
    return subprocess.Popen(
        [sys.executable, "-c", CODE], env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_a_later_process_needs_no_numba_and_two_at_once_do_no_harm(tmp_path: Path) -> None:
    together = [start(tmp_path) for _ in range(2)]
    first, second = (process.communicate(timeout=120) for process in together)
    later = start(tmp_path).communicate(timeout=120)
    assert first[1].strip() == "True", first[1]
    assert later[1].strip() == "False", later[1]
    assert first[0] == second[0] == later[0] != ""
    assert [path.suffix for path in (tmp_path / "kernels").iterdir()] == [".o"]


def test_a_kernel_is_compiled_once(compiles: Callable[[], int], folder: Path) -> None:
    assert [compiles(), compiles(), compiles()] == [1, 1, 1]
    (path,) = folder.iterdir()
    if sys.platform != "win32":
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("what", ["empty", "head", "cut", "longer", "bit", "digest", "junk"])
def test_a_damaged_file_is_compiled_anew(what: str, compiles: Callable[[], int], folder: Path) -> None:
    assert compiles() == 1
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    start = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    damaged = {
        "empty": b"",
        "head": whole[:10],
        "cut": whole[:-1],
        "longer": whole + b"\0",
        "bit": whole[:-900] + bytes([whole[-900] ^ 4]) + whole[-899:],
        "digest": whole[:start] + (b"0" if whole[start : start + 1] != b"0" else b"1") + whole[start + 1 :],
        "junk": bytes(len(whole)),
    }[what]
    path.write_bytes(damaged)
    assert [compiles(), compiles()] == [2, 2]
    assert path.read_bytes() == whole


def test_code_of_another_key_is_not_taken(folder: Path) -> None:
    first, second = "1" * 64, "2" * 64
    object_cache.store_object(first, b"code")
    assert object_cache.load_object(first) == b"code"
    (path,) = folder.iterdir()
    path.rename(object_cache._path(folder, second))
    assert object_cache.load_object(second) is None


def test_what_was_made_for_another_processor_or_version_is_compiled_anew(
    compiles: Callable[[], int], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiles() == 1
    monkeypatch.setattr(compiled, "_features", lambda: "+abacus")
    assert [compiles(), compiles()] == [2, 2]
    monkeypatch.setattr(compiled._llvm(), "get_host_cpu_name", lambda: "abacus")
    assert [compiles(), compiles()] == [3, 3]
    monkeypatch.setattr(compiled, "_version", lambda name: f"{name} 0")
    assert [compiles(), compiles()] == [4, 4]
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert [compiles(), compiles()] == [5, 5]
    assert len(list(folder.iterdir())) == 5


def test_code_that_does_not_link_is_compiled_anew(
    source: KernelSource, compiles: Callable[[], int], folder: Path
) -> None:
    object_cache.store_object(compiled._key(source), b"no object code")
    assert [compiles(), compiles()] == [1, 1]


def test_without_a_folder_code_is_compiled_for_this_process(
    compiles: Callable[[], int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setenv("PINBOUND_CACHE_DIR", str(blocked))
    assert [compiles(), compiles()] == [1, 2]
    assert blocked.read_text() == "no folder"


def test_a_full_disk_leaves_nothing_behind(
    compiles: Callable[[], int], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(object_cache.os, "replace", full)
    assert [compiles(), compiles()] == [1, 2]
    assert list(folder.iterdir()) == []


@POSIX
def test_a_folder_that_others_may_write_is_not_used(compiles: Callable[[], int], folder: Path) -> None:
    assert compiles() == 1
    (path,) = folder.iterdir()
    before = path.stat().st_mtime_ns
    for mode, counts in ((0o770, [2, 3]), (0o707, [4, 5]), (0o700, [5, 5])):
        folder.chmod(mode)
        assert [compiles(), compiles()] == counts
    assert path.stat().st_mtime_ns == before


@POSIX
def test_a_file_that_others_may_write_is_replaced(compiles: Callable[[], int], folder: Path) -> None:
    assert compiles() == 1
    (path,) = folder.iterdir()
    path.chmod(0o620)
    assert [compiles(), compiles()] == [2, 2]
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_user_without_a_home_has_no_cache(compiles: Callable[[], int], monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("PINBOUND_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(object_cache.Path, "home", homeless)
    assert [compiles(), compiles()] == [1, 2]


@pytest.mark.parametrize("what", ["file", "open", "full"])
def test_a_folder_that_cannot_be_used_is_told_once(
    what: str, compiles: Callable[[], int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    if what == "open" and sys.platform == "win32":
        pytest.skip("modes of POSIX")
    folder = tmp_path / "cache"
    monkeypatch.setenv("PINBOUND_CACHE_DIR", str(folder))
    monkeypatch.setattr(object_cache, "_said", set())

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    if what == "file":
        folder.write_text("no folder")
    elif what == "full":
        monkeypatch.setattr(object_cache.os, "replace", full)
    else:
        (folder / "kernels").mkdir(parents=True)
        (folder / "kernels").chmod(0o777)
    with caplog.at_level("WARNING", logger="pinbound"):
        compiles()
        compiles()
    (message,) = [record.getMessage() for record in caplog.records]
    assert str(folder / "kernels") in message
    assert "PINBOUND_CACHE_DIR" in message
    assert {"file": "Not a directory", "open": "others may write", "full": "No space left"}[what] in message


@POSIX
def test_what_belongs_to_somebody_else_is_not_used(
    compiles: Callable[[], int], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiles() == 1
    (path,) = folder.iterdir()
    before, me = path.stat(), os.geteuid()
    monkeypatch.setattr(object_cache.os, "geteuid", lambda: me + 1)
    assert [compiles(), compiles()] == [2, 3]
    assert path.stat().st_mtime_ns == before.st_mtime_ns
