"""Body level for meshes: coal's yes or no on raw triangles, and distances only where they are worth their time.

A distance of meshes costs a hundred times more than yes or no. So every sample gets yes or no. A gap is measured where
pinbound refuses and the bodies are clear, at most 200 times. The most informative configurations are searched for:
those at which the straight path from home meets the boundaries of the two links. There the marks touch, so the gap of
the bodies is the needless refusal. Just before, the marks are clear, so contact of the bodies is a miss. A body
completely inside the mesh of another touches no triangle (`inside`): such configurations are counted separately, and
not measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.coverage.bodies import Body
from pinbound.crosscheck.engine import Engine, blocks
from pinbound.crosscheck.inside import Insides
from pinbound.crosscheck.link_pairs import LinkPair, largest, least_clearance
from pinbound.crosscheck.raw import raw_shapes
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = ["check_mesh_pairs", "near_contact"]

Links = tuple[str, str]

_MOST_MEASURED = 200
_MOST_WAYS = 100
_HALVINGS = 30
_LEAST = 1e-9  # metres: a contact of meshes counts as at least this depth


def check_mesh_pairs(
    robot: Robot,
    groups: Mapping[Links, Sequence[int]],
    bodies: Mapping[str, Sequence[Body]],
    Q: Array,
    first_met: Array,
) -> dict[Links, LinkPair | None]:
    """Compare pairs of links with a mesh among their bodies; None for pairs whose bodies all touch at home.

    Args:
        robot: The robot.
        groups: The indices of boundaries, by links.
        bodies: The bodies, by link.
        Q: (N, n), the samples.
        first_met: (N,), the point at which the path from home to each q meets any contact.
    """
    if not groups:
        return {}
    chosen = [body for name in dict.fromkeys(name for links in groups for name in links) for body in bodies[name]]
    of_link: dict[str, list[int]] = {}
    for place, body in enumerate(chosen):
        of_link.setdefault(body.link, []).append(place)
    places = [(i, j) for a, b in groups for i in of_link[a] for j in of_link[b]]
    owner = [links for links in groups for _ in range(len(bodies[links[0]]) * len(bodies[links[1]]))]
    engine = Engine(robot, raw_shapes(robot, chosen), places)
    at_home = engine.collisions(robot.home[None])[0]
    hits = np.concatenate([engine.collisions(Q[block]) for block in blocks(len(Q))])
    looked = _Looked(engine, Insides(engine), Q)
    found: dict[Links, LinkPair | None] = {}
    for links, members in groups.items():
        columns = [place for place, one in enumerate(owner) if one == links]
        apart = [place for place in columns if not at_home[place]]
        boundaries = [robot.boundaries[index] for index in members]
        found[links] = (
            _compared(robot, looked, links, boundaries, (columns, apart), (hits, first_met)) if apart else None
        )
    return found


class _Looked:
    """The engine, the test of bodies inside each other, and the samples with their poses."""

    def __init__(self, engine: Engine, insides: Insides, Q: Array) -> None:
        self.engine, self.insides, self.Q = engine, insides, Q
        self.poses = [engine.poses(Q[block]) for block in blocks(len(Q))]

    def samples_inside(self, places: Sequence[int], rows: Flags) -> tuple[Flags, Flags]:
        """Return at which samples (N,) of `rows` a first body is inside a second one, and the reverse."""
        found = np.zeros((2, len(self.Q)), dtype=np.bool_)
        for block, (rotations, origins) in zip(blocks(len(self.Q)), self.poses, strict=True):
            chosen = np.flatnonzero(rows[block])
            some = rotations[chosen], origins[chosen]
            found[:, chosen + block.start] = self.inside(places, self.Q[block][chosen], some)
        return found[0], found[1]

    def inside(self, places: Sequence[int], Q: Array, poses: tuple[Array, Array] | None = None) -> Flags:
        """Return the same (2, N) for configurations (N, n)."""
        known = self.engine.poses(Q) if poses is None else poses
        each = [self.insides.of_pair(place, Q, known) for place in places]
        return np.any(np.array(each).reshape(len(places), 2, len(Q)), axis=0)


def _compared(
    robot: Robot,
    looked: _Looked,
    links: Links,
    boundaries: Sequence[Boundary],
    places: tuple[Sequence[int], Sequence[int]],
    samples: tuple[Flags, Array],
) -> LinkPair:
    (columns, apart), (hits, first_met), Q, engine = places, samples, looked.Q, looked.engine
    contact = np.any(hits[:, list(apart)], axis=1)
    touching = least_clearance(boundaries, Q) <= 0.0
    beyond = np.isfinite(first_met) & ~touching
    clear = ~beyond & ~touching
    first, second = looked.samples_inside(apart, ~contact & ~np.any(hits[:, list(columns)], axis=1))
    inside = first | second
    missed, refused = np.flatnonzero(clear & contact), np.flatnonzero(touching & ~contact & ~inside)[:_MOST_MEASURED]
    before, after = near_contact(robot, boundaries, Q)
    hit_before = engine.collisions(before)[:, list(apart)].any(axis=1) if len(before) else np.zeros(0, dtype=bool)
    free_after = ~engine.collisions(after)[:, list(apart)].any(axis=1) if len(after) else np.zeros(0, dtype=bool)
    after = after[free_after]
    inside_after = looked.inside(apart, after)
    held = np.concatenate((Q[inside & touching], after[inside_after.any(axis=0)]))
    after = after[~inside_after.any(axis=0)]
    deep_at = np.concatenate((Q[missed[:_MOST_MEASURED]], before[hit_before]))
    gap_at = np.concatenate((Q[refused], after))
    depths = np.array([max(_LEAST, *(engine.depth(q, place) for place in apart)) for q in deep_at])
    gaps = np.array([min(engine.distance(q, place) for place in apart) for q in gap_at])
    miss, miss_q = largest([(np.ones(len(depths), dtype=np.bool_), depths, deep_at)])
    refusal, refusal_q = largest([(np.ones(len(gaps), dtype=np.bool_), gaps, gap_at)])
    return LinkPair(
        links=links,
        boundaries=tuple(boundary.name for boundary in boundaries),
        bodies=len(apart),
        touching=len(columns) - len(apart),
        both_clear=int(np.sum(clear & ~contact)),
        both_contact=int(np.sum(~clear & contact)),
        misses=len(missed) + int(np.sum(hit_before)),
        refusals=int(np.sum(touching & ~contact & ~inside)),
        unreachable=int(np.sum(beyond & ~contact)),
        ways=0,
        miss=miss,
        miss_q=miss_q,
        refusal=refusal,
        refusal_q=refusal_q,
        stops=any(not boundary.has_size for boundary in boundaries),
        meshes=True,
        near=len(before),
        measured=len(gap_at),
        inside=len(held),
        inside_q=held[0] if len(held) else None,
        hidden=int(np.sum(clear & inside)),
        hidden_q=Q[clear & inside][0] if np.any(clear & inside) else None,
        within=_within(links, bool(first.any() or inside_after[0].any()), bool(second.any() or inside_after[1].any())),
    )


def _within(links: Links, first: bool, second: bool) -> str:
    """Return which link is inside which, as text."""
    ways = [f"{a} in {b}" for (a, b), is_so in ((links, first), (links[::-1], second)) if is_so]
    return " and ".join(ways)


def near_contact(robot: Robot, boundaries: Sequence[Boundary], Q: Array) -> tuple[Array, Array]:
    """Return configurations (k, n), (k, n) just before and just after the first contact of paths from home.

    Paths that one effective angle stops before, as `first_met` knows, are bisected, too. The result is a contact of the
    marks that may be unreachable.
    """
    sized = [boundary for boundary in boundaries if not boundary.is_stop]
    if not sized or not least_clearance(sized, robot.home[None])[0] > 0.0:
        return np.empty((0, Q.shape[1])), np.empty((0, Q.shape[1]))
    ends = Q[least_clearance(sized, Q) <= 0.0][:_MOST_WAYS]
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    for _ in range(_HALVINGS if len(ends) else 0):
        middle = 0.5 * (low + high)
        clear = least_clearance(sized, robot.home + middle[:, None] * (ends - robot.home)) > 0.0
        low, high = np.where(clear, middle, low), np.where(clear, high, middle)
    ways = ends - robot.home
    return robot.home + low[:, None] * ways, robot.home + high[:, None] * ways
