"""Presets: palletizers with published numbers, as arguments of the family in `palletizer.xacro`.

The facts are in `palletizers.yaml`, which ships with pinbound. Unpublished values are never filled in silently: each
stays an argument, and every report of the robot says so until it is given.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from pinbound.annotations import Annotations, Condition, Rule
from pinbound.exceptions import UnknownNameError
from pinbound.model.document import packaged_robots
from pinbound.values import Value

__all__ = ["FAMILY", "PREFIX", "Model", "find_model", "models"]

PREFIX = "palletizers/"
FAMILY = "palletizer"

_LENGTHS = {
    "a1": "shoulder_x",
    "d1": "shoulder_z",
    "a2": "arm",
    "a3": "forearm",
    "elbow_up_offset": "elbow_up",
    "a4": "flange_x",
    "d5": "flange_drop",
}
_NEEDED = ("a1", "d1", "a2", "a3", "a4", "d5")
_WIDTHS = ("arm_width", "forearm_width", "column_width", "flange_width")


@dataclass(frozen=True, eq=False)
class Model(Value):
    """A palletizer, and the published facts about it.

    Attributes:
        name: ``"palletizers/..."``, its name for `load`; None if there are not enough numbers for a robot.
        model: The manufacturer's name of the model.
        manufacturer: The manufacturer.
        confidence: ``"published"``, ``"urdf"`` (third-party models or tables), ``"relative-of"``, ``"nothing found"``.
        facts: The entry of `palletizers.yaml`; lengths are in mm and angles in degrees.
    """

    name: str | None
    model: str
    manufacturer: str
    confidence: str
    facts: Mapping[str, Any]

    @property
    def sources(self) -> Mapping[str, str]:
        """The sources of the numbers, by quantity."""
        return self.facts.get("sources", {})

    @property
    def arguments(self) -> dict[str, str]:
        """Arguments of the family's xacro, in metres and radians, written with `repr` so that no bit is lost."""
        facts, found = self.facts, dict[str, float | str]()
        for key, name in _LENGTHS.items():
            found[name] = facts["lengths_mm"].get(key, 0.0) / 1e3
        for joint in ("J1", "J2", "J3", "J4"):
            low, high = facts["ranges_deg"].get(joint, (-180.0, 180.0))
            found[f"{joint.lower()}_lower"], found[f"{joint.lower()}_upper"] = math.radians(low), math.radians(high)
        found |= {"third_axis": facts["third_axis"], "forearm_sign": facts["forearm_sign"]}
        found |= {
            "arm_zero": math.radians(facts.get("arm_zero_deg", 0.0)),
            "forearm_zero": math.radians(facts.get("forearm_zero_deg", 0.0)),
        }
        for key, names in (("level_pivot_mm", ("level_x", "level_z")), ("forward_pin_mm", ("forward_x", "forward_z"))):
            found |= {name: value / 1e3 for name, value in zip(names, facts.get(key, (0.0, 0.0)), strict=True)}
        found |= dict.fromkeys(("drive", *_WIDTHS), 0.0)
        return {key: value if isinstance(value, str) else repr(value) for key, value in found.items()}

    @property
    def rules(self) -> tuple[Rule, ...]:
        """The rules between J2 and J3, in radians."""
        return tuple(
            Rule(
                rule["name"], _floats(rule["coefficients"]), *_ends(rule), tuple(map(_condition, rule.get("where", ())))
            )
            for rule in self.facts["rules"]
        )

    def annotations(self, given: Collection[str] = ()) -> Annotations:
        """Return the rules, and assumptions for values that are unpublished and not `given` as arguments."""
        return Annotations(rules=self.rules, assumptions=tuple(self._said(given)))

    def _said(self, given: Collection[str]) -> list[str]:
        facts = self.facts
        said = [f"{self.manufacturer} {self.model}: confidence '{self.confidence}'; `pinbound robots` says the sources"]
        said += facts.get("notes", ())
        for key in _NEEDED:
            if key not in facts["lengths_mm"] and _LENGTHS[key] not in given:
                said.append(f"length {key} is not known and taken as zero; give {_LENGTHS[key]} [m]")
        for joint in ("J1", "J2", "J3", "J4"):
            ends = [f"{joint.lower()}_lower", f"{joint.lower()}_upper"]
            if joint not in facts["ranges_deg"] and not set(ends) <= set(given):
                said.append(
                    f"the range of {joint} is not known and left at half a turn each way; give {ends[0]}, {ends[1]}"
                )
        said += [f"rule {rule['name']!r}: {rule['basis']}" for rule in facts["rules"]]
        if not facts["rules"] and facts["third_axis"] == "absolute":
            said.append("no rule between J2 and J3 is known, so none is checked: give one with annotations=")
        if facts["third_axis"] == "absolute" and "drive" not in given:
            said.append("the crank that drives the forearm is not published, its loop is not modelled; give drive [m]")
        if "level_pivot_mm" not in facts and "level_x" not in given:
            said.append(
                "the rods that keep the wrist level are not modelled; give level_x, level_z, forward_x, forward_z [m]"
            )
        if not set(_WIDTHS) <= set(given):
            missing = ", ".join(name for name in _WIDTHS if name not in given)
            said.append(f"widths of bodies are not published, so no boundary watches them; give {missing} [m]")
        return said


def _floats(numbers: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in numbers.items()}


def _ends(entry: Mapping[str, Any]) -> tuple[float, float]:
    """Return the lower and the upper limit in radians; infinite if there is none."""
    return math.radians(entry.get("lower_deg", -math.inf)), math.radians(entry.get("upper_deg", math.inf))


def _condition(entry: Mapping[str, Any]) -> Condition:
    return Condition(_floats(entry["coefficients"]), *_ends(entry))


@cache
def models() -> tuple[Model, ...]:
    """Return all palletizers with collected facts, those of the paper's first table first.

    Example:
        >>> len([model for model in models() if model.facts["in_table"]])
        33
        >>> [model.name for model in models() if model.model == "M-410iB/700"]
        ['palletizers/fanuc_m410ib_700']
    """
    file = packaged_robots()[FAMILY].with_name("palletizers.yaml")
    entries: Any = yaml.safe_load(file.read_text(encoding="utf-8"))
    return tuple(
        Model(
            PREFIX + entry["name"] if "name" in entry else None,
            entry["model"],
            entry["manufacturer"],
            entry["confidence"],
            entry,
        )
        for entry in entries
    )


def find_model(robot: str | Path) -> Model | None:
    """Return the preset with a name `palletizers/...`; None if the text is not such a name, or is a file.

    Raises:
        UnknownNameError: If the preset does not exist.
    """
    if not isinstance(robot, str) or not robot.startswith(PREFIX) or Path(robot).exists():
        return None
    known = {model.name: model for model in models() if model.name is not None}
    if robot not in known:
        raise UnknownNameError("preset", robot, list(known))
    return known[robot]
