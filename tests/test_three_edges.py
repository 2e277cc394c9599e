"""Bodies of many edge vectors, said by three: the same separations, and the bound of what rounding moves."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pinbound as pb
from pinbound.bounds.three_edges import in_three_edges
from pinbound.path.chain import Chain, HullChain
from pinbound.path.relative import RelativePath
from robots import HEAD, joint

JOINTS = (
    joint("a", "revolute", "base", "l1", axis="0 0 1", xyz="0 0 0.3"),
    joint("b", "prismatic", "l1", "l2", axis="0 1 1", xyz="0.1 0 0.2", limit="-0.2 0.2"),
    joint("c", "revolute", "l2", "l3", axis="0 1 0", xyz="0.2 0 0.1"),
)


def value(chain: Chain, q: np.ndarray) -> np.ndarray:
    """Return `b_0 + R_1 (b_1 + R_2 (...))`, what slides among the b."""
    blocks = chain.offsets + chain.slides @ q
    found = blocks[-1]
    for block, axis, angle in zip(blocks[-2::-1], chain.axes[::-1], (chain.coefficients @ q)[::-1], strict=True):
        found = block + Rotation.from_rotvec(angle * axis).apply(found)
    return found


def vertices_of(path: RelativePath, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return w (3,) and the vertices of both bodies (k_a, 3), (k_b, 3) at q."""
    difference, n = path.difference, path.difference.corners[0].shape[1]
    edges = np.array([value(chain, q) for chain in difference.turned]).reshape(-1, 3)
    first, second = difference.corners
    return value(path.minimal, q), first @ edges[:n], second @ edges[n:]


def prism(name: str, link: str, sides: int) -> str:
    angles = np.pi * np.arange(sides) / sides
    edges = [[0.1 * float(np.cos(x)), 0.1 * float(np.sin(x)), 0.0] for x in angles] + [[0.02, 0.03, 0.3]]
    return f"- {{name: {name}, link: {link}, xyz: [0.5, 0.1, 0.1], ways: {edges}}}\n"


@pytest.fixture
def arm(load_text: Callable[..., pb.Robot]) -> pb.Robot:
    marks = f"sweeps:\n{prism('post', 'base', 5)}{prism('hand', 'l3', 8)}{prism('block', 'l2', 2)}"
    pairs = "".join(f"- {{name: {a}_{b}, a: {a}, b: {b}}}\n" for a, b in (("post", "hand"), ("post", "block")))
    floor = "planes: [{name: floor, link: base, xyz: [0, 0, -1], normal: [0, 0, 1]}]\n"
    return load_text(
        f'{HEAD}<link name="base"/>{"".join(JOINTS)}</robot>',
        f"{marks}{floor}home: {{a: 2}}\nboundaries:\n{pairs}- {{name: over, a: floor, b: hand}}\n",
    )


def test_all_vertices_are_where_they_were_up_to_what_is_said(arm: pb.Robot) -> None:
    rng = np.random.default_rng(0)
    for boundary in arm.boundaries:
        path, off = in_three_edges(boundary.path)
        assert 0.0 < off < 1e-12
        assert all(body.shape[1] <= 3 for body in path.difference.corners)
        for q in rng.uniform(-0.2, 0.2, (5, 3)):
            given, found = vertices_of(boundary.path, q), vertices_of(path, q)
            assert np.array_equal(given[0], found[0])
            moved = [np.linalg.norm(a - b, axis=1).max(initial=0.0) for a, b in zip(given[1:], found[1:], strict=True)]
            assert sum(moved) <= off


def test_few_edges_are_left_and_so_are_edges_of_no_rigid_body(arm: pb.Robot) -> None:
    block = arm.boundaries["post_block"].path
    rest = HullChain(block.minimal, block.difference.directions[-3:], (np.zeros((1, 0)), block.difference.corners[1]))
    few = dataclasses.replace(block, difference=rest)
    assert in_three_edges(few) == (few, 0.0)
    post = arm.boundaries["post_hand"].path
    bent = [edge.copy() for edge in post.difference.directions]
    bent[1] = np.roll(bent[1], 1, axis=0)  # turned by other rotations than the other edges of its body
    broken = dataclasses.replace(post, difference=HullChain(post.minimal, tuple(bent), post.difference.corners))
    assert in_three_edges(broken) == (broken, 0.0)
