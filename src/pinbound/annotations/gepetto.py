"""Reads a `robot.yaml`: the file in which Gepetto's toolbox-parallel-robots lists the frames that close loops.

`closed_loop` lists pairs of frames. `type` says for each pair whether only the position is the same (`3d`: a pin), or
the orientation, too (`6d`: a weld). `name_mot` lists the motors. `joint_name` and `joint_type` replace joints of the
URDF by joints of several axes. pinbound does not support these, and refuses them by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml
from lxml import etree

from pinbound.annotations.records import RawItem
from pinbound.exceptions import Problems, name_hint
from pinbound.values import Value

__all__ = ["Found", "is_gepetto", "read_gepetto"]

_PIN, _WELD = "3d", "6d"
_KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type", "rotule_name")
_ENDS = 2


@dataclass(frozen=True)
class Found(Value):
    """The content of a file beside the URDF: raw items, and one sentence for each part that was not used."""

    items: tuple[RawItem, ...]
    notes: tuple[str, ...] = ()


def is_gepetto(node: yaml.Node) -> bool:
    """Return whether a YAML document is a `robot.yaml`: a mapping with `closed_loop` or `name_mot`."""
    return isinstance(node, yaml.MappingNode) and any(key.value in ("closed_loop", "name_mot") for key, _ in node.value)


def read_gepetto(node: yaml.Node, source: str, problems: Problems, robot: etree._Element | None) -> Found:
    """Return the loops of a `robot.yaml` as closures; an entry that is not a closure becomes a fault with its reason.

    Args:
        node: The YAML document.
        source: The file's name.
        problems: Collects the faults.
        robot: The `<robot>` element of the URDF that has the frames; None: not known, which is a fault.
    """
    if robot is None:
        message = "names frames of a URDF, which is not given"
        problems.add(message, "Load both: pinbound.load('robot.urdf', annotations='robot.yaml')", 1, source)
        return Found(())
    return _Reader(node, source, problems, robot).read()


class _Reader:
    def __init__(self, node: yaml.Node, source: str, problems: Problems, robot: etree._Element) -> None:
        self.source, self.problems = source, problems
        self.values: dict[str, yaml.Node] = {str(key.value): value for key, value in node.value}
        self.links = [str(one.get("name")) for one in robot.findall("link")]
        self.ends: dict[str, tuple[str, str, str]] = {}
        for joint in robot.findall("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if parent is not None and child is not None:
                named = str(joint.get("type")), str(parent.get("link")), str(child.get("link"))
                self.ends[str(joint.get("name"))] = named

    def read(self) -> Found:
        unknown = [key for key in self.values if key not in _KEYS]
        notes = [f"{self.source} has {', '.join(map(repr, unknown))}, ignored"] if unknown else []
        fixed = self._replaced(notes)
        motors = self._motors()
        items: list[RawItem] = []
        kinds = [self._text(one).lower() for one in self._entries("type")]
        loops = self._entries("closed_loop")
        if "type" in self.values and len(kinds) != len(loops):
            message = f"has {len(loops)} loops and {len(kinds)} types"
            self._fault(message, "Give each pair of closed_loop its type, 3d or 6d", self.values["type"])
            kinds = []
        for index, entry in enumerate(loops):
            kind = kinds[index] if index < len(kinds) else _WELD
            item = self._closure(entry, kind, motors)
            items += [item] if item else []
        return Found((*items, *fixed), tuple(notes))

    def _closure(self, entry: yaml.Node, kind: str, motors: list[str]) -> RawItem | None:
        names = [self._text(one) for one in entry.value] if isinstance(entry, yaml.SequenceNode) else []
        if len(names) != _ENDS:
            self._fault(f"a loop is {self._text(entry)!r}", "Name two frames: [frame_a, frame_b]", entry)
            return None
        name = "-".join(names)
        if kind not in (_PIN, _WELD):
            self._fault(f"loop {name!r} has the type {kind!r}", "Write 3d (a pin) or 6d (a weld)", entry)
            return None
        links = [self._link(one, name, entry) for one in names]
        if links[0] is None or links[1] is None:
            return None
        around = self._around(links[0], links[1])
        fields: dict[str, Any] = {
            "name": name,
            "link_a": links[0],
            "xyz_a": "0 0 0",
            "link_b": links[1],
            "xyz_b": "0 0 0",
        }
        active = tuple(joint for joint in motors if joint in around)
        if active:
            fields["active"] = active
        if kind == _WELD:
            fields["weld"] = "true"
        return RawItem("closure", fields, self.source, entry.start_mark.line + 1)

    def _link(self, frame: str, loop: str, entry: yaml.Node) -> str | None:
        """Return the link whose frame has this name: the link itself, or the child link of the joint with this name."""
        below = self.ends[frame][2] if frame in self.ends else frame
        if below in self.links and (frame not in self.links or below == frame):
            return below
        if below in self.links:
            message = f"loop {loop!r}: {frame!r} is a link, and a joint above another link, {below!r}"
            self._fault(message, "Give one of them another name in the URDF", entry)
        else:
            hint = name_hint(frame, [*self.links, *self.ends])
            self._fault(f"loop {loop!r} names the frame {frame!r}, which the URDF does not have", hint, entry)
        return None

    def _around(self, *links: str) -> set[str]:
        """Return the joints between two links."""
        above = {child: (name, parent) for name, (_, parent, child) in self.ends.items()}
        ways: list[set[str]] = []
        for end in links:
            link, way = end, set[str]()
            while link in above and above[link][0] not in way:  # a cycle of joints is a fault that other code reports
                way.add(above[link][0])
                link = above[link][1]
            ways.append(way)
        return ways[0] ^ ways[1]

    def _motors(self) -> list[str]:
        """Return the joints whose names contain an entry of `name_mot`, as the toolbox reads it."""
        node = self.values.get("name_mot")
        if node is None:
            return []
        found: list[str] = []
        for one in [node] if isinstance(node, yaml.ScalarNode) else self._entries("name_mot"):
            text = self._text(one)
            held = [name for name in self.ends if text and text in name and self.ends[name][0] != "fixed"]
            if not held:
                self._fault(f"name_mot: no moving joint has {text!r} in its name", name_hint(text, self.ends), one)
            found += [name for name in held if name not in found]
        return found

    def _replaced(self, notes: list[str]) -> list[RawItem]:
        """Return limits that hold joints of type FIXED at zero; refuse joints that rotate about several axes."""
        entries, kinds = self._entries("joint_name"), [self._text(one) for one in self._entries("joint_type")]
        if len(entries) != len(kinds):
            message = f"has {len(entries)} names in joint_name and {len(kinds)} in joint_type"
            self._fault(message, "Give each joint its type", self.values.get("joint_name") or self.values["joint_type"])
            return []
        items: list[RawItem] = []
        for entry, kind in zip(entries, kinds, strict=True):
            name = self._text(entry)
            if name not in self.ends:
                notes.append(f"{self.source} replaces joint {name!r}, which the URDF does not have; ignored")
            elif kind == "FIXED":
                fields = {"joint": name, "lower": "0", "upper": "0"}
                items.append(RawItem("limit", fields, self.source, entry.start_mark.line + 1))
            else:
                self._several(name, kind, entry)
        node = self.values.get("rotule_name")
        for name in self.ends if node is not None and self._text(node) else ():
            if node is not None and self._text(node) in name:
                self._several(name, "SPHERICAL", node)
        return items

    def _several(self, name: str, kind: str, node: yaml.Node) -> None:
        message = f"joint {name!r} is {kind} here: it rotates about several axes, so its loops are spatial"
        self._fault(
            message, "Remove it from joint_name if the one axis of the URDF is right; else it cannot be loaded", node
        )

    def _entries(self, key: str) -> list[yaml.Node]:
        node = self.values.get(key)
        if node is None:
            return []
        if not isinstance(node, yaml.SequenceNode):
            self._fault(f"{key} is no list", "Write [...]", node)
            return []
        return list(node.value)

    def _text(self, node: yaml.Node) -> str:
        return (
            " ".join(map(self._text, self._parts(node))) if not isinstance(node, yaml.ScalarNode) else str(node.value)
        )

    @staticmethod
    def _parts(node: yaml.Node) -> Iterator[yaml.Node]:
        for one in node.value:
            yield from one if isinstance(one, tuple) else (one,)

    def _fault(self, message: str, remedy: str, node: yaml.Node) -> None:
        self.problems.add(message, remedy, node.start_mark.line + 1, self.source)
