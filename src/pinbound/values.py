"""Values are values: what a record holds cannot be written to, and is not shared with the caller's arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Iterator, Mapping
from functools import cache
from typing import Any, NoReturn, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["FrozenDict", "MadeMapping", "Value", "owned", "read_only"]

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")
A = TypeVar("A", bound=NDArray[Any])


class FrozenDict(dict[K, V]):
    """A dict that cannot be changed; it compares as a dict, and hashes if its values do.

    Example:
        >>> marks = FrozenDict({"p": 1})
        >>> marks["p"], marks == {"p": 1}
        (1, True)
        >>> marks["q"] = 2
        Traceback (most recent call last):
        TypeError: this mapping cannot be changed; make a new one, e.g. {**mapping, "name": value}
    """

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError('this mapping cannot be changed; make a new one, e.g. {**mapping, "name": value}')

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __hash__(self) -> int:  # type: ignore[override]
        """Return a hash of the items, whatever their order.

        Raises:
            TypeError: If a value does not hash.
        """
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make it again, for pickle and copy."""
        return FrozenDict, (dict(self),)


class MadeMapping(Mapping[K, V]):
    """A mapping whose values are made each time that they are asked for, so that millions of them need no memory.

    It cannot be changed, and compares with other mappings, hashes and prints as a `FrozenDict` of the same items. What
    is made for one key must be equal each time.

    Args:
        keys: What has the keys, in their order; it is kept, and must not change.

    Example:
        >>> class Squares(MadeMapping[int, int]):
        ...     def make(self, key: int) -> int:
        ...         return key * key
        >>> squares = Squares(FrozenDict({3: None, 2: None}))
        >>> squares[3], list(squares), squares == {2: 4, 3: 9}, squares
        (9, [3, 2], True, {3: 9, 2: 4})
    """

    def __init__(self, keys: Mapping[K, Any]) -> None:
        """Keep the keys."""
        self._keys = keys

    def make(self, key: K) -> V:
        """Return the value of a key that there is."""
        raise NotImplementedError

    def __getitem__(self, key: K) -> V:
        """Return the value of a key; KeyError if there is none."""
        if key not in self._keys:
            raise KeyError(key)
        return self.make(key)

    def __contains__(self, key: object) -> bool:
        """Return whether there is a key; makes no value."""
        return key in self._keys

    def __iter__(self) -> Iterator[K]:
        """Iterate over the keys."""
        return iter(self._keys)

    def __len__(self) -> int:
        """Return how many keys there are."""
        return len(self._keys)

    def __hash__(self) -> int:  # type: ignore[override]
        """Return a hash of the items, whatever their order."""
        return hash(frozenset(self.items()))

    def __repr__(self) -> str:
        """Return the items as a dict shows them."""
        return repr(dict(self))


def read_only(array: A) -> A:
    """Return the array itself if it cannot be written to, else a copy that cannot.

    Example:
        >>> q = np.zeros(2)
        >>> kept = read_only(q)
        >>> q[0] = 1.0
        >>> kept.tolist(), kept.flags.writeable, read_only(kept) is kept
        ([0.0, 0.0], False, True)
    """
    if not array.flags.writeable:
        return array
    copy = array.copy(order="K")
    copy.flags.writeable = False
    return copy


def owned(array: A) -> A:
    """Return an array that nobody else holds, itself, made read-only: no copy need be made of it.

    Example:
        >>> kept = owned(np.zeros(2))
        >>> kept.flags.writeable, read_only(kept) is kept
        (False, True)
    """
    array.flags.writeable = False
    return array


class Value:
    """Base of frozen dataclasses: their arrays, mappings and lists become such as cannot be changed.

    NumPy's strings become Python's, also in tuples and as keys, so that messages and tables show them as names.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        """Freeze the fields."""
        for name in _names(type(self)):
            given = getattr(self, name)
            kept = _frozen(given)
            if kept is not given:
                object.__setattr__(self, name, kept)


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(one.name for one in dataclasses.fields(cast(Any, kind)))


@cache
def _freezer(kind: type) -> Callable[[Any], Any] | None:
    """Return what freezes values of a type; None: they are such as cannot be changed, or are left as they are."""
    if issubclass(kind, np.ndarray):
        return cast(Callable[[Any], Any], read_only)
    if issubclass(kind, Mapping):
        return None if issubclass(kind, FrozenDict | MadeMapping) else _frozen_mapping
    if issubclass(kind, list):
        return _frozen_list
    if issubclass(kind, np.str_):
        return str  # a name from an array prints as a name
    return _frozen_tuple if issubclass(kind, tuple) else None


def _frozen(value: object) -> Any:
    freezer = _freezer(type(value))
    return value if freezer is None else freezer(value)


def _frozen_mapping(value: Mapping[Any, Any]) -> Any:
    return FrozenDict({_frozen(key): _frozen(entry) for key, entry in value.items()})


def _frozen_list(value: list[Any]) -> Any:
    return tuple(_frozen(entry) for entry in value)


def _frozen_tuple(value: tuple[Any, ...]) -> Any:
    if not value:
        return value
    kept = [_frozen(entry) for entry in value]
    changed = any(a is not b for a, b in zip(kept, value, strict=True))
    return tuple(kept) if changed and type(value) is tuple else value
