"""The reduced chains as data, with everything that another program needs to evaluate the boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pinbound.contact import ContactRule
from pinbound.exceptions import UnsupportedError
from pinbound.model.coupling import LinearLimit
from pinbound.path.chain import Chain

__all__ = ["chains_record"]

_ABOUT = (
    "r(q, t) = b_0 + R_1 (b_1 + R_2 (b_2 + ...)), R_i the rotation about axes[i] by coefficients[i] . q, "
    "b_i = offsets[i] + slides[i] q + sum_k t_k ways[k][i], t_k in [0, 1]. separation = min over t of |r|; with "
    "`across` (rows a) of |a r|; with `is_height` of the one row a . r. signed clearance = separation - "
    "contact_distance; of a stop amplitude sin(d / 2), d = min(phi - gap[0], gap[1] - phi), phi = coefficients . q, "
    "and -amplitude |sin(d / 2)| where d < -2 pi. Positive is free."
)


def chains_record(
    robot: str,
    coordinates: Sequence[tuple[str, str]],
    home: Sequence[float],
    limits: Sequence[LinearLimit],
    boundaries: Sequence[tuple[str, tuple[str, str], ContactRule]],
) -> dict[str, Any]:
    """Return a record for JSON; metres and radians.

    Args:
        robot: The robot's name.
        coordinates: Name and unit of each coordinate, in q's order.
        home: (n,).
        limits: Joint limits, also of mimic joints, in terms of q.
        boundaries: The name, the names of the two marks, and the contact rule of each boundary.
    """
    return {
        "format": "pinbound chains 1",
        "about": _ABOUT,
        "robot": robot,
        "coordinates": [{"name": name, "unit": unit} for name, unit in coordinates],
        "home": [float(value) for value in home],
        "limits": [
            {
                "joint": one.joint,
                "coefficients": one.coefficients.tolist(),
                "offset": one.offset,
                "lower": _finite(one.lower),
                "upper": _finite(one.upper),
            }
            for one in limits
        ],
        "boundaries": [_boundary(*one) for one in boundaries],
    }


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def _boundary(name: str, marks: tuple[str, str], rule: ContactRule) -> dict[str, Any]:
    path, stop = rule.path, rule.stop
    projection = path.projection
    if not path.difference.is_zonotope:
        said = f"boundary {name!r} has a hull or a cylinder, and readers of these chains take every t from [0, 1]"
        raise UnsupportedError(f"{said}; name the other boundaries, or mark a box, a sweep or a capsule instead")
    return {
        "name": name,
        "marks": list(marks),
        "chain": _chain(path.minimal),
        "ways": [way.tolist() for way in path.difference.directions],
        "across": None if projection is None else projection.tolist(),
        "is_height": path.is_signed,
        "contact_distance": rule.distance,
        "stop": None
        if stop is None
        else {
            "coefficients": stop.coefficients.tolist(),
            "gap": list(stop.free_gap),
            "amplitude": stop.amplitude,
        },
    }


def _chain(chain: Chain) -> dict[str, Any]:
    return {
        "offsets": chain.offsets.tolist(),
        "slides": chain.slides.tolist(),
        "axes": chain.axes.tolist(),
        "coefficients": chain.coefficients.tolist(),
    }
