"""Expansion of xacro in a child process, because a xacro file runs code and xacro keeps its state in globals.

The child (`xacro_child`) is started at the first xacro file and kept. Each file is expanded in a fork of it, one after
another. So loads from several threads never mix their arguments, an expression that does not end is stopped, and
changes that a file makes in its process do not survive it. This isolates state, but it is not a sandbox: an expression
can do everything that the user can do. Load untrusted files with `trust="urdf-only"`.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import json
import os
import selectors
import signal
import struct
import subprocess
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pinbound.exceptions import InputError, Problem, name_hint
from pinbound.model.xml_text import refusal
from pinbound.tolerances import XACRO_MEMORY, XACRO_SECONDS

__all__ = ["Expanded", "expand_xacro"]

_CHILD = Path(__file__).with_name("xacro_child.py")
_BOOT = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
exec(compile(open(sys.argv[2], encoding="utf-8").read(), sys.argv[2], "exec"), {"__name__": "__main__"})"""
_MOST_KEPT, _MOST_TEXT = 32, 4 * 2**20  # number of answers, and characters of each
_GRACE = 10.0  # seconds to start the child, or to wait for one that should have stopped an expansion


@dataclass(frozen=True, slots=True)
class Expanded:
    """An expanded xacro file.

    Attributes:
        text: The URDF.
        notes: Warnings of xacro, and packages that were found beside the file only.
    """

    text: str
    notes: tuple[str, ...]


def expand_xacro(path: Path, arguments: Mapping[str, str], package_dirs: Sequence[str] = ()) -> Expanded:
    """Expand a xacro file; `$(find name)` looks in `package_dirs` first.

    Raises:
        InputError: If xacro refuses it, with file and line where known; if it takes longer than `XACRO_SECONDS` (the
            variable `PINBOUND_XACRO_SECONDS` sets another limit); or if an argument is declared nowhere.
    """
    request: dict[str, Any] = {
        "path": str(path),
        "arguments": dict(arguments),
        "package_dirs": [os.path.abspath(folder) for folder in package_dirs],
        "folder": os.getcwd(),
        "environment": dict(os.environ),
        "seconds": _seconds(path),
        "memory": XACRO_MEMORY,
    }
    key = json.dumps(
        {name: value for name, value in request.items() if name not in ("environment", "seconds", "memory")}
    )
    answer = _kept(key) or _ask(request, path)
    _keep(key, answer)
    declared: list[str] = answer.get("declared", [])
    problems = [_fault(answer, path, float(request["seconds"]))] if "error" in answer else []
    unknown = sorted(set(arguments) - set(declared))
    if unknown and (not problems or declared):
        message = f"has no xacro argument {', '.join(map(repr, unknown))}"
        problems.append(Problem(message, name_hint(unknown[0], declared), path.name))
    if problems:
        raise InputError(problems)
    notes = [f"$(find {name}) is {folder}, found beside the file" for name, folder in answer["guessed"].items()]
    notes += [f"xacro warns: {line}" for line in answer["warned"]]
    return Expanded(answer["text"], tuple(notes))


_answers: OrderedDict[str, dict[str, Any]] = OrderedDict()
_answers_lock = threading.Lock()


def _keep(key: str, answer: dict[str, Any]) -> None:
    """Keep an answer that lists all files it depends on."""
    if "files" not in answer or len(answer["text"]) > _MOST_TEXT:
        return
    with _answers_lock:
        _answers[key] = answer
        _answers.move_to_end(key)
        while len(_answers) > _MOST_KEPT:
            _answers.popitem(last=False)


def _kept(key: str) -> dict[str, Any] | None:
    """Return the answer to the same question, if its files still have the same bytes."""
    with _answers_lock:
        answer = _answers.get(key)
    if answer is None:
        return None
    for file, known in answer["files"].items():
        try:
            if hashlib.sha256(Path(file).read_bytes()).hexdigest() != known:
                return None
        except OSError:
            return None
    return answer


def _seconds(path: Path) -> float:
    text = os.environ.get("PINBOUND_XACRO_SECONDS", "")
    try:
        seconds = float(text) if text else XACRO_SECONDS
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < 1e6:  # a timer's range, eleven days
        raise refusal(path.name, f"PINBOUND_XACRO_SECONDS is {text!r}", "Set it to a number of seconds, or unset it")
    return seconds


def _fault(answer: dict[str, Any], path: Path, seconds: float) -> Problem:
    error = str(answer["error"])
    by_hand = "Expand it with xacro yourself and load the .urdf"
    known = {
        "time": (f"xacro did not finish within {seconds:g} s", f"{by_hand}, or set PINBOUND_XACRO_SECONDS"),
        "memory": (f"xacro needs more than {XACRO_MEMORY / 2**30:g} GiB of memory", by_hand),
        "size": ("it expands to more than 64 MiB", by_hand),
        "end": ("the process that expanded it ended without an answer", by_hand),
    }
    if error in known:
        return Problem(*known[error], path.name)
    file = str(answer.get("file") or path)
    source = path.name if os.path.abspath(file) == os.path.abspath(path) else os.path.relpath(file, path.parent)
    line = answer.get("line")
    if answer.get("refused"):
        remedy = "Remove it: pinbound resolves no entities, neither internal nor external ones"
        return Problem(error, remedy, source, line)
    remedy = "Correct the xacro file or its arguments"
    if "there is no package" in error:
        remedy = "Give the folder that holds the package: package_dirs=[...], or --package-dir"
    return Problem(f"xacro cannot expand it: {error}", remedy, source, line)


class _Child:
    """The waiting process; each process has one, with one question at a time."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.process: subprocess.Popen[bytes] | None = None

    def forget(self) -> None:
        """Do not use the parent's child after a fork: its pipes belong to the parent."""
        self.__init__()

    def start(self) -> subprocess.Popen[bytes]:
        if self.process is not None and self.process.poll() is not None:
            self.stop()  # it has died: close its pipes
        if self.process is None:
            search = [folder for folder in sys.path if folder]
            command = [sys.executable, "-I", "-c", _BOOT, json.dumps(search), str(_CHILD)]
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        return self.process

    def stop(self) -> None:
        """End the process and all processes that it started."""
        process, self.process = self.process, None
        if process is None:
            return
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def ask(self, question: bytes, seconds: float) -> bytes | None:
        """Return the answer; None if there is none in time, or if the process has died."""
        process = self.start()
        if process.stdin is None or process.stdout is None:
            return None  # never, because both are pipes
        deadline = time.monotonic() + seconds
        try:
            process.stdin.write(struct.pack(">I", len(question)) + question)
            process.stdin.flush()
        except OSError:
            return None
        head = _receive(process.stdout, 4, deadline)
        return None if head is None else _receive(process.stdout, struct.unpack(">I", head)[0], deadline)


def _receive(stream: Any, count: int, deadline: float) -> bytes | None:
    """Return `count` bytes of a pipe, or None if they do not come in time."""
    found = bytearray()
    with selectors.DefaultSelector() as selector:
        selector.register(stream, selectors.EVENT_READ)
        while len(found) < count:
            if not selector.select(max(0.0, deadline - time.monotonic())):
                return None
            part = os.read(stream.fileno(), min(count - len(found), 2**20))
            if not part:
                return None
            found += part
    return bytes(found)


_THE_CHILD = _Child()
atexit.register(_THE_CHILD.stop)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_THE_CHILD.forget)


def _ask(request: dict[str, Any], path: Path) -> dict[str, Any]:
    """Ask the child; if it died between two questions, it is started again once."""
    question = json.dumps(request).encode()
    if not sys.executable:
        message = "xacro is expanded in a separate Python process, and this program cannot find a Python interpreter"
        raise refusal(path.name, message, "Expand it with xacro yourself and load the .urdf")
    with _THE_CHILD.lock:
        for attempt in range(2):
            begun = time.monotonic()
            try:
                answer = _THE_CHILD.ask(question, float(request["seconds"]) + _GRACE)
            except BaseException:  # an interrupt leaves half a message in the pipe
                _THE_CHILD.stop()
                raise
            if answer is not None:
                return dict(json.loads(answer))
            _THE_CHILD.stop()
            if time.monotonic() - begun >= float(request["seconds"]):
                return {"error": "time"}
            if attempt:
                break
    return {"error": "end"}
