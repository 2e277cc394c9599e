"""The errors of pinbound: one class tree; each error has fields, and its message says what to do."""

from __future__ import annotations

import difflib
import errno
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

__all__ = [
    "DimensionError",
    "InputError",
    "LeavesRegionError",
    "MachineError",
    "PinboundError",
    "Problem",
    "Problems",
    "UnknownNameError",
    "UnsupportedError",
    "blames_the_path",
    "name_hint",
    "printable",
]


class PinboundError(Exception):
    """Base class of every error that pinbound raises.

    Example:
        >>> issubclass(InputError, PinboundError), issubclass(DimensionError, ValueError)
        (True, True)
    """


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault of an input file.

    Attributes:
        message: What is wrong, and what would have been valid.
        remedy: What to do about it.
        source: The file, as the user named it.
        line: The line in that file, or None if the fault has no line.
    """

    message: str
    remedy: str
    source: str
    line: int | None = None

    def __str__(self) -> str:
        """Return ``source:line: message -> remedy``."""
        place = self.source if self.line is None else f"{self.source}, line {self.line}"
        end = "" if self.remedy.endswith(("?", ".", "!")) else "."
        return printable(f"{place}: {self.message}. {self.remedy}{end}")


class InputError(PinboundError, ValueError):
    """A URDF, xacro or annotation file that cannot be used, with all its faults.

    Attributes:
        problems: All faults, in the order of the file.

    Example:
        >>> import pinbound as pb
        >>> try:
        ...     pb.load("<robot name='r'><link name='a'/><link name='a'/></robot>")
        ... except InputError as error:
        ...     print(len(error.problems) > 0)
        True
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Collect the faults into one message."""
        self.problems = tuple(sorted(problems, key=lambda p: (p.source, p.line or 0)))
        count = len(self.problems)
        head = "" if count == 1 else f"{count} problems:\n"
        super().__init__(head + "\n".join(str(problem) for problem in self.problems))


class UnknownNameError(PinboundError, KeyError):
    """A name that the robot does not have.

    Attributes:
        kind: The kind of thing that was requested, e.g. ``"boundary"``.
        name: The name that was given.
        valid: The names that exist.

    Example:
        >>> UnknownNameError("boundary", "beta_11", ["beta_1", "beta_2"]).valid
        ('beta_1', 'beta_2')
    """

    def __init__(self, kind: str, name: object, valid: Iterable[str]) -> None:
        """Say which name is unknown and which ones exist."""
        self.kind, self.valid = kind, tuple(map(str, valid))
        self.name = str(name) if isinstance(name, str) else name  # of NumPy, too
        super().__init__(f"there is no {kind} {self.name!r}. {name_hint(str(name), self.valid)}")

    def __str__(self) -> str:
        """Return the message itself; KeyError alone would print its repr."""
        return str(self.args[0])


class DimensionError(PinboundError, ValueError):
    """An array whose shape does not fit the robot, or that holds numbers that are not finite.

    Example:
        >>> import pinbound as pb
        >>> pb.load("minervabot_v3").boundaries.norms([0.0])
        Traceback (most recent call last):
        pinbound.exceptions.DimensionError: q has shape (1,); give (3,) or (N, 3), the last axis being: q1, q2, q3
    """


class LeavesRegionError(PinboundError, ValueError):
    """A scaled region would leave the feasible region, which can happen if the region is not convex.

    Attributes:
        factor: The requested factor.
        coordinates: The two coordinates of the slice.
        point: (2,) a point of the scaled region that is outside.
        witness: (n,) the same point as a configuration.

    Example:
        >>> error = LeavesRegionError(0.9, ("q1", "q2"), (0.5, 1.0), (0.5, 1.0, 0.0))
        >>> error.factor, error.witness
        (0.9, (0.5, 1.0, 0.0))
    """

    def __init__(self, factor: float, coordinates: tuple[str, str], point: Any, witness: Any) -> None:
        """Say where the scaled region leaves."""
        self.factor, self.coordinates, self.point, self.witness = factor, coordinates, point, witness
        place = ", ".join(f"{name} = {value:.6g}" for name, value in zip(coordinates, point, strict=True))
        super().__init__(
            f"scaled by {factor} about its centroid the region leaves the feasible one, at {place}; "
            "use inset(angle) or with_clearance(metres), or scale inscribed_polygon()"
        )


class MachineError(PinboundError):
    """A failure of the machine or the cluster, not of the input: a full disk, a folder without permission, no worker.

    The same call may succeed after the failure is repaired. The command line exits with 3.

    Example:
        >>> issubclass(MachineError, PinboundError), issubclass(MachineError, ValueError)
        (True, False)
    """


class UnsupportedError(PinboundError):
    """A well-posed question that this version cannot answer; pinbound refuses it and does not guess.

    Example:
        >>> import pinbound as pb
        >>> try:
        ...     pb.load("minervabot_v3").boundaries["beta_4"].limit_expressions("q1")
        ... except UnsupportedError:
        ...     print("no closed form")
        no closed form
    """


class Problems:
    """Collects the faults of one file, so that one error reports all of them.

    Example:
        >>> problems = Problems("arm.urdf")
        >>> problems.add("joint 'elbow' has a zero axis", "give it a direction", line=12)
        >>> problems.raise_if_any()
        Traceback (most recent call last):
        pinbound.exceptions.InputError: arm.urdf, line 12: joint 'elbow' has a zero axis. give it a direction.
    """

    def __init__(self, source: str) -> None:
        """Start with no fault in ``source``."""
        self.source = source
        self.found: list[Problem] = []

    def add(self, message: str, remedy: str, line: int | None = None, source: str | None = None) -> None:
        """Record one fault."""
        self.found.append(Problem(message, remedy, source or self.source, line))

    def raise_if_any(self) -> None:
        """Raise what was collected.

        Raises:
            InputError: If at least one fault was recorded.
        """
        if self.found:
            raise InputError(self.found)


_PATH = ("ENOENT", "EISDIR", "ENOTDIR", "EACCES", "EPERM", "EEXIST", "ELOOP", "ENAMETOOLONG", "EINVAL", "EROFS")
_PATH_ERRORS = {getattr(errno, name) for name in _PATH if hasattr(errno, name)}


def blames_the_path(error: OSError) -> bool:
    """Return whether the system refused because of the given path, and not because the machine failed.

    Example:
        >>> blames_the_path(FileNotFoundError(2, "No such file")), blames_the_path(OSError(28, "No space left"))
        (True, False)
    """
    return error.errno in _PATH_ERRORS


def name_hint(name: str, valid: Iterable[str], most: int = 12) -> str:
    """Return a text with the valid names, the most similar name first.

    Example:
        >>> name_hint("link_22", ["link_1", "link_2", "link_21"])
        "Did you mean 'link_2'? Valid: link_1, link_2, link_21"
        >>> name_hint("LEFTARM_J1", ["time", "LeftArm_J1"])
        "Did you mean 'LeftArm_J1'? Valid: time, LeftArm_J1"
        >>> name_hint("x", [])
        'There is none'
    """
    names = list(valid)
    if not names:
        return "There is none"
    listed = ", ".join(names[:most]) + (f", ... ({len(names)} in all)" if len(names) > most else "")
    close = [known for known in names if known.lower() == name.lower()]
    close = close or difflib.get_close_matches(name, names, n=1)
    return (f"Did you mean {close[0]!r}? " if close else "") + f"Valid: {listed}"


def printable(text: str) -> str:
    r"""Return text in which control characters for terminals are escaped: names and files are data.

    Control characters (such as ESC), formatting characters that reorder a line, and line breaks are escaped as in
    Python. Letters of all scripts and all spaces stay.

    Example:
        >>> print(printable("a\x1b]0;title\x07b \u00e9"))
        a\x1b]0;title\x07b é
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or unicodedata.category(letter) == "Zs" else ascii(letter)[1:-1]
        for letter in text
    )
