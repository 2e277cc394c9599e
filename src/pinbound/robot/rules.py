"""Rules of robot makers in terms of q: plain limits, or limits that apply where conditions hold."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction

import numpy as np

from pinbound.annotations import Annotations, Condition, Rule
from pinbound.exceptions import Problems, name_hint
from pinbound.model.coupling import Coupling, GuardedLimit, LinearLimit, linear_text
from pinbound.model.kinematics import Joint
from pinbound.typing import Array

__all__ = ["condition_text", "place_of_limit", "rule_limits"]


def rule_limits(
    rules: Sequence[Rule],
    coupling: Coupling,
    errors: Array,
    problems: Problems,
    taken: Collection[str] = (),
    sources: Mapping[str, str] | None = None,
) -> tuple[tuple[LinearLimit, ...], tuple[GuardedLimit, ...]]:
    """Return the limits of rules in terms of q: plain limits, and ends that are guarded by conditions.

    With `theta = S q + o`, a rule `lower <= c . theta <= upper` becomes `lower <= (c S) q + c . o <= upper`; the
    products are summed exactly and rounded once. If joints may differ from the coupling by `errors`, the rule becomes
    narrower and a condition wider by `sum_j |c_j| errors_j`, so that the rule holds for the true linkage.

    Args:
        rules: The rules.
        coupling: The coupling.
        errors: (n_tree,), the largest difference of each tree joint from the coupling [rad or m].
        problems: Collects the faults.
        taken: Names of boundaries, which rules must not use.
        sources: The file of each rule, as in `Annotations.sources`.
    """
    plain: list[LinearLimit] = []
    guarded: list[GuardedLimit] = []
    for rule in rules:
        source = (sources or {}).get(f"rule {rule.name}")
        if rule.name in taken:
            problems.add(f"rule {rule.name!r} has the name of a boundary", "Rename one of them", rule.line, source)
        strange = [name for one in (rule, *rule.where) for name in one.coefficients if name not in coupling.joints]
        if strange:
            said = f"rule {rule.name!r} names {strange[0]!r}, which has no value of its own"
            problems.add(said, name_hint(strange[0], coupling.joints), rule.line, source)
            continue
        limit = _said_of_q(rule.name, rule, coupling, errors, 1.0)
        if not np.any(limit.coefficients):
            said = f"rule {rule.name!r} does not depend on q: the coupling makes its sum {limit.offset:.6g} everywhere"
            problems.add(said, "Correct its coefficients, or remove it", rule.line, source)
            continue
        where = [_said_of_q(rule.name, condition, coupling, errors, -1.0) for condition in rule.where]
        constant = [one for one in where if not np.any(one.coefficients)]
        if any(not one.lower <= one.offset <= one.upper for one in constant):
            said = f"a condition of rule {rule.name!r} never holds: the coupling makes its sum constant"
            problems.add(said, "Correct the condition, or remove the rule", rule.line, source)
            continue
        where = [one for one in where if np.any(one.coefficients)]
        if not where:
            plain.append(limit)
            continue
        for lower, upper in ((limit.lower, math.inf), (-math.inf, limit.upper)):
            if math.isfinite(lower) or math.isfinite(upper):
                end = LinearLimit(rule.name, limit.coefficients, limit.offset, lower, upper)
                guarded.append(GuardedLimit(end, tuple(where)))
    return tuple(plain), tuple(guarded)


def _said_of_q(name: str, rule: Rule | Condition, coupling: Coupling, errors: Array, sign: float) -> LinearLimit:
    """Return a rule or condition as a limit on q, narrowed (sign 1) or widened (sign -1) by the joints' errors."""
    rows = [(Fraction(c), coupling.joints.index(joint)) for joint, c in rule.coefficients.items()]
    n = len(coupling.coordinates)
    c = np.array([float(sum(f * Fraction(float(coupling.S[row, k])) for f, row in rows)) for k in range(n)])
    offset = float(sum(f * Fraction(float(coupling.offset[row])) for f, row in rows))
    error = sign * sum(abs(float(f)) * float(errors[row]) for f, row in rows)
    return LinearLimit(name, c, offset, rule.lower + error, rule.upper - error)


def condition_text(condition: LinearLimit, names: Sequence[str], factor: float = 1.0, unit: str = "") -> str:
    """Return the text of a condition or a rule for people; numbers are multiplied by `factor` and have a unit.

    Example:
        >>> condition_text(LinearLimit("front", np.array([0.0, 1.0]), 0.0, -math.inf, 0.5), ("J2", "J3"))
        'J3 <= 0.5'
    """
    middle = linear_text(condition.coefficients, names, factor * condition.offset)
    lower = f"{factor * condition.lower:.6g}{unit} <= " if math.isfinite(condition.lower) else ""
    upper = f" <= {factor * condition.upper:.6g}{unit}" if math.isfinite(condition.upper) else ""
    if lower and not upper:
        return f"{middle} >= {factor * condition.lower:.6g}{unit}"
    return f"{lower}{middle}{upper}"


def place_of_limit(name: str, marks: Annotations, joints: Mapping[str, Joint]) -> tuple[int | None, str | None]:
    """Return line and file of the source of a limit: a rule, limits or a mimic joint in annotations, or the joint."""
    said = {f"rule {one.name}": one.line for one in marks.rules}
    said |= {f"limit {one.joint}": one.line for one in marks.limits}
    said |= {f"follower {one.joint}": one.line for one in marks.followers}
    for key in (f"{kind} {name}" for kind in ("rule", "limit", "follower")):
        if key in said:
            return said[key], marks.sources.get(key)
    return (joints[name].line if name in joints else None), None
