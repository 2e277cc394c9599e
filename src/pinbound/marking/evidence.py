"""What each reason for leaving out a pair of links rests on: a proof, a witness, samples, or custom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pinbound.marking.judge import (
    ALWAYS,
    AT_HOME,
    FREE_JOINT,
    IN_ALL,
    NEIGHBOURS,
    NEVER,
    RIGID,
    Evidence,
    Judge,
)
from pinbound.marking.narrow import Pair
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["evidence_of"]

Key = tuple[str, str, str]


def evidence_of(
    judge: Judge,
    left_out: Mapping[Key, int],
    spare: Mapping[tuple[str, str], float],
    dropped: Mapping[Key, Sequence[Pair]],
    home: Array,
) -> dict[Key, Evidence]:
    """Return what each entry of `left_out` rests on.

    Args:
        judge: The robot and its configurations.
        left_out: Pairs of links and reasons.
        spare: How far pairs that can never meet stay apart, by links [m].
        dropped: The pairs of marks that touch at the proposed home, by links and reason.
        home: (n,), the home that is proposed.
    """
    found: dict[Key, Evidence] = {}
    for key in left_out:
        a, b, reason = key
        pairs = dropped.get(key, ())
        names = tuple((pair.a.name, pair.b.name) for pair in pairs)
        if reason == NEVER:
            found[key] = Evidence("proof", f"they stay more than {_mm(spare[a, b])} mm apart, for all q")
        elif reason == ALWAYS:
            least = min(pair.always or 0.0 for pair in pairs)
            found[key] = Evidence(
                "proof", f"balls in them overlap by more than {_mm(least)} mm, for all q", None, names
            )
        elif reason.startswith(IN_ALL):
            found[key] = Evidence("samples", f"seen in {len(judge.Q)} configurations; not proven", None, names)
        elif reason == AT_HOME:
            found[key] = Evidence("witness", "in contact at the home that is proposed", home, names)
        elif reason == RIGID:
            found[key] = Evidence("proof", "no degree of freedom lies between them")
        elif reason == NEIGHBOURS:
            joints = ", ".join(_between(judge.robot, a, b))
            found[key] = Evidence("granted", f"one degree of freedom between ({joints}); watch them: --neighbours")
        elif reason == FREE_JOINT:
            found[key] = Evidence("granted", "no boundary is possible over a free joint")
        else:
            found[key] = Evidence("granted", "no mark holds these bodies")
    return found


def _between(robot: Robot, a: str, b: str) -> list[str]:
    return [joint.name for joint in robot.tree.path_between(a, b) if joint.moves]


def _mm(metres: float) -> str:
    """Return a lower bound in mm, rounded down to four digits."""
    return f"{np.floor(1e3 * metres * 1e3) / 1e3:.3f}"
