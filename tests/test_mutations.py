"""Malformed files by mutation: one clear error or a robot; never another exception, a hang, or a silent pass."""

import random
from pathlib import Path

import pytest
from lxml import etree

import pinbound as pb
from test_input import BARE, GOOD, SIDECAR

NASTY = [
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e-400",
    "",
    " ",
    "0x10",
    "1_0",
    "٣",
    "💥",
    "&",
    "<",
    "'\"",
    "1,5",
    "-0",
    "9" * 400,
]
SEEDS = 150


def mutate_text(text: str, rng: random.Random) -> str:
    """Delete, duplicate, swap or replace a piece of the text."""
    lines = text.splitlines()
    kind = rng.choice(["delete", "duplicate", "swap", "cut", "insert"])
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind == "delete":
        del lines[a]
    elif kind == "duplicate":
        lines.insert(a, lines[a])
    elif kind == "swap":
        lines[a], lines[b] = lines[b], lines[a]
    elif kind == "cut":
        line = lines[a]
        lines[a] = line[: rng.randrange(len(line) + 1)]
    else:
        at = rng.randrange(len(lines[a]) + 1)
        lines[a] = lines[a][:at] + rng.choice(NASTY) + lines[a][at:]
    return "\n".join(lines)


def mutate_attribute(text: str, rng: random.Random) -> str:
    """Replace one attribute of one element by something nasty, or remove it, or rename it."""
    root = etree.fromstring(text)
    element = rng.choice([e for e in root.iter(etree.Element) if e.attrib])
    key = rng.choice(list(element.attrib))
    action = rng.choice(["nasty", "remove", "rename"])
    if action == "nasty":
        element.set(key, rng.choice([value for value in NASTY if value.isprintable()]))
    else:
        value = element.attrib.pop(key)
        if action == "rename":
            element.set(key + "x", value)
    return etree.tostring(root, encoding="unicode")


@pytest.mark.parametrize("seed", range(SEEDS))
def test_a_mutated_urdf_is_refused_or_loaded(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    text = (mutate_attribute if seed % 2 else mutate_text)(GOOD, rng)
    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    try:
        robot = pb.load(path)
    except pb.InputError as error:
        assert error.problems
        assert all(problem.message and problem.remedy for problem in error.problems)
    else:
        assert robot.boundaries.norms(robot.home).shape == (len(robot.boundaries),)
        assert robot.model.nq == len(robot.coupling.joints)


@pytest.mark.parametrize("seed", range(SEEDS))
def test_a_mutated_sidecar_is_refused_or_loaded(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    (tmp_path / "robot.urdf").write_text(BARE, encoding="utf-8")
    (tmp_path / "robot.pinbound.yaml").write_text(mutate_text(SIDECAR, rng), encoding="utf-8")
    try:
        robot = pb.load(tmp_path / "robot.urdf")
    except pb.InputError as error:
        assert error.problems
    else:
        assert robot.coordinates == ("q1",)


@pytest.mark.parametrize("key", ["min_distance", "radius", "xyz", "a", "b", "name", "link", "link_a", "xyz_b"])
def test_a_misspelt_attribute_never_passes(key: str, tmp_path: Path) -> None:
    text = GOOD.replace('b="s"/>', 'b="s" min_distance="0.0"/>').replace('xyz="1 0 0"/>', 'xyz="1 0 0" radius="0"/>')
    root = etree.fromstring(text)
    element = next(e for e in root.iter("{urn:pinbound:1}*") if key in e.attrib)
    element.set(key + "_", element.attrib.pop(key))
    path = tmp_path / "robot.urdf"
    path.write_text(etree.tostring(root, encoding="unicode"))
    with pytest.raises(pb.InputError, match="unknown attribute"):
        pb.load(path)


@pytest.mark.parametrize("value", NASTY)
@pytest.mark.parametrize("where", ["radius", "min_distance", "contact_tolerance", "xyz"])
def test_nasty_numbers_never_pass(where: str, value: str, tmp_path: Path) -> None:
    if value in ("-0", "1e-400"):
        return  # these are numbers: zero
    sidecar = SIDECAR.replace("radius: 0.0", f"radius: {value!r}" if where == "radius" else "radius: 0.0")
    if where == "min_distance":
        sidecar = sidecar.replace("min_distance: 0.0", f"min_distance: {value!r}")
    elif where == "contact_tolerance":
        sidecar = sidecar.replace("contact_tolerance: 2.0e-5", f"contact_tolerance: {value!r}")
    elif where == "xyz":
        sidecar = sidecar.replace("[1, 0, 0]", f"[1, {value!r}, 0]")
    (tmp_path / "robot.urdf").write_text(BARE)
    (tmp_path / "robot.pinbound.yaml").write_text(sidecar, encoding="utf-8")
    with pytest.raises(pb.InputError):
        pb.load(tmp_path / "robot.urdf")
