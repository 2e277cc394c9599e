"""Tables 3-14 and Eqs. (18)-(20), computed again from the URDF, and the numbers shown in the figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinbound.evaluate import symbolic
from pinbound.reproduce.equations import relative_frame
from pinbound.reproduce.findings import Table
from pinbound.reproduce.judged import JudgedLimit
from pinbound.reproduce.printed import BOUNDARIES, CONSTANTS, OFFSETS, RECURSION, PrintedBoundary
from pinbound.reproduce.study import FACTOR, PLANE, SEED, TOOL, Study
from pinbound.tolerances import SOLVES
from pinbound.typing import Array, Flags

__all__ = ["boundary_tables", "geometry_tables", "limits_table", "norms_table", "region_table", "workspace_table"]

_COUNT = 2000
_MONTE_CARLO = 400_000


def _mm(length: float, digits: int = 3) -> str:
    return f"{1e3 * length:.{digits}f}"


def _deg(angle: float, digits: int = 6) -> str:
    return "none" if np.isnan(angle) else f"{round(float(np.degrees(angle)), digits) + 0.0:.{digits}f}"


def geometry_tables(study: Study) -> tuple[Table, ...]:
    """Return Tables 3 and 4."""
    robot, zero = study.robot, np.zeros((1, len(study.robot.coordinates)))
    rows, worst = list[tuple[str, ...]](), 0.0
    for parameter, symbol, parent, child, axis, printed in OFFSETS:
        derived = float(relative_frame(robot, parent, child, zero)[0][0, axis])
        worst = max(worst, abs(derived - 1e-3 * printed))
        rows.append((parameter, symbol, f"{printed:g}", f"{1e3 * derived:g}"))
    agrees = worst <= SOLVES
    verdict = "as printed" if agrees else f"differs by up to {_mm(worst)} mm"
    offsets = Table(
        "Table 3",
        "Geometric offsets",
        ("parameter", "symbol", "printed [mm]", "URDF [mm]"),
        tuple(rows),
        verdict,
        agrees,
    )
    return offsets, _recursion_table(study)


def _recursion_table(study: Study) -> Table:
    """Return Table 4: compare each offset and rotation, and the recursion from the base, with the URDF's frames."""
    robot = study.robot
    Q = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (_COUNT, len(robot.coordinates)))
    columns = [robot.coordinates.index(name) for name in ("q1", "q2", "q3")]
    position, rotation = np.zeros((_COUNT, 3)), np.broadcast_to(np.eye(3), (_COUNT, 3, 3))
    rows, worst = list[tuple[str, ...]](), 0.0
    for parent, child, offset, text, coefficients in RECURSION:
        r, R = relative_frame(robot, parent, child, Q)
        printed = _turn(Q[:, columns] @ np.array(coefficients, dtype=np.float64), about_z=child == "link_1")
        apart = float(np.max(np.abs(r - 1e-3 * np.array(offset))))
        turned = float(np.max(np.abs(R - printed)))
        position = position + 1e-3 * np.einsum("nij,j->ni", rotation, np.array(offset))
        rotation = rotation @ printed
        drift = float(np.max(np.abs(position - robot.positions(child, Q))))
        worst = max(worst, apart, turned, drift)
        number = int(child.removeprefix("link_"))
        place = f"({', '.join(f'{value:g}' for value in offset)})"
        rows.append((f"r_{number - 1},{number}", place, text, f"{apart:.0e}", f"{turned:.0e}", f"{drift:.0e}"))
    agrees = worst <= SOLVES
    headings = (
        "vector",
        "printed (x, y, z) [mm]",
        "rotation",
        "offset differs [m]",
        "rotation differs",
        "r_0,k differs [m]",
    )
    title = f"Recursive position vectors, over {_COUNT:,} random configurations"
    return Table("Table 4", title, headings, tuple(rows), "as printed" if agrees else "differs", agrees)


def _turn(angle: Array, about_z: bool) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    matrices = np.broadcast_to(np.eye(3), (len(angle), 3, 3)).copy()
    i, j = (0, 1) if about_z else (2, 0)
    matrices[:, i, i] = matrices[:, j, j] = cos
    matrices[:, i, j], matrices[:, j, i] = -sin, sin
    return matrices


_ERRATA = {5: 2, 6: 2, 8: 3}


def boundary_tables(study: Study) -> tuple[Table, ...]:
    """Return Tables 5-14."""
    return tuple(_boundary_table(study, printed) for printed in BOUNDARIES)


def _boundary_table(study: Study, printed: PrintedBoundary) -> Table:
    robot, boundary = study.robot, study.robot.boundaries[printed.name]
    Q = np.random.default_rng(SEED).uniform(-2 * np.pi, 2 * np.pi, (_COUNT, len(robot.coordinates)))
    q2, q3 = (Q[:, robot.coordinates.index(name)] for name in PLANE)
    components = 1e-3 * np.column_stack(printed.components(study.constants, q2, q3))
    apart = float(np.max(np.abs(components - boundary.vector(Q)[:, [0, 2]])))
    rows, points_agree = list[tuple[str, ...]](), True
    for (frame, point), mark in zip(printed.points, (boundary.point_a, boundary.point_b), strict=True):
        x, z = (CONSTANTS[f"{axis}_{frame},{point}"] for axis in "xz")
        place: list[float] = mark.shape.origin.tolist()
        points_agree &= abs(1e-3 * x - place[0]) <= SOLVES and abs(1e-3 * z - place[2]) <= SOLVES
        points_agree &= mark.link == f"link_{frame}"
        urdf = f"({1e3 * place[0]:g}, {1e3 * place[2]:g}) in {mark.link}"
        rows.append((f"o_{point} (x, z) [mm]", f"({x:g}, {z:g}) in frame {frame}", urdf))
    kind_agrees = boundary.kind.value == printed.kind
    rows.append(("kind", printed.kind, f"{boundary.kind.value}, from {boundary.ancestor}"))
    rows.append(("norm", printed.norm, f"depends on {', '.join(boundary.coordinates)}"))
    rows.append(("largest difference of the components", "0", f"{1e3 * apart:.1e} mm over {_COUNT:,} configurations"))
    contact = boundary.contact
    if contact is not None:
        angle = f"{contact.text} = {_deg(contact.angle, 9)} deg, smallest norm {_mm(contact.smallest, 4)} mm"
        rows.append(("contact", "not printed", angle))
    if printed.number == 10:
        rows.append(("r_1,27 (x, z) [mm]", "not printed", f"({study.pivot[0]:g}, {study.pivot[1]:g}), assumed"))
    agrees = apart <= SOLVES and points_agree and kind_agrees and printed.number not in _ERRATA
    erratum = _ERRATA.get(printed.number)
    verdict = "as printed" if agrees else f"see erratum {erratum}" if erratum else "differs"
    return Table(
        f"Table {printed.table}",
        f"Boundary beta_{printed.number}",
        ("", "printed", "URDF"),
        tuple(rows),
        verdict,
        agrees,
        symbolic.mathml(boundary.expression("ancestor")),
    )


def limits_table(judged: Sequence[JudgedLimit]) -> Table:
    """Return Eqs. (18)-(20): the sixteen printed limits, checked one by one."""
    rows = list[tuple[str, ...]]()
    for one in judged:
        limit = one.limit
        if one.solves:
            verdict = "right"
        else:
            verdict = (
                f"wrong: offset {_pi(limit.half_turns)} should be {'?' if one.mended is None else _pi(one.mended)}"
            )
        rows.append(
            (
                f"({limit.equation}) line {limit.line}",
                f"beta_{limit.boundary},{limit.component}",
                limit.joint,
                _deg(one.values[0], 4),
                _deg(one.values[1], 4),
                f"{1e3 * one.residual:.1e}",
                f"{1e3 * one.residual_one_argument:.1e}",
                _deg(one.derived, 6),
                one.branch,
                _deg(one.difference, 4),
                verdict,
            )
        )
    right, one_argument = sum(j.solves for j in judged), sum(not j.solves_with_one_argument for j in judged)
    at = _deg(judged[0].other, 3)
    return Table(
        "Eqs. (18)-(20)",
        f"The sixteen printed limits, the other joint at {at} degrees",
        (
            "line",
            "component",
            "joint",
            "printed + [deg]",
            "printed - [deg]",
            "residual, atan2 [mm]",
            "residual, one argument [mm]",
            "contact [deg]",
            "branch",
            "branch less contact [deg]",
            "verdict",
        ),
        tuple(rows),
        f"{right} of {len(judged)} solve their component equation with atan2; {one_argument} fail with a one-argument "
        "arctangent",
        right == len(judged),
    )


def _pi(half_turns: int) -> str:
    return {0: "0", 1: "pi"}.get(half_turns, f"{half_turns} pi")


def region_table(study: Study) -> Table:
    """Return the vertices of the region, with the two boundaries that meet at each."""
    region, scaled = study.region, study.scaled
    names = [edge.name for edge in region.edges]
    rows = [
        (f"{names[i - 1]}, {names[i]}", *(_deg(float(v), 9) for v in vertex), *(_deg(float(v), 6) for v in shrunk))
        for i, (vertex, shrunk) in enumerate(zip(region.vertices, scaled.vertices, strict=True))
    ]
    centre = ", ".join(_deg(float(value), 9) for value in region.centroid)
    return Table(
        "Figs. 8-10",
        f"Vertices of the region, and scaled by {FACTOR:g} about the centroid",
        ("edges that meet", "q2 [deg]", "q3 [deg]", "q2 scaled [deg]", "q3 scaled [deg]"),
        tuple(rows),
        f"area {region.area:.10f} rad^2, centroid ({centre}) degrees",
        True,
    )


def workspace_table(study: Study) -> Table:
    """Return area and volume with their error bounds, and a Monte Carlo estimate of each."""
    rows, agrees = list[tuple[str, ...]](), True
    for label, region, section, body in (
        ("region", study.region, study.section, study.body),
        ("scaled region", study.scaled, study.scaled_section, study.scaled_body),
    ):
        low, high = region.vertices.min(axis=0), region.vertices.max(axis=0)
        X = np.random.default_rng(SEED).uniform(low, high, (_MONTE_CARLO, 2))
        inside: Flags = np.asarray(region.contains(study.configurations(X)))
        size = float((high[0] - low[0]) * (high[1] - low[1]))
        weight = size * np.abs(section.map.determinant(X)) * inside
        for what, unit, scale, exact, draws in (
            ("section", "mm^2", 1e6, section.area, weight),
            ("swept volume", "mm^3", 1e9, body.volume, body.angle * weight * section.image(X)[:, 0]),
        ):
            mean, spread = float(np.mean(draws)), float(np.std(draws) / np.sqrt(_MONTE_CARLO))
            agrees &= abs(mean - exact.value) <= 4.0 * spread
            rows.append(
                (
                    f"{what} of the {label} [{unit}]",
                    f"{scale * exact.value:.6f}",
                    f"{scale * exact.error:.0e}",
                    f"{scale * mean:.1f} +- {scale * spread:.1f}",
                )
            )
    verdict = f"{study.section.area.method}; the Jacobian keeps one sign over the region (|det| > "
    verdict += f"{1e6 * study.section.folds.margin:.0f} mm^2/rad^2, proven), so no place is counted twice"
    title = f"Where {TOOL} may be; q1 within {_deg(study.body.lower, 0)} to {_deg(study.body.upper, 0)} degrees"
    headings = ("", "value", "error", f"Monte Carlo, {_MONTE_CARLO:,} samples")
    return Table("Figs. 9-12", title, headings, tuple(rows), verdict, agrees)


def norms_table(study: Study) -> Table:
    """Return the smallest norms along the contours of the region and of the scaled region."""
    rows, grows = list[tuple[str, ...]](), True
    smallest = [
        study.robot.boundaries.norms(study.configurations(study.contour(region, 2000)[1])).min(axis=0)
        for region in (study.region, study.scaled)
    ]
    for name, whole, scaled in zip(study.robot.boundaries.names, *smallest, strict=True):
        grows &= bool(scaled > whole)
        rows.append((name, _mm(whole, 4), _mm(scaled, 4)))
    verdict = "every smallest norm grows when the region is scaled" if grows else "not every norm grows"
    headings = ("boundary", "smallest norm, region [mm]", "smallest norm, scaled [mm]")
    return Table("Figs. 13-15", "Norms along the contours", headings, tuple(rows), verdict, grows)
