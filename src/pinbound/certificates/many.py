"""certify_many(): a verdict and a lower bound for each of many straight motions, such as the edges of a roadmap."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import families, needs_limits
from pinbound.certificates.distances import ManyAngleBoundaries
from pinbound.certificates.enclosures import Enclosure, Family
from pinbound.certificates.motions import certify
from pinbound.certificates.polynomials import Polynomials
from pinbound.certificates.records import Budget, Verdict, Verdicts
from pinbound.certificates.scope import ONLY_LIMITS, covered, scope
from pinbound.certificates.trajectory import refuse_far
from pinbound.exceptions import DimensionError
from pinbound.model.coupling import as_configurations
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.tolerances import PRECISION
from pinbound.typing import Array, Indices

__all__ = ["certify_many"]

_BATCH = 2**14
_AT_ONCE = 2**12  # motions that machine code gets in one call, to bound memory
_EASY = 20_000.0  # boxes of one motion; a motion that needs more goes to `certify`
_NARROWEST = 2.0**-20  # of a motion; a motion that needs shorter parts goes to `certify`
_CLEAR, _VIOLATED, _UNKNOWN = 0, 1, 2
_PLACES = {verdict: place for place, verdict in enumerate(Verdict)}


def certify_many(
    robot: Robot,
    starts: ArrayLike,
    ends: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    *,
    limits: bool = True,
    limits_only: bool = False,
    precision: float = PRECISION,
    threads: int = 1,
) -> Verdicts:
    """Prove for each of N straight motions that it stays free at every moment, or find where it does not.

    Motion i goes from `starts[i]` to `ends[i]`, straight in q. Its verdict is that of `certify(robot, [starts[i],
    ends[i]])`. `certify` also gives findings for each boundary, with times; this function does not.

    Args:
        robot: The robot.
        starts: (N, n).
        ends: (N, n).
        boundaries: Names of the boundaries to check; None: all.
        budget: The work allowed for each motion that the common search leaves undecided; None: `Budget()`.
        limits: Whether to check joint limits, too.
        limits_only: Whether to check joint limits only. Otherwise, a robot without boundaries gives NOTHING_TO_CHECK.
        precision: Largest difference of the two bounds of the smallest clearance [m] of a certified motion.
        threads: The number of threads that share the motions.

    Returns:
        The verdicts, with proven lower bounds of the smallest clearance, and a witness for each VIOLATED.

    Raises:
        DimensionError: If starts and ends are not N finite configurations each, if precision or threads is not
            positive, or if `limits_only` is given together with boundaries or without limits.
        UnknownNameError: If the robot has no boundary of that name.

    References:
        `docs/certificates.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.certify_many(robot, np.zeros((2, 3)), np.radians([[90, 30, 40], [90, 0, 60]]))
        >>> [verdict.value for verdict in found], bool(found.lower[0] > 0.0)
        (['certified', 'violated'], True)
        >>> bool(robot.boundaries["beta_4"].signed_clearance(found.witnesses[1]) < 0.0)
        True
    """
    began = time.perf_counter()
    if not precision >= 0.0:
        raise DimensionError(f"the precision is {precision}; give a length in metres, zero or more")
    from pinbound.kernel import check_choices  # nothing else here needs it

    check_choices(threads, "auto")
    chosen = scope(robot, boundaries, limits, limits_only)
    controls = _controls(starts, ends, robot.coordinates)
    share = max(1, -(-len(controls) // threads))
    chunks = [_Many(robot, chosen, controls[i : i + share], precision) for i in range(0, len(controls), share)]
    if threads > 1 and len(chunks) > 1:
        with ThreadPoolExecutor(threads) as pool:
            for done in [pool.submit(chunk.run, limits) for chunk in chunks]:
                done.result()
    else:
        for chunk in chunks:
            chunk.run(limits)
    nothing = np.zeros(0)
    codes, lower, upper = (
        np.concatenate([nothing, *(getattr(chunk, name) for chunk in chunks)]) for name in ("codes", "lower", "upper")
    )
    witnesses = np.concatenate([np.zeros((0, len(robot.coordinates))), *(chunk.witnesses for chunk in chunks)])
    boxes = sum(chunk.boxes for chunk in chunks)
    verdicts = np.where(codes == _VIOLATED, _PLACES[Verdict.VIOLATED], _PLACES[Verdict.CERTIFIED])
    names = [boundary.name for boundary in chosen]
    for row in np.flatnonzero(codes == _UNKNOWN).tolist():
        one = certify(
            robot, controls[row], None, names, budget, limits=limits, limits_only=limits_only, precision=precision
        )
        verdicts[row], lower[row], upper[row] = _PLACES[one.verdict], one.lower, one.upper
        boxes += one.boxes
        if one.first_contact is not None:
            lower[row], witnesses[row] = -np.inf, one.first_contact.q
    if not chosen and not limits_only:
        verdicts[verdicts != _PLACES[Verdict.VIOLATED]] = _PLACES[Verdict.NOTHING_TO_CHECK]
    return Verdicts(
        codes=verdicts.astype(np.int64),
        lower=lower,
        upper=upper,
        witnesses=witnesses,
        coverage=covered(robot, chosen),
        notes=(ONLY_LIMITS,) if limits_only else (),
        boxes=boxes,
        seconds=time.perf_counter() - began,
    )


def _controls(starts: ArrayLike, ends: ArrayLike, coordinates: Sequence[str]) -> Array:
    """Return both ends of each motion (N, 2, n)."""
    found: list[Array] = []
    for given, name in ((starts, "starts"), (ends, "ends")):
        Q = as_configurations(given, coordinates)
        if Q.ndim != 2:
            raise DimensionError(f"{name} have shape {Q.shape}; give one row for each motion, (N, {len(coordinates)})")
        bad = np.flatnonzero(~np.all(np.isfinite(Q), axis=1))
        if bad.size:
            raise DimensionError(f"row {bad[0]} of {name} is not finite, {Q[bad[0]].tolist()}; give finite numbers")
        found.append(Q)
    if len(found[0]) != len(found[1]):
        raise DimensionError(
            f"there are {len(found[0])} starts and {len(found[1])} ends; give one of each for a motion"
        )
    if len(found[0]):
        both = np.concatenate(found)
        refuse_far(both.min(axis=0), both.max(axis=0), coordinates)
    return np.stack(found, axis=1)


class _Many:
    """The results for N straight motions so far."""

    def __init__(self, robot: Robot, chosen: Sequence[Boundary], controls: Array, precision: float) -> None:
        count = len(controls)
        nothing = np.zeros(count)
        self.motions = Polynomials(controls, nothing, np.ones(count), np.zeros((count, controls.shape[2])))
        self.robot, self.chosen, self.precision, self.boxes = robot, chosen, precision, 0
        self.codes = np.full(count, _CLEAR)
        self.lower, self.upper = np.full(count, np.inf), np.full(count, np.inf)
        self.witnesses = np.full((count, controls.shape[2]), np.nan)

    def run(self, limits: bool) -> None:
        """Check limits, and all boundaries of the motions that are not known to be in contact."""
        if isinstance(self.robot, LoopRobot):  # the motion of its passive joints is not straight
            self.codes[:], self.lower[:] = _UNKNOWN, -np.inf
            return
        limit_family, one, many, swept = families(self.robot, self.chosen, *self.motions.extent)
        if limits or needs_limits(self.chosen):
            self._search(limit_family, is_limit=True)
            if needs_limits(self.chosen):  # the positions of links are known only within the limits
                self.codes[self.codes == _VIOLATED] = _UNKNOWN
        self._quick(many)
        for family in (one, swept):
            self._search(family, is_limit=False)
        self.lower[self.codes != _CLEAR] = -np.inf
        np.minimum(self.lower, self.upper, out=self.lower)

    def _quick(self, family: ManyAngleBoundaries) -> None:
        """Search pairs of points by machine code if this saves time; otherwise like all other constraints."""
        rows = np.flatnonzero(self.codes == _CLEAR)
        groups = family.groups
        if groups is None or not len(rows) or not groups.is_worth(3 * len(family.names) * len(rows), np.inf):
            self._search(family, is_limit=False)
            return
        for start in range(0, len(rows), _AT_ONCE):
            some = rows[start : start + _AT_ONCE]
            found = groups.many(self.motions.controls[some], self.precision, _EASY)
            self.boxes += found.boxes
            self.lower[some], self.upper[some] = found.lower, found.upper
            self.codes[some[found.unknown]] = _UNKNOWN
            self._found(some[found.violated], found.u[found.violated])

    def _search(self, family: Family, is_limit: bool) -> None:
        """Halve motions for constraints that are not clear, or whose bound is not tight enough."""
        m = len(family.names)
        if not m:
            return
        step = max(1, _BATCH // m)
        for start in range(0, len(self.codes), step):
            motions = np.arange(start, min(start + step, len(self.codes)))
            motions = motions[self.codes[motions] == _CLEAR]
            which = np.tile(np.arange(m), len(motions))
            for u in (0.0, 1.0):
                piece = np.repeat(motions, m)
                at = np.full(len(piece), u)
                self._enclose(family, which, piece, at, at, is_limit)
            piece = np.repeat(motions, m)
            a, b = np.zeros(len(piece)), np.ones(len(piece))
            while len(piece):
                found = self._enclose(family, which, piece, a, b, is_limit)
                narrow = found.settled | (b - a <= _NARROWEST)
                tight = is_limit or (found.lower >= self.upper[piece] - self.precision)
                done = found.clear & (tight | narrow)
                self.codes[piece[narrow & ~found.clear & (self.codes[piece] == _CLEAR)]] = _UNKNOWN
                if not is_limit:
                    np.minimum.at(self.lower, piece[done], found.lower[done])
                left = ~done & (self.codes[piece] == _CLEAR)
                middle = 0.5 * (a + b)[left]
                which, piece = np.tile(which[left], 2), np.tile(piece[left], 2)
                a, b = np.concatenate((a[left], middle)), np.concatenate((middle, b[left]))

    def _enclose(self, family: Family, which: Indices, piece: Indices, a: Array, b: Array, is_limit: bool) -> Enclosure:
        """Bound parts of motions, and keep the values in their middle."""
        self.boxes += len(piece)
        new = np.ones(len(piece), dtype=np.bool_)
        new[1:] = (np.diff(piece) != 0) | (np.diff(a) != 0.0)
        part = self.motions.expand(piece[new], a[new], b[new])
        found = family.enclose(which, part, np.cumsum(new) - 1)
        if not is_limit:
            np.minimum.at(self.upper, piece, found.value + found.error)
        self._found(piece[found.violated], 0.5 * (a + b)[found.violated])
        return found

    def _found(self, motions: Indices, u: Array) -> None:
        """Keep witnesses of contact."""
        self.codes[motions] = _VIOLATED
        self.witnesses[motions] = self.motions.at(motions, u)
