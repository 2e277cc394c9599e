"""Projections against regions, witnesses against clearances, and cells proven out against many samples."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import pinbound as pb
from pinbound.figures.free_figure import draw_free
from test_polytope import CAPSULES, POST, load


def check(robot: pb.Robot, found: pb.FreeProjection, samples: int) -> None:
    """All of a cell that is in is free with its witness; of a cell that is out nothing is, whatever the others are."""
    rng, axes = np.random.default_rng(0), [robot.coordinates.index(name) for name in found.coordinates]
    free = robot.boundaries.free
    for cells, witnesses in ((found.inside, found.witnesses), (found.outside, None)):
        rows = rng.integers(0, len(cells), samples)
        Q = rng.uniform(robot.lower, robot.upper, (samples, len(robot.coordinates)))
        if witnesses is not None:
            Q = witnesses[rows].copy()
        Q[:, axes] = cells[rows, 0] + rng.uniform(size=(samples, 2)) * (cells[rows, 1] - cells[rows, 0])
        assert np.all(free(Q) == (witnesses is not None))
    parts = [np.prod(one[:, 1] - one[:, 0], axis=1).sum() for one in (found.inside, found.outside, found.open)]
    assert sum(parts) == pytest.approx(np.prod(found.box[1] - found.box[0]), rel=1e-9)


def test_a_region_projects_to_its_extent() -> None:
    robot = pb.load("minervabot_v3")
    found = pb.free_projection(robot, ("q1", "q3"), decided=0.98, budget=pb.Budget(10**9, 120.0))
    vertices = pb.feasible_region(robot).vertices
    low, high = found.areas
    assert low < (robot.upper[0] - robot.lower[0]) * np.ptp(vertices[:, 1]) < high
    assert found.decided >= 0.98
    check(robot, found, 3000)


def test_a_slice_is_the_projection_of_two_coordinates(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    found = pb.free_projection(robot, ("q1", "q2"), decided=0.95, budget=pb.Budget(10**9, 120.0))
    check(robot, found, 3000)
    volume = pb.free_volume(robot, ("q1", "q2"), decided=0.95, budget=pb.Budget(10**9, 120.0))
    assert found.areas[0] <= volume.upper
    assert found.areas[1] >= volume.lower
    for one in (found, volume):
        figure = draw_free(robot, one)
        sizes = [len(part.get_paths()) for part in figure.axes[0].collections if isinstance(part, PolyCollection)]
        assert sizes == [len(one.inside if one is found else one.free), len(one.open)]
        title = " ".join(figure.axes[0].get_title().split())
        assert title.startswith(f"{robot.name}. ")
        assert title.endswith(str(one.coverage))  # what was not looked at is said with every answer
        assert repr(one).endswith(f"proven; {one.coverage}>")


def test_a_spatial_robot(tmp_path: Path) -> None:
    robot = load(CAPSULES, tmp_path)
    found = pb.free_projection(robot, ("j2", "j3"), decided=0.6, budget=pb.Budget(boxes=400_000, seconds=120.0))
    assert found.decided > 0.3
    assert len(found.inside)
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(found.inside), 2000)
    Q = found.witnesses[rows].copy()
    Q[:, [1, 2]] = found.inside[rows, 0] + rng.uniform(size=(2000, 2)) * (found.inside[rows, 1] - found.inside[rows, 0])
    assert np.all(robot.boundaries.free(Q))
    with pytest.raises(pb.UnsupportedError, match="give two of"):
        pb.free_projection(robot, ("j1", "j2", "j3"))


def test_a_volume_of_three_coordinates_is_drawn(tmp_path: Path) -> None:
    robot = load(CAPSULES, tmp_path)
    found = pb.free_volume(robot, ("j2", "j3", "j4"), decided=0.5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pinbound.figures.free_figure._VOXELS", 6)
        figure = draw_free(robot, found)
    axes = figure.axes[0]
    assert axes.get_zlabel() == "j4 [deg]"
    assert axes.get_title().startswith(f"{robot.name}. Slice: j1 = 0.0 deg\n")
    (squares,) = axes.collections  # one for all voxels: one for each voxel would take minutes to draw
    middles = [0.5 * (one[1:] + one[:-1]) for one in (np.linspace(*found.box[:, axis], 7) for axis in range(3))]
    points = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)[..., None, :]
    drawn = ~np.any(np.all((found.free[:, 0] <= points) & (points <= found.free[:, 1]), axis=-1), axis=-1)
    padded = np.pad(drawn, 1).astype(int)
    assert len(squares.get_facecolor()) == sum(int(np.abs(np.diff(padded, axis=axis)).sum()) for axis in range(3)) > 0
    four = pb.free_volume(robot, robot.coordinates, decided=0.01)
    with pytest.raises(pb.UnsupportedError, match="hold some"):
        draw_free(robot, four)
