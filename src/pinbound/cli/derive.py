"""`pinbound derive`: the vector of each boundary, in the paper's form and reduced, and its contact angle."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.text import Text

from pinbound.boundaries.boundary import Boundary, ContactAngle
from pinbound.boundaries.looped import formula_joints
from pinbound.cli.rules import opened
from pinbound.cli.shared import (
    Annotations,
    AsJson,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    degrees,
    emit_json,
    load_robot,
    millimetres,
)
from pinbound.robot.robot import Robot

__all__ = ["derive"]


def derive(
    robot: RobotName,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    latex: Annotated[bool, typer.Option("--latex", help="Print LaTeX of both forms, and nothing else.")] = False,
    operations: Annotated[
        bool, typer.Option("--operations", help="Also count operations, of this form and of the paper's Eq. (5).")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print kind, ancestor, vector (in the paper's form and reduced) and contact angle of each boundary."""
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    if as_json:
        emit_json([_boundary_record(loaded, name) for name in loaded.boundaries.names])
        return
    from pinbound.evaluate import symbolic

    out, over = console(), opened(loaded)
    for boundary in over.boundaries:
        if latex:
            out.print(f"% {boundary.name}", markup=False)
            out.print(boundary.latex("ancestor"), markup=False, soft_wrap=True)
            out.print(boundary.latex(), markup=False, soft_wrap=True)
            continue
        ends = (
            f"{boundary.point_a.name} ({boundary.point_a.link}) and {boundary.point_b.name} ({boundary.point_b.link})"
        )
        out.print(Text(boundary.name, "bold"), f": {ends}", sep="")
        out.print(
            f"  {boundary.kind.value}; ancestor {boundary.ancestor}; "
            f"depends on {', '.join(loaded.boundaries[boundary.name].coordinates)}"
        )
        paper = symbolic.lines(boundary.expression("ancestor"))
        minimal = symbolic.lines(boundary.expression())
        differs = paper != minimal
        for label, components in (("r", paper), ("r, minimal frame", minimal if differs else ())):
            for axis, line in zip("xyz", components, strict=False):
                out.print(
                    f"  {label}_{axis} [mm] = {line}" if line != "0" else f"  {label}_{axis} = 0",
                    markup=False,
                )
        solved = loaded.coupling.solved(formula_joints(boundary))
        if solved:
            joints = ", ".join(f"{name} = {text}" for name, text in solved.items())
            out.print(f"  {joints}: passive, solved from the loop", markup=False)
        if boundary.path.difference.directions:
            said = "each t is in [0, 1], along the edge vectors of the first mark, then of the second"
            if not boundary.path.difference.is_zonotope:
                said = "t of a hull or cylinder is in the hull of its vertices [m, from its middle]; others in [0, 1]"
            out.print(f"  {said}", markup=False)
        out.print(f"  {_contact_text(boundary)}", markup=False)
        if boundary.place_error:
            off = millimetres(boundary.place_error, 6)
            out.print(f"  the sides of a loop differ: error up to {off} mm, added to the distance kept", markup=False)
        if operations and boundary.path.is_plain:
            minimal_count, unreduced = over.operation_counts(boundary.name)
            out.print(f"  {minimal_count} operations; Eq. (5) without reduction has {unreduced}")


def _contact_text(boundary: Boundary) -> str:
    contact = boundary.contact
    if contact is None and boundary.contacts:
        strips = [f"{degrees(c.angle, 9)} +- {degrees(c.half_width or 0.0)}" for c in boundary.contacts]
        return f"contact at {boundary.contacts[0].text} = {' and '.join(strips)} deg, every turn"
    if contact is None:
        return "contact: a curve (more than one effective angle)"
    if contact.half_width is None:
        return f"never in contact: the norm is at least {millimetres(contact.smallest)} mm"
    if contact.is_stop:
        said = "declared" if boundary.stop else "found by its equal arms"
        text = f"contact at {contact.text} = {degrees(contact.angle, 9)} deg, every turn; a stop, {said}"
        return f"{text}: its arm lengths differ by {millimetres(contact.smallest, 6)} mm"
    width = f" +- {degrees(contact.half_width)}" if contact.half_width else ""
    text = f"contact at {contact.text} = {degrees(contact.angle, 9)}{width} deg, every turn"
    return (
        f"{text}; smallest norm {millimetres(contact.smallest, 6)} mm, threshold {millimetres(boundary.threshold)} mm"
    )


def _boundary_record(robot: Robot, name: str) -> dict[str, Any]:
    boundary = opened(robot).boundaries[name]
    contact = boundary.contact
    return {
        "name": boundary.name,
        "points": [boundary.point_a.name, boundary.point_b.name],
        "links": [boundary.point_a.link, boundary.point_b.link],
        "kind": boundary.kind.value,
        "ancestor": boundary.ancestor,
        "coordinates": robot.boundaries[name].coordinates,
        "solved_joints": robot.coupling.solved(formula_joints(boundary)),
        "threshold": boundary.threshold,
        "place_error": boundary.place_error,
        "contact_distance": boundary.contact_distance,
        "stop": boundary.is_stop,
        "stop_is_declared": boundary.stop,
        "expression": [str(component) for component in boundary.expression()],
        "expression_ancestor": [str(component) for component in boundary.expression("ancestor")],
        "latex": boundary.latex(),
        "contact": contact and _contact_record(contact),
        "contacts": [_contact_record(one) for one in boundary.contacts or ()],
    }


def _contact_record(contact: ContactAngle) -> dict[str, Any]:
    return {
        "effective_angle": contact.text,
        "coefficients": contact.coefficients,
        "angle": contact.angle,
        "half_width": contact.half_width,
        "smallest_norm": contact.smallest,
    }
