"""Records of a pair atlas: for each boundary, where it is proven free or in contact, in its own coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates.records import Reason
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import UnknownNameError
from pinbound.freespace.atlas_format import written_sets
from pinbound.freespace.pair_sets import AngleSet, BoxTree, PairSet, Where
from pinbound.freespace.proven_files import ATLAS, write_file
from pinbound.model.coupling import as_configurations
from pinbound.robot.robot import Robot
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Codes, Flags, Indices
from pinbound.units import several
from pinbound.values import Value

__all__ = ["AtlasGroup", "AtlasPair", "PairAtlas"]

_ROUNDING = 2.0**14 * UNIT_ROUNDOFF
"""Bound of the relative rounding error of a volume, which is summed in parts of up to 4096 boxes."""
_ROWS = 1 << 16


class _Shares:
    """Volumes as proven intervals, from lower bounds of the free volume and of the volume in contact."""

    @property
    def _numbers(self) -> tuple[float, float, float]:
        raise NotImplementedError

    @property
    def volume(self) -> float:
        """Volume of the box of limits [rad^k, metres for a prismatic joint], or the range of one angle [rad]."""
        return self._numbers[0]

    @property
    def free(self) -> tuple[float, float]:
        """Lower and upper bound of the free volume [as `volume`]."""
        volume, free, contact = self._numbers
        return max(0.0, free - _ROUNDING * volume), min(volume, volume - contact + _ROUNDING * volume)

    @property
    def contact(self) -> tuple[float, float]:
        """Lower and upper bound of the volume in contact [as `volume`]."""
        volume, free, contact = self._numbers
        return max(0.0, contact - _ROUNDING * volume), min(volume, volume - free + _ROUNDING * volume)

    @property
    def undecided(self) -> float:
        """Upper bound of the undecided volume, `free[1] - free[0]` [as `volume`]."""
        return self.free[1] - self.free[0]

    @property
    def decided(self) -> float:
        """The decided share, in [0, 1]; 1 if the volume is zero."""
        return max(0.0, 1.0 - self.undecided / self.volume) if self.volume > 0.0 else 1.0


@dataclass(frozen=True, eq=False, repr=False)
class AtlasGroup(_Shares, Value):
    """Boundaries that move by the same chain, mostly those between the same two links, and the sets proven for them.

    A place is free if all of them are proven free there, and in contact if one is proven in contact.

    Attributes:
        names: Names of the boundaries.
        coordinates: The coordinates that they depend on, in the order of the boxes.
        columns: The indices of these coordinates in q.
        known: The proven sets over these coordinates.
        shared_with: Index of the group from which it was copied, if the two differ only in names; else None.

    Example:
        >>> import pinbound as pb
        >>> atlas = pb.pair_atlas(pb.load("minervabot_v3"))
        >>> group = atlas["beta_4"].group
        >>> group.kind, group.coordinates
        ('exact', ('q2', 'q3'))
    """

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    columns: Indices
    known: PairSet
    shared_with: int | None

    def __repr__(self) -> str:
        """Return names, kind, coordinates and shares."""
        names = self.names[0] if len(self.names) == 1 else f"{len(self.names)} boundaries, {self.names[0]} ..."
        over = ", ".join(self.coordinates) or "no coordinate"
        return f"<AtlasGroup {names}: {self.kind} over {over}; {_said(self)}>"

    @property
    def kind(self) -> str:
        """The kind of the sets: ``"exact"``, ``"planar"`` or ``"paving"``.

        Exact: intervals of one effective angle, or pairs that no coordinate moves. Planar: boxes over two coordinates.
        """
        if isinstance(self.known, AngleSet) or not len(self.columns):
            return "exact"
        return "planar" if len(self.columns) == 2 else "paving"

    @property
    def _numbers(self) -> tuple[float, float, float]:
        return self.known.volume, self.known.free, self.known.contact

    def boxes(self, where: Where) -> Array:
        """Return the corners (f, 2, k) of the boxes over `coordinates` with this result.

        For one effective angle they are intervals of the angle, (f, 2, 1).

        Example:
            >>> import pinbound as pb
            >>> atlas = pb.pair_atlas(pb.load("minervabot_v3"), ["beta_4"])
            >>> (low,), (high,) = atlas.groups[0].boxes(pb.Where.FREE)[0]
            >>> round(float(np.degrees(high)), 4)
            32.4291
        """
        if isinstance(self.known, AngleSet):
            ends = np.stack([self.known.edges[:-1], self.known.edges[1:]], axis=1)[:, :, None]
            return ends[self.known.codes == where]
        assert isinstance(self.known, BoxTree)
        return self.known.boxes_of(where)


@dataclass(frozen=True, eq=False, repr=False)
class AtlasPair(_Shares):
    """One boundary of an atlas.

    Attributes:
        name: Name of the boundary.
        group: The group that it is in.
        slot: Its index in the group.

    Example:
        >>> import pinbound as pb
        >>> pair = pb.pair_atlas(pb.load("minervabot_v3"))["beta_4"]
        >>> pair.name, pair.kind, pair.coordinates
        ('beta_4', 'exact', ('q2', 'q3'))
    """

    name: str
    group: AtlasGroup
    slot: int

    def __repr__(self) -> str:
        """Return name, kind, coordinates and shares."""
        over = ", ".join(self.coordinates) or "no coordinate"
        return f"<AtlasPair {self.name}: {self.kind} over {over}; {_said(self)}>"

    @property
    def kind(self) -> str:
        """The kind of its group."""
        return self.group.kind

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The coordinates that the boundary depends on, in the order of the boxes."""
        return self.group.coordinates

    @property
    def _numbers(self) -> tuple[float, float, float]:
        known = self.group.known
        return known.volume, float(known.slot_free[self.slot]), float(known.slot_contact[self.slot])


def _said(one: _Shares) -> str:
    if not one.volume > 0.0:
        return "no volume"
    shares = (100.0 * part / one.volume for part in (one.free[0], one.contact[0], one.undecided))
    return "{:.4g} % free, {:.4g} % in contact, {:.2g} % undecided".format(*shares)


@dataclass(frozen=True, eq=False, repr=False)
class PairAtlas(Value):
    """The proven sets of each boundary over its own coordinates, within the box of limits. Made by `pair_atlas`.

    Attributes:
        robot: The robot.
        boundaries: Names of the requested boundaries, in the robot's order.
        coverage: Which pairs of links these boundaries watch, and which they do not.
        groups: Groups of boundaries that move by the same chain, with their proven sets.
        window: The given (lower, upper) ends, by coordinate [rad, or m for a prismatic joint].
        reason: Why less than the requested share is decided; None if it is decided.
        digest: SHA-256 of the coordinates, limits, paths and thresholds that the proof is about.
        work: The number of bounds computed, one for each box and boundary, or group of boundaries.
        seconds: Wall time [s].

    Example:
        >>> import pinbound as pb
        >>> atlas = pb.pair_atlas(pb.load("minervabot_v3"))
        >>> len(atlas), atlas["beta_4"].kind, atlas["beta_4"].coordinates
        (10, 'exact', ('q2', 'q3'))
    """

    robot: Robot
    boundaries: tuple[str, ...]
    coverage: CoverageRecord
    groups: tuple[AtlasGroup, ...]
    window: Mapping[str, tuple[float, float]]
    reason: Reason | None
    digest: str
    work: int
    seconds: float

    def __repr__(self) -> str:
        """Return how many of which kind there are, how much is decided, and what the boundaries watch."""
        kinds = [group.kind for group in self.groups]
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in ("exact", "planar", "paving") if kind in kinds)
        least = min((group.decided for group in self.groups), default=1.0)
        shared = f", {self.shared} shared" if self.shared else ""
        said = f"{several(len(self), 'boundary')} in {several(len(self.groups), 'group')} ({counts}{shared})"
        return f"<PairAtlas of {self.robot.name}: {said}, {100 * least:.4g} % or more decided; {self.coverage}>"

    def __len__(self) -> int:
        """Return how many boundaries there are."""
        return len(self.boundaries)

    def __getitem__(self, name: str) -> AtlasPair:
        """Return what is proven of a boundary.

        Raises:
            UnknownNameError: If the atlas has no boundary of that name.
        """
        if name not in self._places:
            raise UnknownNameError("boundary of the atlas", name, self.boundaries)
        group, slot = self._places[name]
        return AtlasPair(name, self.groups[group], slot)

    @property
    def pairs(self) -> tuple[AtlasPair, ...]:
        """The proven sets of each boundary, in the order of `boundaries`."""
        return tuple(self[name] for name in self.boundaries)

    @property
    def shared(self) -> int:
        """The number of groups that were copied from another group, which differs only in names."""
        return sum(group.shared_with is not None for group in self.groups)

    @cached_property
    def _places(self) -> dict[str, tuple[int, int]]:
        groups = enumerate(self.groups)
        return {name: (number, slot) for number, group in groups for slot, name in enumerate(group.names)}

    def where(self, Q: ArrayLike) -> Any:
        """Return what is proven about q (n,), as a `Where`, or about each of Q (N, n), as int8 values of `Where`.

        FREE: every boundary of the atlas is free, and all limits and rules are kept. CONTACT: one boundary is in
            contact. UNDECIDED: neither is proven; this includes q beyond the box of limits, and q that is not finite.

        Raises:
            DimensionError: If the last axis is not n long.

        Example:
            >>> import pinbound as pb
            >>> atlas = pb.pair_atlas(pb.load("minervabot_v3"))
            >>> atlas.where([[0.0, 0.3, 0.3], [0.0, 0.3, 1.5], [0.0, 9.0, 0.0]]).tolist()
            [1, -1, 0]
        """
        array, rows = self._rows(Q)
        found = np.empty(len(rows), dtype=np.int8)
        for start in range(0, len(rows), _ROWS):
            found[start : start + _ROWS] = self._where(rows[start : start + _ROWS])
        return found if array.ndim > 1 else Where(int(found[0]))

    def pairs_where(self, Q: ArrayLike) -> Codes:
        """Return what is proven about each boundary at q (n,) or Q (N, n): values of `Where`, (m,) or (N, m).

        Columns are in the order of `boundaries`. Limits are not checked, but beyond their box everything is undecided.

        Raises:
            DimensionError: If the last axis is not n long.

        Example:
            >>> import pinbound as pb
            >>> atlas = pb.pair_atlas(pb.load("minervabot_v3"), ["beta_4", "beta_5"])
            >>> atlas.pairs_where([0.0, 0.0, 1.0]).tolist()
            [-1, 1]
        """
        array, rows = self._rows(Q)
        place = {name: column for column, name in enumerate(self.boundaries)}
        found = np.empty((len(rows), len(self.boundaries)), dtype=np.int8)
        for group in self.groups:
            found[:, [place[name] for name in group.names]] = group.known.slots_where(rows[:, group.columns])
        return found if array.ndim > 1 else found[0]

    def _rows(self, Q: ArrayLike) -> tuple[Array, Array]:
        array = as_configurations(Q, self.robot.coordinates)
        return array, array if array.ndim > 1 else array[None]

    def _where(self, Q: Array) -> Codes:
        kept: Flags = np.all(np.isfinite(Q), axis=1)
        kept[kept] = self.robot.intervals.hold(Q[kept])
        found = np.where(kept, Where.FREE, Where.UNDECIDED).astype(np.int8)
        for group in self.groups:
            left = np.flatnonzero(found != Where.CONTACT)
            code = group.known.where(Q[left][:, group.columns])
            found[left] = np.where(code == Where.CONTACT, code, np.minimum(code, found[left]))
        return found

    def save(self, path: str | Path) -> Path:
        """Write the atlas to an NPZ file, with the hash of the robot and its marks; `pb.load_atlas` reads it.

        Raises:
            OSError: If the file cannot be written.
        """
        own = [group.known for group in self.groups if group.shared_with is None]
        sets, arrays = written_sets(own)
        header = {
            "robot": self.robot.name,
            "boundaries": self.boundaries,
            "window": dict(self.window),
            "reason": None if self.reason is None else self.reason.name,
            "digest": self.digest,
            "work": self.work,
            "seconds": self.seconds,
            "groups": [[group.names, group.columns.tolist(), group.shared_with] for group in self.groups],
            "sets": sets,
        }
        return write_file(Path(path), ATLAS, header, arrays)
