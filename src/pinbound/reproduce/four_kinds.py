"""A small arm with one boundary of each kind; MinervaBotV3 has only two of the four kinds (erratum 6)."""

from __future__ import annotations

from pathlib import Path

from pinbound.robot.loading import load
from pinbound.robot.robot import Robot

__all__ = ["FOUR_KINDS", "write_four_kinds"]


def _joint(name: str, parent: str, child: str, xyz: str, axis: str = "0 1 0") -> str:
    return (
        f'  <link name="{child}"/>\n  <joint name="{name}" type="revolute">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>\n'
    )


FOUR_KINDS = (
    '<robot name="four_kinds" xmlns:pinbound="urn:pinbound:1">\n  <link name="frame_1"/>\n'
    + _joint("q2", "frame_1", "frame_2", "0 0 0.1")
    + _joint("q3", "frame_2", "frame_3", "0 0 0.3")
    + _joint("q4", "frame_3", "frame_4", "0.25 0 0", "0 0 1")
    + _joint("q5", "frame_1", "frame_5", "0 0 0.1", "1 0 0")
    + _joint("q6", "frame_1", "frame_6", "0.2 0 0.05")
    + """  <pinbound:annotations>
    <pinbound:point name="n" link="frame_2" xyz="0.04 0.01 0.2"/>
    <pinbound:point name="m3" link="frame_3" xyz="0.1 0 -0.05"/>
    <pinbound:point name="m4" link="frame_4" xyz="0.05 0.06 0.02"/>
    <pinbound:point name="m5" link="frame_5" xyz="0.1 0.1 0.15"/>
    <pinbound:point name="m6" link="frame_6" xyz="0.02 0 0.25"/>
    <pinbound:boundary name="consecutive" a="n" b="m3"/>
    <pinbound:boundary name="non_consecutive" a="n" b="m4"/>
    <pinbound:boundary name="branched" a="n" b="m6"/>
    <pinbound:boundary name="coincident_branched" a="n" b="m5"/>
  </pinbound:annotations>
</robot>
"""
)


def write_four_kinds(folder: Path) -> Robot:
    """Write the arm's URDF into a folder and load it.

    Example:
        >>> import tempfile
        >>> robot = write_four_kinds(Path(tempfile.mkdtemp()))
        >>> [boundary.kind.value for boundary in robot.boundaries]
        ['consecutive', 'non-consecutive', 'branched', 'coincident branched']
    """
    path = folder / "four_kinds.urdf"
    path.write_text(FOUR_KINDS, encoding="utf-8")
    return load(path)
