"""Which case a pair of marks is: decided once, when its path is reduced, and handed on as values.

Three questions have an answer here. `Kind` says how the two links lie to each other, `Case` what is measured between
what, `Form` how many angles and pieces it has. An interpreter has one table a question, with an entry for each answer.
"""

from __future__ import annotations

from enum import Enum

__all__ = ["Case", "Form", "Kind"]


class Kind(Enum):
    """How two links are related in the tree; helper links do not count.

    `CONSECUTIVE`: one joint is between them. `NON_CONSECUTIVE`: both are on one branch, with more joints between them.
    `BRANCHED`: they are on two branches. `COINCIDENT_BRANCHED`: the two branches start at the same point.

    Example:
        >>> Kind("branched").name
        'BRANCHED'
    """

    CONSECUTIVE = "consecutive"
    NON_CONSECUTIVE = "non-consecutive"
    BRANCHED = "branched"
    COINCIDENT_BRANCHED = "coincident branched"


class Case(Enum):
    """What is measured between what; with `r = x_a - x_b`, A the projection and n the normal of a path."""

    POINTS = "two points"
    """`|r|`, one vector."""
    BODIES = "two bodies, or a point and a body"
    """The least `|r|` over all points of segments, parallelograms, boxes, prisms and hulls."""
    LINE = "across a line"
    """The least `|A r|` over all points of the other mark."""
    PLANE = "above a plane"
    """The least `n . r` over all points of the other mark: a height, which may be negative."""


class Form(Enum):
    """Which case a path is, decided once: how an interpreter gets its separation."""

    CONSTANT = "constant"
    """Of no coordinate: two points that nothing moves to each other."""
    ONE_ANGLE = "one effective angle"
    """Two points, or a point and a plane, and one effective angle, no slide."""
    SMOOTH = "smooth"
    """Two points, a point across a line, or a point above a plane."""
    PIECEWISE = "piecewise"
    """The least of smooth functions in closed form: two directions at most, or a height."""
    SEARCHED = "searched"
    """The nearest points are searched for, by their vertices."""
