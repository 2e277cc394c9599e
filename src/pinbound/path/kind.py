"""The case of a pair of marks, decided once, when its path is reduced.

`Kind` says how the two links are related in the tree, `Case` says which quantity is measured between which shapes, and
`Form` says how many angles and smooth pieces it has. An interpreter has one table for each of these, with an entry for
each value.
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
    """The measured quantity; `r = x_a - x_b`, A is the projection and n the normal of the path."""

    POINTS = "two points"
    """`|r|`, one vector."""
    BODIES = "two bodies, or a point and a body"
    """The minimum of `|r|` over all points of segments, parallelograms, boxes, prisms and hulls."""
    LINE = "across a line"
    """The minimum of `|A r|` over all points of the other mark."""
    PLANE = "above a plane"
    """The minimum of `n . r` over all points of the other mark: a height, which may be negative."""


class Form(Enum):
    """The form of a path, which decides how an interpreter computes its separation."""

    CONSTANT = "constant"
    """No coordinate: two points that never move relative to each other."""
    ONE_ANGLE = "one effective angle"
    """Two points, or a point and a plane, with one effective angle and no prismatic joint."""
    SMOOTH = "smooth"
    """Two points, a point and a line, or a point and a plane."""
    PIECEWISE = "piecewise"
    """The minimum of smooth functions in closed form: at most two directions, or a height."""
    SEARCHED = "searched"
    """An iteration over vertices finds the nearest points."""
