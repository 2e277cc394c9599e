"""cos and sin of all angles of a program: leaves of its graph, once for each distinct angle, or by angle addition.

An angle that is the sum or difference of two or three known angles is computed by addition (4 operations for each
pair). These may only use coordinates that the angle itself uses: a NaN in a coordinate must only affect boundaries that
depend on it.
"""

from __future__ import annotations

from collections.abc import Sequence

from pinbound.kernel.scalars import Graph

__all__ = ["Angle", "Angles"]

Angle = tuple[float, ...]


class Angles:
    """cos and sin of every angle of the set: primary ones as leaves, the others by angle addition."""

    def __init__(self, graph: Graph, wanted: Sequence[Angle]) -> None:
        """Put the needed angles into a graph, the simplest first."""
        self.graph = graph
        self.known: dict[Angle, tuple[int, int]] = {}
        self.by_first: dict[int, list[tuple[int, Angle]]] = {}  # known ones, in order, by their first coordinate
        distinct = sorted({_canonical(angle)[0] for angle in wanted if any(angle)}, key=_simplicity)
        for angle in distinct:
            if angle not in self.known:
                self.known[angle] = self._sum(angle) or graph.angle(angle)
                first = next(j for j, c in enumerate(angle) if c)
                self.by_first.setdefault(first, []).append((len(self.known), angle))

    def of(self, angle: Angle) -> tuple[int, int]:
        """Return cos and sin of a needed angle, or of its negative."""
        if not any(angle):
            return self.graph.constant(1.0), self.graph.constant(0.0)
        canonical, sign = _canonical(angle)
        cos, sin = self.known[canonical]
        return cos, self.graph.mul(self.graph.constant(sign), sin)

    def _sum(self, angle: Angle) -> tuple[int, int] | None:
        """Return cos and sin from the sum of two or three known angles; None if no sum fits."""
        begun = sorted(one for j, c in enumerate(angle) if c for one in self.by_first.get(j, ()))
        usable = [known for _, known in begun if all(a or not k for a, k in zip(angle, known, strict=True))]
        first = [(part, sign, _step(angle, part, sign)) for part in usable for sign in (1.0, -1.0)]
        for part, sign, rest in first:
            if (last := self._with_sign(rest, usable)) is not None:
                return self._compose(((part, sign), last))
        for part, sign, rest in first:
            for other in usable:
                for turn in (1.0, -1.0):
                    if (last := self._with_sign(_step(rest, other, turn), usable)) is not None:
                        return self._compose(((part, sign), (other, turn), last))
        return None

    def _with_sign(self, angle: Angle, usable: Sequence[Angle]) -> tuple[Angle, float] | None:
        if not any(angle):
            return None
        canonical, sign = _canonical(angle)
        return (canonical, sign) if canonical in usable else None

    def _compose(self, parts: Sequence[tuple[Angle, float]]) -> tuple[int, int]:
        g = self.graph
        cos, sin = g.constant(1.0), g.constant(0.0)
        for part, sign in parts:
            c, s = self.known[part]
            minus, plus = (g.sub, g.add) if sign > 0 else (g.add, g.sub)
            cos, sin = minus(g.mul(cos, c), g.mul(sin, s)), plus(g.mul(sin, c), g.mul(cos, s))
        return cos, sin


def _step(angle: Angle, part: Angle, sign: float) -> Angle:
    return tuple(a - sign * p for a, p in zip(angle, part, strict=True))


def _canonical(angle: Angle) -> tuple[Angle, float]:
    """Return the angle with a positive first coefficient, and the sign that was removed."""
    sign = 1.0 if next(c for c in angle if c) > 0 else -1.0
    return tuple(sign * c + 0.0 for c in angle), sign


def _simplicity(angle: Angle) -> tuple[int, float, Angle]:
    return sum(c != 0.0 for c in angle), sum(map(abs, angle)), angle
