"""Hypothesis: random trees, annotations and configurations obey the laws, whatever the order of declaration."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pinbound as pb
from robots import joint, oracle_vectors, robot_xml

SETTINGS = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
DIRECTIONS = ["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 1 1", "1 2 -3"]
ANGLES = ["0", "1.5707963267948966", "3.141592653589793", "-0.7", "0.3"]
LENGTHS = ["0", "0.1", "-0.25", "0.4"]


@st.composite
def trees(draw: Any) -> str:
    """Draw 2 to 12 joints: every moving type, fixed ones, branches, chains of followers, shuffled declaration."""
    count = draw(st.integers(2, 12))
    links, moving, elements = ["base"], [], []
    for index in range(count):
        name, child = f"j{draw(st.integers(0, 99))}_{index}", f"l{index}"
        kind = draw(st.sampled_from(["revolute", "revolute", "continuous", "prismatic", "fixed"]))
        options = {
            "xyz": " ".join(draw(st.sampled_from(LENGTHS)) for _ in range(3)),
            "rpy": " ".join(draw(st.sampled_from(ANGLES)) for _ in range(3)),
            "axis": draw(st.sampled_from(DIRECTIONS)),
        }
        if kind != "fixed":
            if moving and draw(st.booleans()):
                multiplier = draw(st.sampled_from(["1", "-1", "2", "-0.5"]))
                offset = draw(st.sampled_from(["0", "0.3"]))
                options["mimic"] = f"{draw(st.sampled_from(moving))} {multiplier} {offset}"
            moving.append(name)
        elements.append(joint(name, kind, draw(st.sampled_from(links)), child, **options))
        links.append(child)
    points, pairs = {}, []
    for index in range(draw(st.integers(1, 4))):
        a, b = draw(st.lists(st.sampled_from(links), min_size=2, max_size=2, unique=True))
        for end, link in (("a", a), ("b", b)):
            points[f"{end}{index}"] = (link, " ".join(draw(st.sampled_from([*LENGTHS, "0.15"])) for _ in range(3)))
        pairs.append((f"a{index}", f"b{index}"))
    return robot_xml(draw(st.permutations(elements)), points, pairs)


def load_anyway(text: str, folder: Path) -> pb.Robot | None:
    """Return the robot, or None where a random home is in contact, which is a rightful refusal."""
    path = folder / "random.urdf"
    path.write_text(text)
    try:
        return pb.load(path, annotations=pb.Annotations(contact_tolerance=0.0))
    except pb.InputError as error:
        assert all("home is outside the feasible region" in problem.message for problem in error.problems), str(error)
        return None


@SETTINGS
@given(text=trees(), seed=st.integers(0, 2**32 - 1))
def test_random_trees_obey_the_laws(text: str, seed: int, tmp_path: Path) -> None:
    robot = load_anyway(text, tmp_path)
    if robot is None:
        return
    Q = np.random.default_rng(seed).uniform(-4, 4, (6, len(robot.coordinates)))
    expected = oracle_vectors(robot, Q)
    scale = max(1.0, float(np.abs(expected).max()))
    B = robot.boundaries
    assert np.abs(B.vectors(Q) - expected).max() < 1e-13 * scale
    norms = np.linalg.norm(expected, axis=2)
    assert np.abs(B.norms(Q) - norms).max() < 1e-13 * scale
    step = 1e-6
    for index, name in enumerate(robot.coordinates):
        h = step * np.eye(len(robot.coordinates))[index]
        difference = (B.norms(Q + h) - B.norms(Q - h)) / (2 * step)
        gradient = np.where(norms > 0.01, B.gradients(Q)[:, :, index] - difference, 0.0)
        assert np.abs(gradient).max() < 1e-6 * scale
        for column, boundary in enumerate(B):
            if name not in boundary.coordinates:
                assert np.abs(difference[:, column]).max() < 1e-9 * scale


@SETTINGS
@given(text=trees(), seed=st.integers(0, 2**32 - 1))
def test_limits_of_random_trees_are_contacts(text: str, seed: int, tmp_path: Path) -> None:
    robot = load_anyway(text, tmp_path)
    if robot is None:
        return
    q = np.random.default_rng(seed).uniform(-3, 3, len(robot.coordinates))
    for boundary in robot.boundaries:
        threshold = 0.8 * boundary.norm(q)
        wide = pb.Boundary(
            boundary.name, boundary.point_a, boundary.point_b, threshold, boundary.path, robot.coordinates, 0.0
        )
        for index, name in enumerate(robot.coordinates):
            try:
                arcs = wide.limits(name, q)
            except pb.UnsupportedError:
                continue
            assert arcs.contains(q[index])
            for end in arcs.intervals[np.isfinite(arcs.intervals)]:
                there = q.copy()
                there[index] = end
                assert wide.clearance(there) == pytest.approx(0.0, abs=1e-9)
