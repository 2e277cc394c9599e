"""MinervaBotV3 against the paper: Eq. (17), Tables 5-14, contact angles, hexagon (values re-derived by hand)."""

import numpy as np
import pytest
import sympy as sp

import pinbound as pb
from robots import oracle_vectors

q2, q3 = sp.symbols("q2 q3", real=True)


def mm(text: str) -> sp.Rational:
    return sp.Rational(text) / 1000


x = {k: mm(v) for k, v in {
    (2, 7): "9.69", (3, 8): "27.00", (2, 9): "-10.03", (3, 10): "-36.45", (3, 11): "74.29", (4, 12): "5.47",
    (3, 4): "93.97", (2, 14): "-13.44", (13, 15): "-27.76", (3, 17): "20.31", (16, 18): "16.90", (3, 20): "-19.88",
    (16, 21): "5.46", (2, 3): "0", (21, 22): "93.97", (2, 23): "-26.50", (3, 24): "-37.59", (1, 25): "-39.19",
    (13, 26): "-39.21", (1, 13): "0", (1, 28): "-68.52", (1, 27): "-37.59", (27, 29): "-33.38",
}.items()}  # fmt: skip
z = {k: mm(v) for k, v in {
    (2, 7): "68.27", (3, 8): "-19.27", (2, 9): "64.85", (3, 10): "2.74", (3, 11): "-20.78", (4, 12): "23.19",
    (3, 4): "-34.20", (2, 14): "30.61", (13, 15): "18.63", (3, 17): "3.04", (16, 18): "11.66", (3, 20): "12.56",
    (16, 21): "22.87", (2, 3): "100", (21, 22): "34.20", (2, 23): "70.04", (3, 24): "13.68", (1, 25): "69.00",
    (13, 26): "2.80", (1, 13): "72", (1, 28): "85.68", (1, 27): "102.35", (27, 29): "-10.96",
}.items()}  # fmt: skip

c, s, d = sp.cos, sp.sin, q2 - q3


def elbow(p: tuple[int, int], t: tuple[int, int]) -> tuple[sp.Expr, sp.Expr]:
    """beta_1, beta_2, beta_8: point p of frame 2, t of frame 3."""
    return (
        x[p] - x[2, 3] - x[t] * c(d) + z[t] * s(d),
        z[p] - z[2, 3] - z[t] * c(d) - x[t] * s(d),
    )


def bridge(p: tuple[int, int], t: tuple[int, int]) -> tuple[sp.Expr, sp.Expr]:
    """beta_5, beta_6 as printed: R_2,16 = R_y(q3)."""
    return (
        x[p] * c(d) - x[t] * c(q3) - z[t] * s(q3) - z[p] * s(d),
        x[t] * s(q3) - z[t] * c(q3) + z[p] * c(d) + x[p] * s(d),
    )


EQUATION_17 = {
    "beta_1": elbow((2, 7), (3, 8)),
    "beta_2": elbow((2, 9), (3, 10)),
    "beta_3": (
        x[3, 11] - x[3, 4] - x[4, 12] * c(q3) + z[4, 12] * s(q3),
        z[3, 11] - z[3, 4] - z[4, 12] * c(q3) - x[4, 12] * s(q3),
    ),
    "beta_4": (
        x[2, 14] * c(q2) - x[13, 15] * c(q3) - z[13, 15] * s(q3) + z[2, 14] * s(q2),
        z[2, 14] * c(q2) - z[13, 15] * c(q3) + x[13, 15] * s(q3) - x[2, 14] * s(q2),
    ),
    "beta_5": bridge((3, 17), (16, 18)),
    "beta_6": bridge((3, 20), (16, 21)),
    "beta_7": (
        x[2, 3] * c(q2) - x[21, 22] + z[2, 3] * s(q2),
        z[2, 3] * c(q2) - z[21, 22] - x[2, 3] * s(q2),
    ),
    "beta_8": elbow((2, 23), (3, 24)),
    "beta_9": (
        x[1, 25] - x[1, 13] - x[13, 26] * c(q3) - z[13, 26] * s(q3),
        z[1, 25] - z[1, 13] - z[13, 26] * c(q3) + x[13, 26] * s(q3),
    ),
    "beta_10": (
        x[1, 28] - x[1, 27] - x[27, 29] * c(q2) - z[27, 29] * s(q2),
        z[1, 28] - z[1, 27] - z[27, 29] * c(q2) + x[27, 29] * s(q2),
    ),
}

KINDS = {
    "consecutive": {1: "link_2", 2: "link_2", 3: "link_3", 8: "link_2", 9: "link_1", 10: "link_1"},
    "coincident branched": {4: "link_1", 5: "link_2", 6: "link_2", 7: "link_1"},
}

CONTACT_DEGREES = {
    "beta_1": ("q3 - q2", 37.502302789),
    "beta_2": ("q3 - q2", -78.372904505),
    "beta_3": ("q3", 68.981699122),
    "beta_4": ("q3 - q2", 32.429119975),
    "beta_5": ("q3", -26.090547340),
    "beta_6": ("q3", 71.143173065),
    "beta_7": ("q2", 70.001229130),
    "beta_8": ("q3 - q2", -68.504624059),
    "beta_9": ("q3", -8.462041074),
    "beta_10": ("q2", -10.145750656),
}

HEXAGON_DEGREES = [
    (36.552579147, 68.981699122),
    (-10.145750656, 22.283369318),
    (-10.145750656, -8.462041074),
    (60.042582985, -8.462041074),
    (70.001229130, 1.496605072),
    (70.001229130, 68.981699122),
]


@pytest.mark.parametrize("name", EQUATION_17)
def test_vector_is_equation_17_component_by_component(minerva: pb.Robot, as_printed: pb.Robot, name: str) -> None:
    robot = as_printed if name in ("beta_5", "beta_6") else minerva
    r = robot.boundaries[name].expression("ancestor")
    assert sp.simplify(r[0] - EQUATION_17[name][0]) == 0
    assert r[1] == 0
    assert sp.simplify(r[2] - EQUATION_17[name][1]) == 0


def test_the_bridge_as_printed_is_not_the_level_bridge(minerva: pb.Robot) -> None:
    r = minerva.boundaries["beta_5"].expression("ancestor")
    assert sp.simplify(r[0] - EQUATION_17["beta_5"][0]) != 0


def test_with_the_level_bridge_two_boundaries_depend_on_q3_alone(minerva: pb.Robot) -> None:
    for name in ("beta_5", "beta_6"):
        assert minerva.boundaries[name].expression().free_symbols == {q3}
        assert minerva.boundaries[name].expression("ancestor").free_symbols == {q2, q3}


def test_vectors_equal_placements_on_ten_thousand_configurations(minerva: pb.Robot, as_printed: pb.Robot) -> None:
    Q = np.random.default_rng(17).uniform(-2 * np.pi, 2 * np.pi, (5000, 3))
    for robot in (minerva, as_printed):
        assert np.abs(robot.boundaries.vectors(Q) - oracle_vectors(robot, Q)).max() < 1e-12


def test_kinds_and_ancestors_are_those_of_tables_5_to_14(minerva: pb.Robot) -> None:
    found = {b.name: (b.kind.value, b.ancestor) for b in minerva.boundaries}
    assert found == {f"beta_{i}": (kind, link) for kind, links in KINDS.items() for i, link in links.items()}


@pytest.mark.parametrize("name", CONTACT_DEGREES)
def test_contact_angles(minerva: pb.Robot, name: str) -> None:
    contact = minerva.boundaries[name].contact
    text, angle = CONTACT_DEGREES[name]
    assert contact is not None
    assert contact.text == text
    assert contact.half_width == 0.0
    assert np.degrees(contact.angle) == pytest.approx(angle, abs=1e-9)
    assert contact.smallest < 1e-5


def test_the_feasible_region_is_the_hexagon(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva, coordinates=("q2", "q3"))
    first = int(np.argmin(np.abs(np.degrees(region.vertices) - HEXAGON_DEGREES[0]).sum(axis=1)))
    assert np.degrees(np.roll(region.vertices, -first, axis=0)) == pytest.approx(np.array(HEXAGON_DEGREES), abs=1e-9)
    names = [edge.name for edge in region.edges]
    assert names[first:] + names[:first] == ["beta_4", "beta_10", "beta_9", "beta_8", "beta_7", "beta_3"]
    assert region.area == pytest.approx(1.5434743997, abs=1e-10)
    assert np.degrees(region.centroid) == pytest.approx([34.841862996, 25.623336708], abs=5e-9)


def test_four_boundaries_are_implied_and_by_which(minerva: pb.Robot) -> None:
    supports = pb.feasible_region(minerva).supports()
    implied = {name: supports[name].by for name in minerva.boundaries.names if supports[name].by}
    assert implied == {"beta_1": ("beta_4",), "beta_2": ("beta_8",), "beta_5": ("beta_9",), "beta_6": ("beta_3",)}


def test_as_printed_beta_5_would_cut_the_region(as_printed: pb.Robot) -> None:
    contact = as_printed.boundaries["beta_5"].contact
    assert contact is not None
    assert contact.text == "q2"
    assert np.degrees(contact.angle) == pytest.approx(26.090547, abs=1e-6)
    assert "beta_5" in {edge.name for edge in pb.feasible_region(as_printed).edges}


def test_frames_are_those_of_the_notes(minerva: pb.Robot) -> None:
    angles = np.array([0.3, 0.5, 0.2])
    lift = np.array([0.0, 0.0, 0.0385 + 0.072])

    def turn_y(t: float) -> np.ndarray:
        return np.array([[np.cos(t), 0, np.sin(t)], [0, 1, 0], [-np.sin(t), 0, np.cos(t)]])

    t1 = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    elbow_at = turn_y(0.5) @ [0, 0, 0.1]
    wrist_at = elbow_at + turn_y(0.2) @ [0.09397, 0, -0.0342]
    tool_at = wrist_at + np.array([0.03546, 0, -0.02771])
    for link, place in (("link_3", elbow_at), ("link_16", elbow_at), ("link_4", wrist_at), ("link_6", tool_at)):
        assert minerva.positions(link, angles) == pytest.approx(t1 @ (place + lift), abs=1e-15)
