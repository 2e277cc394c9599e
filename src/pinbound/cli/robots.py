"""`pinbound robots`: lists the robots that ship with pinbound. `pinbound new`: writes a first file for a new robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pinbound.cli.outputs import ready_folder
from pinbound.cli.shared import AsJson, console, emit_json, print_table
from pinbound.exceptions import PinboundError, UnknownNameError
from pinbound.model.document import packaged_robots
from pinbound.robot.presets import FAMILY, models

__all__ = ["new", "robots"]


def robots(as_json: AsJson = False) -> None:
    """List the robots that ship with pinbound, and the presets with the confidence and sources of their numbers."""
    presets = [model for model in models() if model.name is not None]
    if as_json:
        emit_json(
            {
                "robots": list(packaged_robots()),
                "presets": [
                    {
                        "name": model.name,
                        "model": model.model,
                        "manufacturer": model.manufacturer,
                        "confidence": model.confidence,
                        "sources": dict(model.sources),
                        "assumptions": model.annotations().assumptions,
                    }
                    for model in presets
                ],
            }
        )
        return
    print_table("Robots", ("name", "file"), [(name, str(path)) for name, path in packaged_robots().items()])
    print_table(
        "Presets of palletizers",
        ("name", "maker and model", "confidence", "rules"),
        [
            (
                str(model.name),
                f"{model.manufacturer} {model.model}",
                model.confidence,
                "; ".join(f"{rule['name']}: {rule['basis']}" for rule in model.facts["rules"]) or "none found",
            )
            for model in presets
        ],
    )
    for model in presets:
        for what, source in model.sources.items():
            console().print(f"{model.name}: {what}: {source}", markup=False, highlight=False)


_START = """<?xml version="1.0"?>
<!--
  A palletizer from its datasheet. Replace the numbers below, which are an example, by those of your datasheet. Lengths
  are in metres, angles in radians: ${math.radians(85)} is 85 degrees. These lengths are on the drawing of the working
  range, seen from the side, with all joints at zero:

    shoulder_x, shoulder_z     from the foot of the robot to the axis of the arm (J2)
    arm, forearm               axis of the arm to elbow; elbow to the pin of the wrist
    flange_x, flange_drop      pin of the wrist to the flange: forward, down
    third_axis                 absolute: the datasheet measures J3 from the ground; relative: from the arm
    forearm_sign               1: a growing J3 lowers the forearm; -1: a growing J3 lifts it
    arm_zero, forearm_zero     only if the drawing is not at zero: tilt of the arm and elevation of the forearm at zero
    j1_lower ... j4_upper      ranges of the joints
    drive, level_*, forward_*  the rods: length of the crank behind the shoulder; pivot of the rod that keeps the wrist
                               level; its pin on the elbow. If they are not on your datasheet, leave them out. Nothing
                               else changes
    ..._width                  thickness of the bodies. Without a width there is no body, and only ranges and rules are
                               checked. Measure it on a drawing, rather too large, and say so in an assumption

  Load this file with pinbound.load("my_palletizer.urdf.xacro"), or give it to any command of pinbound. ROS is not
  needed. The head of palletizer.xacro lists all arguments; `pinbound robots` prints its folder.
-->
<robot name="my_palletizer" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:pinbound="urn:pinbound:1">
  <xacro:include filename="$(find pinbound)/palletizer.xacro"/>
  <xacro:palletizer
    shoulder_x="0.39" shoulder_z="1.11"
    arm="1.22" forearm="1.3"
    flange_x="0.255" flange_drop="0.159"
    third_axis="absolute" forearm_sign="1"
    j1_lower="${math.radians(-180)}" j1_upper="${math.radians(180)}"
    j2_lower="${math.radians(-44)}" j2_upper="${math.radians(85)}"
    j3_lower="${math.radians(-10)}" j3_upper="${math.radians(120)}"
    j4_lower="${math.radians(-360)}" j4_upper="${math.radians(360)}"
    drive="0.4" level_x="-0.3" level_z="0.2" forward_x="0.2" forward_z="0.3"
    arm_width="0.3" forearm_width="0.25" column_width="0.6" flange_width="0.25"/>
  <pinbound:annotations>
    <!-- The maker's rule, if there is one: J3 is at most 60 degrees ahead of, and behind, J2. -->
    <pinbound:rule name="coupling" coefficients="J3: 1, J2: -1"
                   lower="${math.radians(-60)}" upper="${math.radians(60)}"/>
  </pinbound:annotations>
</robot>
"""


def new(
    what: Annotated[str, typer.Argument(help="Kind of robot: palletizer.")],
    out: Annotated[Path, typer.Option(help="Folder for the file.")],
) -> None:
    """Write a commented file to start from, for a robot of your own."""
    if what != FAMILY:
        raise UnknownNameError("kind of robot to start", what, (FAMILY,))
    file = out / "my_palletizer.urdf.xacro"
    if file.exists():
        raise PinboundError(f"{file} is there already; give another --out, or move it away")
    ready_folder(out)
    file.write_text(_START, encoding="utf-8")
    console().print(f"Wrote {file}. Next: pinbound info {file}", markup=False, soft_wrap=True)
