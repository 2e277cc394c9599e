"""Expansion of xacro files in a separate process: `expansion` starts it and uses its pipes, and never imports it.

xacro keeps arguments, file names and macros in module globals, and evaluates Python expressions of the file. So one
process with xacro loaded waits here, and each file is expanded in a fork of it. This gives a fresh state, a time limit
and a memory limit, and changes that a file makes do not remain. Without `fork` (Windows) files are expanded one after
another in this process, and `expansion` ends it when the time is up.

An answer lists the files it depends on, if it depends on nothing else (`_Watch`): then it may be reused.

A message is its length in four bytes, then JSON. This file imports the standard library and xacro only.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import importlib
import io
import json
import os
import struct
import sys
import xml.dom.expatbuilder
import xml.dom.minidom
from types import CodeType
from typing import Any, BinaryIO
from xml.parsers.expat import ExpatError

__all__ = ["find_package", "serve"]

_DEEPEST = 6
_MOST_TEXT = 64 * 2**20
_MOST_CODE = 4096
_SKIPPED = ("build", "log", "node_modules", "__pycache__")


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer one request after another until the other side closes its end."""
    while (request := _read(requests)) is not None:
        answer = _in_fork(request) if hasattr(os, "fork") else json.dumps(_expand(request)).encode()
        answers.write(struct.pack(">I", len(answer)) + answer)
        answers.flush()


def _read(stream: BinaryIO) -> dict[str, Any] | None:
    head = stream.read(4)
    if len(head) < 4:
        return None
    return dict(json.loads(stream.read(struct.unpack(">I", head)[0])))


def _in_fork(request: dict[str, Any]) -> bytes:
    """Expand in a fork that the kernel ends when its time is up; return its answer, or the reason of its end."""
    import signal

    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, float(request["seconds"]))
            _limit_memory(int(request["memory"]))
            gc.disable()  # the process ends soon
            nothing = os.open(os.devnull, os.O_RDWR)
            for descriptor in (0, 1, 2):  # the output of a file is discarded
                os.dup2(nothing, descriptor)
            with open(theirs, "wb") as stream:
                stream.write(json.dumps(_expand(request, _Watch())).encode())
        finally:
            os._exit(0)
    os.close(theirs)
    with open(ours, "rb") as stream:
        answer = stream.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) or not answer:
        ended = "time" if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM else "end"
        return json.dumps({"error": ended}).encode()
    return answer


def _limit_memory(size: int) -> None:
    import resource

    with contextlib.suppress(OSError, ValueError):  # macOS has this limit but does not allow setting it
        resource.setrlimit(resource.RLIMIT_AS, (size, size))


class _Watch:
    """The files that an expansion reads: XML files, with their hashes; `is_known` until it uses anything else.

    Python tells this hook of every file that is opened, every process, socket, import and listing of a folder, and of
    every code that runs. Code within an expression (a lambda, a generator; before Python 3.12 a comprehension too)
    escapes xacro's check of names, so it counts as anything. Environment variables are read through `_Environment`. A
    hook cannot be taken back: it is for a fork.
    """

    def __init__(self) -> None:
        self.is_known, self.files, self._opening = True, dict[str, str](), ""

    def start(self) -> None:
        setattr(os, "environ", _Environment(self, os.environ))  # noqa: B010 - so that reading it is seen
        sys.addaudithook(self._told)

    def read(self, path: str) -> bytes:
        """Return the bytes of a file of XML, and remember their hash."""
        self._opening = path
        try:
            with open(path, "rb") as stream:
                data = stream.read()
        finally:
            self._opening = ""
        self.files[os.path.abspath(path)] = hashlib.sha256(data).hexdigest()
        return data

    def _told(self, event: str, given: tuple[Any, ...]) -> None:
        if event == "exec":
            code = given[0]
            self.is_known &= not any(isinstance(one, CodeType) for one in code.co_consts)
            self.is_known &= not any("__" in name for name in code.co_names)
        elif event not in _HARMLESS and not (event == "open" and self._opening and given[0] == self._opening):
            self.is_known = False


_HARMLESS = ("builtins.id", "compile", "sys._getframe")


class _Environment(dict[str, str]):
    """Environment variables; an expansion that reads one depends on more than files."""

    def __init__(self, watch: _Watch, variables: Any) -> None:
        super().__init__(variables)
        self.watch = watch

    def __getitem__(self, name: str) -> str:
        self.watch.is_known = False
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self.watch.is_known = False
        return super().__contains__(name)

    def __iter__(self) -> Any:
        self.watch.is_known = False
        return super().__iter__()

    def get(self, name: str, default: Any = None) -> Any:
        self.watch.is_known = False
        return super().get(name, default)

    def items(self) -> Any:
        self.watch.is_known = False
        return super().items()

    def keys(self) -> Any:
        self.watch.is_known = False
        return super().keys()

    def values(self) -> Any:
        self.watch.is_known = False
        return super().values()

    def copy(self) -> Any:
        self.watch.is_known = False
        return super().copy()


class _Arguments(dict[str, str]):
    """Arguments that record which names `<xacro:arg>` has declared: xacro asks whether each is given."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.declared: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.declared.add(str(name))
        return super().__contains__(name)


class _RefusedError(Exception):
    """A file that is not read because it has a DOCTYPE."""


def _expand(request: dict[str, Any], watch: _Watch | None = None) -> dict[str, Any]:
    """Return the expanded text, the warnings of xacro, and the declared arguments; or the fault and its place."""
    xacro: Any = importlib.import_module("xacro")
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    arguments, guessed, warned = _Arguments(request["arguments"]), dict[str, str](), io.StringIO()
    _teach(xacro, request, guessed, watch)
    _hasten(xacro)
    if watch is not None:
        watch.start()
    answer: dict[str, Any] = {}
    try:
        with contextlib.redirect_stderr(warned), contextlib.redirect_stdout(io.StringIO()):
            text = str(xacro.process_file(request["path"], mappings=arguments).toprettyxml(indent="  "))
        answer = {"text": text} if len(text) <= _MOST_TEXT else {"error": "size"}
        if watch is not None and watch.is_known and "text" in answer:
            answer["files"] = watch.files
    except Exception as error:  # expressions of a file may raise any exception
        answer = {"error": _reason(error), "refused": isinstance(error, _RefusedError)} | _where(error, xacro)
    lines = [line.strip() for line in warned.getvalue().splitlines()]
    return answer | {"declared": sorted(arguments.declared), "guessed": guessed, "warned": _plain(lines)}


def _plain(lines: list[str]) -> list[str]:
    import re

    return [line for line in (re.sub(r"\x1b\[[0-9;]*m", "", line) for line in lines) if line]


def _reason(error: BaseException) -> str:
    inner = getattr(error, "exc", None) or error  # xacro wraps exceptions of expressions
    if isinstance(inner, MemoryError):
        return "memory"
    if isinstance(inner, RecursionError):
        return "macros or properties refer to themselves"
    said = " ".join(str(error).split())
    name = type(error).__name__
    return said if name in ("XacroException", "_RefusedError") and said else f"{name}: {said}" if said else name


def _where(error: BaseException, xacro: Any) -> dict[str, Any]:
    """Return file and line of the innermost element that was being evaluated; for XML faults, their own line."""
    found: dict[str, Any] = {}
    trace = error.__traceback__
    while trace is not None:
        for name in ("node", "elt", "tag"):
            element = trace.tb_frame.f_locals.get(name)
            while element is not None and not hasattr(element, "pinbound_line"):
                element = getattr(element, "parentNode", None)
            if element is not None:
                found = {"file": element.pinbound_file, "line": element.pinbound_line}
        trace = trace.tb_next
    if isinstance(error, ExpatError | _RefusedError):
        found = {"file": str(xacro.filestack[-1]) if xacro.filestack else "", "line": getattr(error, "lineno", None)}
    return found


def _teach(xacro: Any, request: dict[str, Any], guessed: dict[str, str], watch: _Watch | None) -> None:
    """Let xacro read files of any encoding with their lines, refuse a DOCTYPE, and find packages without ROS."""

    def parse(inp: Any, filename: str | None = None) -> Any:
        if inp is not None:
            return xml.dom.minidom.parseString(inp)
        path = os.path.join(getattr(xacro, "root_dir", ".") or ".", str(filename))
        try:
            data = (watch or _Watch()).read(path)
        except OSError as error:
            xacro.filestack.pop()
            raise xacro.XacroException(f"{error.strerror}: {error.filename}", exc=error) from error
        return _parsed(data, str(filename))

    xacro.parse = parse
    with contextlib.suppress(ImportError):
        substitution_args: Any = importlib.import_module("xacro.substitution_args")
        stock = substitution_args._eval_find

        def find(name: str) -> str:
            if watch is not None:
                watch.is_known = False  # the answer does not record which folders exist
            found = find_package(name, request["package_dirs"], request["path"], os.environ)
            if found is None:
                with contextlib.suppress(Exception):  # the exceptions of ROS's own index depend on its version
                    return str(stock(name))
                looked = "package_dirs, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, CMAKE_PREFIX_PATH and beside the file"
                raise xacro.XacroException(f"there is no package {name!r} in {looked}")
            folder, is_guess = found
            if is_guess:
                guessed[name] = folder
            return folder

        substitution_args._eval_find = find
        substitution_args._eval_dict["find"] = find


def _hasten(xacro: Any) -> None:
    """Keep results that xacro would compute again and again; the output does not change.

    Without this, a macro's expressions are compiled at every call, which takes 40 % of the time for a file of macros;
    here code objects are kept. A text without a dollar sign needs no lexer.
    """
    if getattr(xacro, "pinbound_hastened", False):
        return
    whole = xacro.eval_text

    def eval_text(text: Any, symbols: Any) -> Any:
        return text if type(text) is str and text and "$" not in text else whole(text, symbols)

    xacro.eval_text, xacro.compile = eval_text, functools.lru_cache(maxsize=_MOST_CODE)(compile)
    xacro.pinbound_hastened = True


def _parsed(data: bytes, name: str) -> Any:
    """Return the DOM of a file, each element with its line and file."""
    builder: Any = xml.dom.expatbuilder.ExpatBuilderNS()
    parser = builder.getParser()
    start = builder.start_element_handler

    def started(tag: str, attributes: Any) -> None:
        start(tag, attributes)
        builder.curNode.pinbound_line, builder.curNode.pinbound_file = parser.CurrentLineNumber, name

    def doctype(*_: object) -> None:
        raise _RefusedError("has a DOCTYPE")

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = started, doctype
    return builder.parseString(data)


def find_package(name: str, given: list[str], file: str, environment: Any) -> tuple[str, bool] | None:
    """Return the folder of a ROS package, and whether it was guessed from the location of the file.

    The order is: given folders (a package, or a folder that contains packages at any depth), those of
    `ROS_PACKAGE_PATH` likewise, `share` of `AMENT_PREFIX_PATH` and `CMAKE_PREFIX_PATH`, and, as a guess, the packages
    that contain the file, and those beside them.
    """
    paths = {key: [p for p in environment.get(key, "").split(os.pathsep) if p] for key in _VARIABLES}
    for folder in [*given, *paths["ROS_PACKAGE_PATH"]]:
        found = _within(folder, name)
        if found is not None:
            return os.path.abspath(found), False
    for prefix in [*paths["AMENT_PREFIX_PATH"], *paths["CMAKE_PREFIX_PATH"]]:
        folder = os.path.join(prefix, "share", name)
        if os.path.isdir(folder):
            return os.path.abspath(folder), False
    above = os.path.dirname(os.path.abspath(file))
    while True:
        if _package_name(above) is not None:
            beside = os.path.join(os.path.dirname(above), name)
            for folder in (above, beside):
                if _is_package(folder, name):
                    return folder, True
        if os.path.dirname(above) == above:
            return None
        above = os.path.dirname(above)


_VARIABLES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


def _within(folder: str, name: str) -> str | None:
    """Return the folder of a package in or below a folder."""
    for candidate in (folder, os.path.join(folder, name), os.path.join(folder, "share", name)):
        if _is_package(candidate, name):
            return candidate
    level = [folder]
    for _ in range(_DEEPEST):
        below: list[str] = []
        for parent in level:
            with contextlib.suppress(OSError), os.scandir(parent) as entries:
                below += sorted(e.path for e in entries if e.is_dir() and e.name[0] != "." and e.name not in _SKIPPED)
        for candidate in below:
            if _package_name(candidate) == name:
                return candidate
        level = [candidate for candidate in below if _package_name(candidate) is None]
    plain = os.path.join(folder, name)
    return plain if os.path.isdir(plain) else None


def _is_package(folder: str, name: str) -> bool:
    found = _package_name(folder)
    return found == name or (found == "" and os.path.basename(os.path.abspath(folder)) == name)


def _package_name(folder: str) -> str | None:
    """Return the name in a folder's package.xml, "" if it has no readable name; None without such a file."""
    path = os.path.join(folder, "package.xml")
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as stream:
            root = _parsed(stream.read(), path).documentElement
    except (OSError, ExpatError, ValueError, LookupError, _RefusedError):
        return ""
    for element in root.getElementsByTagName("name"):
        if element.parentNode is root and element.firstChild is not None:
            return str(element.firstChild.data).strip()
    return ""


if __name__ == "__main__":
    with contextlib.suppress(ImportError):
        importlib.import_module("xacro.substitution_args")  # before the first fork, not in each
    serve(sys.stdin.buffer, sys.stdout.buffer)
