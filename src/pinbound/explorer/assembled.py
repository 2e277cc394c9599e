"""explorer_page(): the page as one string, made from the data of a robot and the files in `page/`."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import one_configuration
from pinbound.certificates import Budget, Verdict, certify
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.explorer.planes import chosen_planes
from pinbound.explorer.record import motion_record, page_record
from pinbound.extras import Needs
from pinbound.motion.history import Motion
from pinbound.robot.robot import Robot
from pinbound.tolerances import EXPLORER_BUDGET, REGION_WIDTH

__all__ = ["ExplorerPage", "explorer_page"]

SCRIPTS = (
    *("loops.js", "interpreter.js", "nearest.js", "limits.js", "plane.js"),
    *("solids.js", "pen_gl.js", "pen_soft.js", "scene.js", "app.js"),
)
"""Files of `page/`; each file needs only the files before it."""


@dataclass(frozen=True)
class ExplorerPage:
    """A page of HTML that needs no other file and no network.

    Attributes:
        text: The page.
        data: The JSON data in the page.
        planes: The slices whose regions are on the page.
        notes: One sentence for each thing that the page cannot show.
        verdict: The verdict about the motion; None without a motion.

    Example:
        >>> import pinbound as pb
        >>> page = pb.explorer_page(pb.load("minervabot_v3"), motion=np.radians([[0, 0, 0], [0, 20, 10]]))
        >>> page.verdict.value, page.planes
        ('certified', (('q2', 'q3'),))
    """

    text: str
    data: str
    planes: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    verdict: Verdict | None = None

    def __repr__(self) -> str:
        """Return the size and the planes as text."""
        planes = "; ".join(", ".join(plane) for plane in self.planes) or "none"
        return f"<ExplorerPage: {self.size / 1e6:.2f} MB; planes {planes}>"

    @property
    def size(self) -> int:
        """The size of the file [bytes]."""
        return len(self.text.encode("utf-8"))

    def save(self, path: str | Path) -> Path:
        """Write the page to a file; an existing file is replaced."""
        target = Path(path)
        target.write_text(self.text, encoding="utf-8")
        return target

    def _repr_html_(self) -> str:
        """Return the page in a frame, for notebooks."""
        source = html.escape(self.text, quote=True)
        return f'<iframe srcdoc="{source}" style="width: 100%; height: 46rem; border: 0" title="explorer"></iframe>'


def explorer_page(
    robot: Robot,
    planes: Sequence[Sequence[str]] | None = None,
    at: ArrayLike | None = None,
    motion: Motion | ArrayLike | None = None,
    *,
    window: Mapping[str, tuple[float, float]] | None = None,
    meshes: bool = False,
    budget: float = EXPLORER_BUDGET,
    width: float = REGION_WIDTH,
    motion_name: str = "motion",
) -> ExplorerPage:
    """Return a page in which a user drags through a region and sees the robot move: one file, which works offline.

    The page computes signed clearances, gradients and link positions itself, from the same reduced paths as Python; its
    numbers equal Python's to 1e-12. Regions are those of `feasible_region`. If a region cannot be computed, or a slider
    leaves the values for which it was computed, the page samples a grid and says so.

    Args:
        robot: The robot.
        planes: Pairs of coordinates for which regions are computed; None: the two that most boundaries depend on.
        at: (n,) the values of the other coordinates, at which the page starts [rad or m]; home by default.
        motion: A motion to play, straight in q between its rows (N, n) [rad or m]; it is certified.
        window: Ends [rad or m] of coordinates without limits, by name.
        meshes: Whether to draw bodies that are meshes; then the page is as large as the meshes.
        budget: [s] for each region, after which the page samples instead.
        width: The longest side of the cells around curved edges, as in `feasible_region`.
        motion_name: The name of the motion on the page.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        DimensionError: If an entry of `planes` has not two coordinates, or if `at`, the motion or the window does not
            fit.
        UnsupportedError: If the robot has no coordinate.

    Example:
        >>> import pinbound as pb
        >>> page = pb.explorer_page(pb.load("minervabot_v3"))
        >>> page.planes, page.size < 500_000, page.text[:15]
        ((('q2', 'q3'),), True, '<!DOCTYPE html>')
    """
    if not robot.coordinates:
        raise UnsupportedError(f"{robot.name!r} has no coordinate; give a robot with a joint that moves")
    start = np.array(robot.home if at is None else one_configuration(at, robot.coordinates), dtype=np.float64)
    if not np.all(np.isfinite(start)):
        raise DimensionError("at holds a number that is not finite; give finite numbers")
    chosen = chosen_planes(robot, planes)
    record = page_record(robot, chosen, start, dict(window or {}), meshes, budget, width)
    record["motion"], verdict = None, None
    if motion is not None:
        moved = motion if isinstance(motion, Motion) else Motion(np.asarray(motion, dtype=np.float64), None)
        found = certify(robot, moved.waypoints, moved.times, budget=Budget(seconds=budget))
        record["motion"], verdict = motion_record(robot, moved, found, motion_name), found.verdict
    data = json.dumps(record, allow_nan=False, separators=(",", ":"))
    notes = [*record["notes"], *(region["error"] for region in record["regions"] if "error" in region)]
    return ExplorerPage(_rendered(robot.name, data), data, tuple(chosen), tuple(notes), verdict)


def _rendered(name: str, data: str) -> str:
    """Return the page. Names are written as data; `<` is escaped, so that no name can end the script element."""
    with Needs("report", "the explorer's page"):
        import jinja2

    folder = resources.files("pinbound.explorer") / "page"
    parts = {name: (folder / name).read_text(encoding="utf-8") for name in ("style.css", *SCRIPTS)}
    template: Any = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
        (folder / "explorer.html.j2").read_text(encoding="utf-8")
    )
    return template.render(
        name=name,
        style=parts["style.css"],
        scripts="\n".join(parts[script] for script in SCRIPTS),
        data=data.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"),
    )
