"""A five-bar as URDF, and what says its loop: a robot.yaml of Gepetto's toolbox, an MJCF model."""

from __future__ import annotations


def joint(
    name: str, ends: tuple[str, str], at: tuple[float, float], more: str = 'type="revolute"', yaw: float = 0.0
) -> str:
    return f"""<joint name="{name}" {more}><parent link="{ends[0]}"/><child link="{ends[1]}"/>
    <origin xyz="{at[0]} {at[1]} 0" rpy="0 0 {yaw}"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint><link name="{ends[1]}"/>"""


def five_bar(pin_joint: str = 'type="revolute"', yaw: float = 0.7) -> str:
    """Return a five-bar, drawn closed: two motors, two rods; a joint at its pin carries loop_A alone."""
    fixed = 'type="fixed"'
    parts = joint("motor_l", ("base", "crank_l"), (-0.1, 0.0)) + joint("free_l", ("crank_l", "rod_l"), (-0.1, 0.2))
    parts += joint("motor_r", ("base", "crank_r"), (0.1, 0.0)) + joint("free_r", ("crank_r", "rod_r"), (0.1, 0.2))
    parts += joint("loop_A", ("rod_l", "ball"), (0.2, 0.25), pin_joint, yaw)
    parts += joint("loop_B_frame", ("rod_r", "loop_B"), (-0.2, 0.25), fixed, -0.4)
    return f'<robot name="five"><link name="base"/>{parts}</robot>'


def four_bar() -> str:
    """Return a parallelogram of four joints, drawn closed: the fourth turns nothing but the link at the pin."""
    parts = joint("lean", ("base", "arm"), (0.0, 0.0)) + joint("elbow", ("arm", "fore"), (0.3, 0.4))
    parts += joint("crank", ("base", "link"), (0.2, 0.0)) + joint("rod", ("link", "bar"), (0.3, 0.4))
    return f'<robot name="four"><link name="base"/>{parts}</robot>'


def loops(kind: str, more: str = "") -> str:
    return f"closed_loop: [['loop_B', 'loop_A']]\ntype: ['{kind}']\nname_mot: ['motor']\n{more}"


def body(name: str, at: str, inside: str, moves: str) -> str:
    return f'<body name="{name}" pos="{at} 0"><joint name="{moves}"/>{inside}</body>'


def mjcf(equality: str, left: str = "", more: str = "") -> str:
    """Return the five-bar without a joint at its pin, as MuJoCo writes it."""
    site = '<site name="tip_l" pos="0.2 0.25 0"/>'
    arms = body("crank_l", "-0.1 0", body("rod_l", "-0.1 0.2", site, "free_l"), f'motor_l"{left} class="drive')
    arms += body(
        "crank_r", "0.1 0", body("rod_r", "0.1 0.2", '<site name="tip_r" pos="-0.2 0.25 0"/>', "free_r"), "motor_r"
    )
    return f"""<mujoco><default><joint axis="0 0 2"/><default class="drive"><joint range="-1 1"/></default></default>
    <worldbody><body name="base">{arms}</body></worldbody><equality>{equality}</equality>
    <actuator><motor joint="motor_l"/><position joint="motor_r"/></actuator>{more}</mujoco>"""


ANCHOR = '<connect name="tip" body1="rod_l" body2="rod_r" anchor="0.2 0.25 0"/>'
SITES = '<connect site1="tip_l" site2="tip_r" solref="0.01 1"/>'
