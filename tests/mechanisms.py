"""Random mechanisms and the spatial robots that several test files and the campaigns share; not a test itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

AXES = {"planar": ["0 1 0"], "spatial": ["0 1 0", "0 0 1", "1 0 0", "0.6 0 0.8", "0.36 0.48 0.8"]}


def mechanism(rng: np.random.Generator, sort: str, joints: int, slides: bool = False, follower: bool = True) -> str:
    """Return a URDF of a chain with a branch at its first link; joints of one axis (planar) or of many."""
    rows = ['<robot name="random">', '<link name="base"/>']
    parent = "base"
    for index in range(joints):
        branch = follower and index == joints - 1 and joints > 2
        axis = rng.choice(AXES[sort])
        kind = "prismatic" if slides and index == 1 else "revolute"
        x, y, z = rng.uniform(-0.3, 0.3, 3) * ([1, 0, 1] if sort == "planar" else [1, 1, 1])
        rpy = "0 0 0" if sort == "planar" else " ".join(f"{angle:.6f}" for angle in rng.uniform(-1.5, 1.5, 3))
        if branch:
            parent = "l0"
        mimic = f'<mimic joint="j0" multiplier="{rng.choice([-1, 0.5, 2])}" offset="{rng.uniform(-1, 1):.3f}"/>'
        rows.append(
            f'<joint name="j{index}" type="{kind}"><parent link="{parent}"/><child link="l{index}"/>'
            f'<origin xyz="{x:.6f} {y:.6f} {z:.6f}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<limit lower="-9" upper="9" effort="1" velocity="1"/>{mimic if branch else ""}</joint>'
            f'<link name="l{index}"/>'
        )
        parent = f"l{index}"
    return "\n".join([*rows, "</robot>"])


def sidecar(points: list[tuple[str, str, np.ndarray, float]], pairs: list[tuple[str, str, float]], home: dict) -> str:
    """Return a YAML sidecar."""
    lines = ["points:"]
    for name, link, xyz, radius in points:
        numbers = ", ".join(repr(float(value)) for value in xyz)
        lines.append(f"- {{name: {name}, link: {link}, xyz: [{numbers}], radius: {float(radius)!r}}}")
    lines.append("boundaries:")
    for index, (a, b, distance) in enumerate(pairs):
        lines.append(f"- {{name: beta_{index}, a: {a}, b: {b}, min_distance: {float(distance)!r}}}")
    if home:
        lines.append("home: {" + ", ".join(f"{name}: {float(value)!r}" for name, value in home.items()) + "}")
    return "\n".join(lines) + "\n"


def write(folder: Path, urdf: str, annotations: str = "", name: str = "robot") -> Path:
    """Write a robot and its sidecar; return the URDF's path."""
    path = folder / f"{name}.urdf"
    path.write_text(urdf, encoding="utf-8")
    if annotations:
        (folder / f"{name}.pinbound.yaml").write_text(annotations, encoding="utf-8")
    return path


def random_robot(rng: np.random.Generator, folder: Path, sort: str, slides: bool, name: str = "robot"):
    """Return a random robot with random boundaries, radii from the clearances at home; None if home is in contact."""
    import pinbound as pb

    joints = int(rng.integers(2, 6))
    urdf = mechanism(rng, sort, joints, slides)
    links = ["base", *(f"l{i}" for i in range(joints))]
    points = []
    for index in range(6):
        xyz = rng.uniform(-0.25, 0.25, 3) * ([1, 0, 1] if sort == "planar" else [1, 1, 1])
        points.append((f"p{index}", str(links[int(rng.integers(len(links)))]), xyz, 0.0))
    pairs = []
    for _ in range(5):
        a, b = rng.choice(6, 2, replace=False)
        if points[a][1] != points[b][1]:
            pairs.append((f"p{a}", f"p{b}", 0.0))
    if not pairs:
        return None
    bare = pb.load(write(folder, urdf, sidecar(points, pairs, {}), name))
    norms = bare.boundaries.norms(bare.home)
    sized = [(a, b, float(norm * rng.uniform(0.1, 0.95))) for (a, b, _), norm in zip(pairs, norms, strict=True)]
    return pb.load(write(folder, urdf, sidecar(points, sized, {}), name))
