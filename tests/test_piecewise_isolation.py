"""Articular limits of hulls: closed forms where there are any, dense sampling, and the same body written otherwise."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.limits import piecewise_isolation
from robots import ARM, HEAD, joint

Load = Callable[..., pb.Robot]

TURN = joint("q", "continuous", "base", "arm", axis="0 1 0")
CUBE = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]


def robot(load_text: Load, joints: list[str], marks: str, home: str = "") -> pb.Robot:
    text = f"{marks}\n{home}\nboundaries: [{{name: beta, a: A, b: B}}]\n"
    return load_text(f'{HEAD}<link name="base"/>{"".join(joints)}</robot>', text)


def hull(name: str, link: str, vertices: object) -> str:
    return f"- {{name: {name}, link: {link}, vertices: {vertices}}}\n"


def test_a_cube_that_turns_beside_a_wall_meets_it_at_its_corners(load_text: Load) -> None:
    """Its corners are sqrt(2) from the axis, the wall 1.2: contact at pi/4 +- acos((1.2 - tolerance) / sqrt(2))."""
    wall = [[1.2 + x, 5 * y, 5 * z] for x in (0, 1) for y in (-1, 1) for z in (-1, 1)]
    marks = "hulls:\n" + hull("A", "arm", [*CUBE, [0.2, 0, 0]]) + hull("B", "base", wall)
    boundary = robot(load_text, [TURN], marks, "home: {q: 1.5}").boundaries["beta"]
    half = np.arccos((1.2 - boundary.contact_distance) / np.sqrt(2))
    arcs = boundary.limits("q", [0.0])
    turns = np.array([[k * np.pi / 2 - np.pi / 4 + half, k * np.pi / 2 + np.pi / 4 - half] for k in range(4)])
    found = np.sort(np.mod(arcs.intervals + np.pi, 2 * np.pi), axis=0) - np.pi
    expected = np.sort(np.mod(turns + np.pi, 2 * np.pi), axis=0) - np.pi
    assert found == pytest.approx(expected, abs=1e-9)
    assert len(boundary.contacts or ()) == 4  # a strip for each corner


def test_the_limits_of_a_slide_are_where_a_hull_meets_another(load_text: Load) -> None:
    slide = joint("x", "prismatic", "base", "arm", axis="1 0 0", limit="-9 9")
    gem = [[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0.1], [0, 0, 0.5], [-0.25, 0, -0.5]]
    marks = "hulls:\n" + hull("A", "arm", CUBE) + hull("B", "base", gem)
    boundary = robot(load_text, [slide], marks, "home: {x: 5}").boundaries["beta"]
    keep = dataclasses.replace(boundary, min_distance=0.3)
    assert keep.limits("x", [5.0]).intervals == pytest.approx(np.array([[-np.inf, -1.55], [1.8, np.inf]]), abs=1e-12)


def test_a_plane_meets_the_lowest_of_a_hulls_vertices(load_text: Load) -> None:
    """Of a cube 1.2 above a plane: its corners reach down by sqrt(2) cos(pi/4 - q)."""
    marks = (
        "hulls:\n" + hull("A", "arm", CUBE) + "planes: [{name: B, link: base, xyz: [0, 0, -1.2], normal: [0, 0, 1]}]"
    )
    boundary = robot(load_text, [TURN], marks, "home: {q: 1.5}").boundaries["beta"]
    half = np.pi / 4 - np.arccos(1.2 / np.sqrt(2))
    arc = boundary.limits("q", [0.0])
    assert arc.contains(0.0)
    assert any(pair == pytest.approx([-half, half], abs=1e-9) for pair in arc.intervals)


@pytest.mark.parametrize("sort", ["box", "capsule", "cylinder", "flat", "line"])
def test_limits_agree_with_dense_sampling_on_both_sides_of_contact(load_text: Load, sort: str) -> None:
    rng = np.random.default_rng(["box", "capsule", "cylinder", "flat", "line"].index(sort))
    gem = (np.array([0.05, 0.02, 0.1]) + 0.12 * rng.normal(size=(14, 3))).round(4).tolist()
    other = {
        "box": "boxes: [{name: B, link: base, xyz: [0.3, 0.2, 0.5], rpy: [0.2, 0.1, 0.4], size: [0.2, 0.3, 0.2]}]",
        "capsule": "segments: [{name: B, link: base, xyz_a: [0.2, 0.3, 0.2], xyz_b: [0.1, 0.4, 0.9], radius: 0.02}]",
        "cylinder": "cylinders: [{name: B, link: base, xyz_a: [0.4, 0.3, 0.2], xyz_b: [0.3, 0.3, 0.8], radius: 0.1}]",
        "flat": "",
        "line": "lines: [{name: B, link: base, xyz: [0.4, 0.3, 0.2], direction: [0, 1, 1], radius: 0.05}]",
    }[sort]
    marks = "hulls:\n" + hull("A", "d", gem)
    if sort == "flat":
        marks += hull("B", "base", [[0.3, -0.3, 0.2], [0.3, 0.4, 0.3], [0.3, 0.2, 0.9], [0.3, -0.2, 0.6]])
    boundary = robot(load_text, ARM, f"{marks}{other}", "home: {j1: 2.5}").boundaries["beta"]
    asked = ends = 0
    for _ in range(3):
        q = rng.uniform(-1.5, 1.5, (1, 4))
        j = int(rng.integers(3))
        line = np.linspace(-3.1, 3.1, 101)
        Q = np.repeat(q, len(line), axis=0)
        Q[:, j] = line
        values = boundary.clearance(Q)
        grazing = float(max(values.min() + 1e-7, 0.0))  # what stays at contact to rounding along a stretch is contact
        for extra in (0.0, float(max(np.median(values), 0.0)), grazing):
            tried = dataclasses.replace(boundary, min_distance=extra)
            arcs = tried.limits(f"j{j + 1}", q, window=(-3.1, 3.1))[0]
            gaps = tried.signed_clearance(Q)
            for x, gap in zip(line, gaps, strict=True):
                if abs(gap) > 1e-11:
                    asked += 1
                    assert arcs.contains(float(x)) == (gap > 0.0)
            for end in arcs.intervals[np.isfinite(arcs.intervals) & (np.abs(arcs.intervals) < 3.09)]:
                at = q.copy()
                at[0, j] = end
                ends += 1
                assert abs(tried.signed_clearance(at)[0]) < (5e-11 if extra == grazing else 1e-12)
    assert asked > 700
    assert ends > 4


def test_a_box_written_as_a_hull_has_the_same_limits(load_text: Load) -> None:
    corners = [[x, y, z] for x in (0.1, 0.3) for y in (-0.1, 0.2) for z in (0.2, 0.5)]
    box = "boxes:\n- {name: A, link: d, xyz: [0.2, 0.05, 0.35], rpy: [0, 0, 0], size: [0.2, 0.3, 0.3]}\n"
    other = "boxes:\n- {name: B, link: base, xyz: [0.2, 0.3, 0.8], rpy: [0, 0, 0], size: [0.2, 0.3, 0.3]}\n"
    found: list[np.ndarray] = []
    for marks in (box + other.removeprefix("boxes:\n"), "hulls:\n" + hull("A", "d", corners) + other):
        boundary = robot(load_text, ARM, marks, "home: {j1: 2.5}").boundaries["beta"]
        keep = dataclasses.replace(boundary, min_distance=0.01)
        found.append(keep.limits("j1", [0.0, 0.4, -0.5, 0.2]).intervals)
    assert found[0].shape == found[1].shape
    assert found[0] == pytest.approx(found[1], abs=1e-10)


def test_where_hulls_overlap_is_contact_however_deep(load_text: Load) -> None:
    """A bar that turns through a block: contact from where its end comes in to where it goes out, nothing between."""
    bar = [[x, y, z] for x in (0, 3) for y in (-0.3, 0.2) for z in (-0.01, 0.01)]
    block = [[2 + x, y, z] for x in (0, 2) for y in (-1, 1) for z in (-1, 1)]
    marks = "hulls:\n" + hull("A", "arm", bar) + hull("B", "base", [*block, [3, 0, 1.2]])
    found = robot(load_text, [TURN], marks, "home: {q: 3}").boundaries["beta"].limits("q", [3.0])
    assert found.intervals.shape == (1, 2)
    assert found.intervals[0] == pytest.approx([-found.intervals[0, 1] + 2 * np.pi, found.intervals[0, 1]], abs=0.5)
    assert not found.contains(0.1)
    assert not found.contains(0.0)


def test_the_smallest_distance_of_hulls_that_overlap_is_zero_and_found_in_few_pieces(
    load_text: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    """GJK gives 1e-19 m, not zero, over a whole stretch of overlap: that stretch was halved to dust."""
    marks = "cylinders: [{name: A, link: base, xyz_a: [0.3, 0.02, -0.1], xyz_b: [0.31, 0.03, 0.1], radius: 0.08}]\n"
    marks += "boxes: [{name: B, link: arm, xyz: [0.31, 0.04, 0.02], rpy: [0.3, 0.2, 0.1], size: [0.1, 0.13, 0.17]}]"
    pieces: list[int] = []
    bound = piecewise_isolation._bound

    def counted(bundle: Any, Q: Any, index: int, middle: Any, half: float, error: float) -> Any:
        pieces.append(len(middle))
        return bound(bundle, Q, index, middle, half, error)

    monkeypatch.setattr(piecewise_isolation, "_bound", counted)
    rule = robot(load_text, [TURN], marks, "home: {q: 1.5}").boundaries["beta"].rule
    found = rule.strips()
    assert found is not None
    (strip,) = found[1]
    assert 0.0 <= strip.smallest < 1e-12
    assert piecewise_isolation.smallest(rule.path)[0] == 0.0
    assert max(pieces) <= 64
    pieces.clear()
    assert rule.strips() is found
    assert not pieces  # searched once
