"""`reproduce_paper`: writes all figures, tables, errata and meshes to one folder, with a page that shows them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pinbound.figures.canvas import save
from pinbound.region.membership import Place
from pinbound.reproduce import path_figures, region_figures, tables
from pinbound.reproduce.equations import check_equations
from pinbound.reproduce.errata import find_errata
from pinbound.reproduce.findings import Equation, Erratum, Table
from pinbound.reproduce.formulas import limit_formula, membership_formulas, typeset
from pinbound.reproduce.four_kinds import write_four_kinds
from pinbound.reproduce.judged import judge_limits
from pinbound.reproduce.study import FACTOR, SAMPLES, SEED, Study
from pinbound.robot.robot import Robot

__all__ = ["FIGURES", "Reproduction", "reproduce_paper"]


@dataclass(frozen=True)
class Reproduction:
    """The files and results of a reproduction.

    Attributes:
        page: The HTML page.
        figures: The caption of each figure, by its number.
        tables: Tables 3-14, Eqs. (18)-(20), and the numbers shown in the figures.
        equations: Eqs. (5)-(17) as printed, compared with the derived norms.
        errata: The faults of the printed paper.
        files: All other files that were written.
        changes: One sentence for each difference between the robot and the paper's robot.
    """

    page: Path
    figures: dict[int, str]
    tables: tuple[Table, ...]
    equations: tuple[Equation, ...]
    errata: tuple[Erratum, ...]
    files: tuple[Path, ...]
    changes: tuple[str, ...] = ()


_WIDE = 1.5  # a figure with a larger ratio of width to height has two panels; on a narrow screen it scrolls

FIGURES: dict[int, tuple[Callable[[Study], Any], str]] = {
    8: (
        region_figures.figure_8,
        "Contacts of all ten boundaries. Each is a straight line, for each has one effective angle; dashed ones are "
        "implied by others. The region is the component that holds home: convex, a hexagon.",
    ),
    9: (
        region_figures.figure_9,
        "The feasible region with named edges, and its image under forward kinematics: where the tool point may be.",
    ),
    10: (region_figures.figure_10, f"Region and scaled region (factor {FACTOR:g}, not printed in the paper)."),
    11: (
        region_figures.figure_11,
        "The scaled section turned about q1, every 15 degrees, and the paths of its corners.",
    ),
    12: (region_figures.figure_12, "The body that the tool point sweeps, with the robot at home."),
    13: (
        path_figures.figure_13,
        "Norms of the first four boundaries along the contour of the region and the scaled one.",
    ),
    14: (path_figures.figure_14, "The next four. beta_6 dips along the edge beta_3, less so on the scaled contour."),
    15: (path_figures.figure_15, "The last two."),
    16: (
        region_figures.figure_16,
        f"{SAMPLES:,} random configurations in [-2 pi, 2 pi]^2, seed {SEED}: sum of the ten norms, each over its "
        "largest value, interpolated on a grid. The sum is low in the region, not high: a sum of norms does not "
        "measure clearance.",
    ),
    17: (region_figures.figure_17, "The same from above. The valleys repeat every turn; only one of them holds home."),
    18: (
        path_figures.figure_18,
        "A tool path of our own, defined in space, that leaves the region on purpose: in the swept volume, and from "
        "the side with the azimuth taken out.",
    ),
    19: (path_figures.figure_19, "The path from above, and close by."),
    20: (path_figures.figure_20, "The joints along the path, by damped least squares within the joint limits."),
    21: (
        path_figures.figure_21,
        "Its points classified against the scaled region, exactly: inside, on the contour (within 1e-9 rad), outside; "
        "and in the prism over q1.",
    ),
    22: (
        path_figures.figure_22,
        "Membership.{unseen} The signed distance (black) is negative wherever the path is outside. Dotted: what the "
        "print's third line gives.",
    ),
}
"""Figure number: how to draw it, and its caption."""


def reproduce_paper(robot: Robot, out: Path, progress: Callable[[str], None] | None = None) -> Reproduction:
    """Compute Tables 3 to 14 and Figs. 8 to 22 of the paper again, and write them, with the errata, to a folder.

    Args:
        robot: `minervabot_v3`, or a copy of it with the paper's names.
        out: The folder; it is made if it does not exist. Files of the same names are replaced; others are kept.
        progress: Called with a line of text before each step that takes time.

    Returns:
        The files and results. `index.html` shows all of them; `results.json` has the numbers.

    Raises:
        UnsupportedError: If the robot is not the paper's.
    """
    study, say = Study(robot), progress or _quiet
    out.mkdir(parents=True, exist_ok=True)
    say("tables and errata")
    judged = judge_limits(robot, study.constants, float(study.region.centroid[1]))
    found_tables = (
        *tables.geometry_tables(study),
        *tables.boundary_tables(study),
        tables.limits_table(judged),
        tables.region_table(study),
        tables.workspace_table(study),
        tables.norms_table(study),
    )
    equations = check_equations(study, write_four_kinds(out))
    errata = find_errata(study, judged)
    files, wide = [out / "four_kinds.urdf"], set[int]()
    for number, (draw, _) in FIGURES.items():
        say(f"figure {number}")
        figure = draw(study)
        figure.draw_without_rendering()  # axes of equal scales get their final layout only in the second pass
        files += save(figure, out / f"figure_{number:02d}")
        width, height = figure.get_size_inches()
        if width > _WIDE * height:
            wide.add(number)
    say("meshes and polygons")
    files += [study.body.export(out / f"swept_body{suffix}") for suffix in (".ply", ".stl")]
    files += [
        study.section.export(out / "section.geojson"),
        study.scaled_section.export(out / "section_scaled.geojson"),
    ]
    files += [
        _write_path(study, out / "tool_path.csv"),
        _write_results(out / "results.json", found_tables, equations, errata),
    ]
    captions = {number: caption for number, (_, caption) in FIGURES.items()}
    captions[22] = captions[22].format(unseen=_unseen(study))
    page = out / "index.html"
    result = Reproduction(page, captions, found_tables, equations, errata, tuple(files), study.changes)
    page.write_text(_render(study, result, wide), encoding="utf-8")
    return result


def _unseen(study: Study) -> str:
    """Return as text where the path is outside the scaled region although every mu is positive."""
    found = study.path.membership
    share = study.path.share[np.all(found.mu > 0.0, axis=1) & (study.path.place == Place.OUTSIDE)]
    if not len(share):
        return ""
    return (
        f" Within {share[0]:.3f} to {share[-1]:.3f} of the path {len(share)} points are outside with every mu positive."
    )


def _quiet(_: str) -> None:
    """Ignore a progress message."""


def _write_path(study: Study, target: Path) -> Path:
    """Write the tool path and its membership, in metres and radians."""
    path, found = study.path, study.path.membership
    columns = [path.share, *path.targets.T, *path.solution.q.T, *found.mu.T, *found.mu_printed.T, found.signed_distance]
    names = [f"q{i + 1}" for i in range(len(found.coordinates))]
    heads = ["share", "x", "y", "z", *found.coordinates, *(f"mu_{name}" for name in names)]
    heads += [*(f"mu_{name}_printed" for name in names), "signed_distance", "place"]
    data = np.column_stack((*columns, path.place))
    np.savetxt(target, data, delimiter=",", header=",".join(heads), comments="", fmt="%.12g")
    return target


def _write_results(
    target: Path, found_tables: tuple[Table, ...], equations: tuple[Equation, ...], errata: tuple[Erratum, ...]
) -> Path:
    record = {
        "tables": [{key: value for key, value in asdict(one).items() if key != "formulas"} for one in found_tables],
        "equations": [asdict(one) for one in equations],
        "errata": [asdict(one) for one in errata],
    }
    target.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return target


def _render(study: Study, result: Reproduction, wide: set[int]) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pinbound"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["pretty"] = typeset
    inverted = (("beta_1", "q2"), ("beta_2", "q2"), ("beta_4", "q2"), ("beta_7", "q2"), ("beta_8", "q2"))
    inverted += (("beta_10", "q2"), ("beta_3", "q3"), ("beta_9", "q3"))
    return environment.get_template("reproduce.html.j2").render(
        robot=study.robot,
        study=study,
        result=result,
        wide=wide,
        tables={one.label: one for one in result.tables},
        boundary_tables=[one for one in result.tables if one.title.startswith("Boundary")],
        limits=[(name, limit_formula(study.robot.boundaries[name], joint)) for name, joint in inverted],
        membership=membership_formulas(),
        factor=FACTOR,
    )
