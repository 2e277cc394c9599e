"""Closed loops: proven for every q, not sampled; a wrong one is caught however small the tolerance must be."""

from collections.abc import Callable
from copy import deepcopy

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import pinbound as pb
from robots import random_q


def test_the_three_loops_close_to_rounding_over_every_angle(minerva: pb.Robot) -> None:
    assert [closure.name for closure in minerva.closures] == ["drive", "orientation", "forward"]
    assert minerva.closure_residuals(random_q(minerva, 10_000, seed=0)).max() < 1e-15
    assert max(closure.bound for closure in minerva.closures) < 1e-12


def test_residuals_equal_pinocchio_placements(minerva: pb.Robot) -> None:
    data, Q = minerva.model.createData(), random_q(minerva, 200, seed=1)
    for theta in minerva.coupling.expand(Q):
        pin.framesForwardKinematics(minerva.model, data, theta)
        for closure in minerva.closures:
            a, b = (
                data.oMf[minerva.model.getFrameId(link)] * np.array(xyz)
                for link, xyz in (
                    (closure.mark.link_a, closure.mark.xyz_a),
                    (closure.mark.link_b, closure.mark.xyz_b),
                )
            )
            assert np.linalg.norm(a - b) < 1e-15


@pytest.mark.parametrize("millimetres", [1.0, 0.01])
def test_a_pin_that_is_off_is_caught_with_its_size(
    minerva: pb.Robot, load_text: Callable[..., pb.Robot], millimetres: float
) -> None:
    root = deepcopy(minerva.document.root)
    drive = next(element for element in root.iter("{urn:pinbound:1}closure") if element.get("name") == "drive")
    drive.set("xyz_a", f"0 0 {0.1 + millimetres / 1e3}")
    with pytest.raises(pb.InputError, match=rf"does not close: its ends are {millimetres:g}") as caught:
        load_text(etree.tostring(root).decode())
    assert caught.value.problems[0].line is not None


def test_the_bridge_as_printed_cannot_close_the_orientation_loop(load_text: Callable[..., pb.Robot]) -> None:
    printed = pb.load("minervabot_v3", xacro_args={"bridge": "as_printed"})
    text = etree.tostring(printed.document.root).decode()
    ends = 'link_a="link_27" xyz_a="0 0 0.1" link_b="link_16" xyz_b="-0.03759 0 0.03035"'
    extra = f'<pinbound:closure name="orientation" {ends}/>'
    block = text.index("<pinbound:point")
    with pytest.raises(pb.InputError, match="'orientation' does not close"):
        load_text(text[:block] + extra + text[block:])


@pytest.mark.parametrize("mimic", [True, False])
def test_stock_pinocchio_agrees_on_q(minerva: pb.Robot, mimic: bool) -> None:
    """The expanded file loads as it is; to_pinocchio fills the user's q, whichever way the model was built."""
    model = pin.buildModelFromXML(etree.tostring(minerva.document.root).decode(), mimic=mimic)
    assert model.nq == (3 if mimic else 11)
    if mimic:
        assert [name for name in model.names if name in minerva.coordinates] == ["q1", "q2", "q3"]
    data, own = model.createData(), minerva.model.createData()
    Q = random_q(minerva, 20, seed=2)
    for q, theta in zip(minerva.to_pinocchio(model, Q), minerva.coupling.expand(Q), strict=True):
        pin.framesForwardKinematics(model, data, q)
        pin.framesForwardKinematics(minerva.model, own, theta)
        for link in minerva.tree.links:
            there = data.oMf[model.getFrameId(link)].homogeneous
            assert np.abs(there - own.oMf[minerva.model.getFrameId(link)].homogeneous).max() < 1e-14
