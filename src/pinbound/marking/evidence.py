"""The evidence for each reason to leave out a pair of links: a proof, a witness, samples, or custom."""

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
    Spare,
)
from pinbound.marking.narrow import Pair
from pinbound.typing import Array
from pinbound.values import FrozenDict, MadeMapping, read_only

__all__ = ["Evidences"]

Key = tuple[str, str, str]


class Evidences(MadeMapping[Key, Evidence]):
    """The evidence for each entry of `left_out`, made when asked for: large robots have millions of pairs."""

    def __init__(
        self,
        judge: Judge,
        left_out: FrozenDict[Key, int],
        spare: Spare,
        dropped: Mapping[Key, Sequence[Pair]],
        home: Array,
    ) -> None:
        """Take what is known.

        Args:
            judge: The robot and its configurations.
            left_out: Pairs of links and reasons.
            spare: How far pairs that can never meet stay apart, by links [m].
            dropped: The pairs of marks that touch at the proposed home, by links and reason.
            home: (n,), the home that is proposed.
        """
        super().__init__(left_out)
        self._tree, self._samples = judge.robot.tree, len(judge.Q)
        self._spare, self._home = spare, read_only(home)
        self._names = {key: tuple((pair.a.name, pair.b.name) for pair in pairs) for key, pairs in dropped.items()}
        self._always = {
            key: min(pair.always or 0.0 for pair in pairs) for key, pairs in dropped.items() if key[2] == ALWAYS
        }

    def make(self, key: Key) -> Evidence:
        """Return the evidence for an entry of `left_out`."""
        a, b, reason = key
        names = self._names.get(key, ())
        if reason == NEVER:
            return Evidence("proof", f"they stay more than {_mm(self._spare.of(a, b))} mm apart, for all q")
        if reason == ALWAYS:
            said = f"balls in them overlap by more than {_mm(self._always[key])} mm, for all q"
            return Evidence("proof", said, None, names)
        if reason.startswith(IN_ALL):
            return Evidence("samples", f"seen in {self._samples} configurations; not proven", None, names)
        if reason == AT_HOME:
            return Evidence("witness", "in contact at the home that is proposed", self._home, names)
        if reason == RIGID:
            return Evidence("proof", "no degree of freedom lies between them")
        if reason == NEIGHBOURS:
            joints = ", ".join(joint.name for joint in self._tree.path_between(a, b) if joint.moves)
            return Evidence("granted", f"one degree of freedom between ({joints}); watch them: --neighbours")
        if reason == FREE_JOINT:
            return Evidence("granted", "no boundary is possible over a free joint")
        return Evidence("granted", "no mark holds these bodies")


def _mm(metres: float) -> str:
    """Return a lower bound in mm, rounded down to four digits."""
    return f"{np.floor(1e3 * metres * 1e3) / 1e3:.3f}"
