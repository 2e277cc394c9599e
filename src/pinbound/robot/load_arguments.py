"""The arguments of `load`, checked before any file is read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, cast

from pinbound.annotations import Annotations
from pinbound.exceptions import InputError
from pinbound.model.xml_text import refusal

__all__ = ["annotation_sources", "check_robot_source", "folders_of", "missing_folders", "xacro_arguments"]


def _refused(argument: str, given: Any, remedy: str) -> InputError:
    return refusal(argument, f"{given!r} is of type {type(given).__name__}", remedy)


def _listed(argument: str, given: Any, kinds: tuple[type, ...], remedy: str) -> list[Any]:
    """Return one value or several as a list; a text is one value, not its letters."""
    single = isinstance(given, kinds) or not isinstance(given, Iterable)
    values: list[Any] = [given] if single else list(cast(Iterable[Any], given))
    for one in values:
        if not isinstance(one, kinds):
            raise _refused(argument, one, remedy)
    return values


def check_robot_source(robot: Any) -> None:
    """Refuse what is neither a text nor a path.

    Raises:
        InputError: If it is something else.
    """
    if not isinstance(robot, str | os.PathLike):
        raise _refused("robot", robot, "Give the name of a robot, a path, or the text of a URDF")


def annotation_sources(given: Any) -> list[Any]:
    """Return one or several sources of annotations as a list.

    Raises:
        InputError: If one is neither a path nor `Annotations`.
    """
    return _listed(
        "annotations", given, (str, os.PathLike, Annotations), "Give a path, Annotations, or a list of these"
    )


def _text(path: str | os.PathLike[str]) -> str:
    return os.fspath(path)


def folders_of(package_dirs: Any) -> tuple[str, ...]:
    """Return one folder or several as texts.

    Raises:
        InputError: If one is neither a text nor a path.
    """
    folders = _listed("package_dirs", package_dirs, (str, os.PathLike), "Give a folder, or a list of folders")
    return tuple(map(_text, folders))


def missing_folders(folders: Iterable[str]) -> list[str]:
    """Return a note for each of `package_dirs` that is no folder.

    Example:
        >>> missing_folders([".", "none/here"])
        ["package_dirs: there is no folder 'none/here', so no package or mesh is found there"]
    """
    return [
        f"package_dirs: there is no folder {one!r}, so no package or mesh is found there"
        for one in folders
        if not os.path.isdir(one)
    ]


def xacro_arguments(given: Any) -> dict[str, str]:
    """Return the arguments of a xacro file as texts.

    Raises:
        InputError: If they are not a mapping.
    """
    if given is not None and not isinstance(given, Mapping):
        raise _refused("xacro_args", given, "Give a dict, e.g. xacro_args={'name': 'value'}")
    return {str(key): str(value) for key, value in cast(dict[Any, Any], given or {}).items()}
