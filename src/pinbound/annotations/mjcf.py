"""Reads an MJCF model for its loops: `<equality><connect>` as closures, linear `<equality><joint>` as mimic joints.

The links are those of the URDF. A body of MJCF and a link of the same name count as one frame only if their placements
agree (`mjcf_frames`): a pin in a different frame would give a wrong loop. Other couplings of bodies or joints are
refused by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from lxml import etree

from pinbound.annotations.gepetto import Found
from pinbound.annotations.mjcf_frames import Bodies, Place, text_of
from pinbound.annotations.records import RawItem
from pinbound.exceptions import Problems, name_hint
from pinbound.model.document import Document, parse_floats
from pinbound.model.tree import Tree
from pinbound.model.urdf import read_kinematics
from pinbound.tolerances import MJCF_FRAME
from pinbound.typing import Array
from pinbound.units import several

__all__ = ["read_mjcf"]

_Ends: TypeAlias = tuple[tuple[str, Array], tuple[str, Array]]

_WORLD = "world"
_LINEAR = "0 1 0 0 0".split()  # MuJoCo's default polynomial
_ALIKE = "Give the MJCF that was made from this URDF, or write the closure in a sidecar (pinbound.yaml)"
_AWAY = "Write this coupling in a sidecar, and remove it from the file that you give here"


def read_mjcf(root: etree._Element, source: str, problems: Problems, document: Document | None) -> Found:
    """Return the loops of a URDF in an MJCF model; elements that cannot be converted go to `problems` by name.

    Args:
        root: The `<mujoco>` element.
        source: The file's name.
        problems: Collects the faults.
        document: The URDF with the links; None: not known, which is a fault.
    """
    if root.tag != "mujoco":
        problems.add(
            f"starts with <{root.tag}>, not with <mujoco>", "Give an MJCF model, a sidecar or an SRDF", 1, source
        )
        return Found(())
    if document is None:
        message = "names bodies of a robot whose URDF is not given"
        problems.add(message, "Load both: pinbound.load('robot.urdf', annotations='robot.xml')", 1, source)
        return Found(())
    for one in root.iter("include"):
        message = f"includes {one.get('file')!r}, which is not read: it may hold bodies or couplings"
        problems.add(message, "Save the model as one file (MuJoCo: mj_saveLastXML)", one.sourceline, source)
    unread = Problems(document.label)  # faults of the URDF are reported when it is read itself
    kinematics = read_kinematics(document, unread)
    if unread.found:
        return Found(())
    return _Reader(root, source, problems, Tree(kinematics)).read()


class _Reader:
    def __init__(self, root: etree._Element, source: str, problems: Problems, tree: Tree) -> None:
        self.root, self.source, self.problems, self.tree = root, source, problems, tree
        self.bodies = Bodies(root, self._fault)
        self.checked: dict[str, bool] = {}
        self.apart = 0.0
        actuated = (one.get("joint") for group in root.findall("actuator") for one in group)
        self.actuated = {name for name in actuated if name}

    def read(self) -> Found:
        items: list[RawItem] = []
        notes: list[str] = []
        for index, element in enumerate(self._equalities(), 1):
            name = element.get("name") or f"{element.tag} {index}"
            if self.bodies.attribute(element, "active", "", kind="equality") == "false":
                notes.append(f"{self.source}: {name!r} is not active there, ignored")
                continue
            if element.tag == "connect":
                items += self._connect(element, name)
            elif element.tag == "joint":
                items += self._follower(element, name)
            else:
                what = f"equality {name!r} is a <{element.tag}>, for which pinbound has no closed form"
                self._fault(what, f"pinbound reads <connect> and linear <joint>. {_AWAY}", element)
        loops = sum(item.kind == "closure" for item in items)
        if loops:
            what = several(loops, "loop is", "loops are")
            notes.append(
                f"{self.source}: {what} taken as exact pins (in MuJoCo they are soft); bodies are where the "
                f"links of their names are, to {1e6 * self.apart:.3g} um"
            )
        return Found(tuple(items), tuple(notes))

    def _equalities(self) -> Iterator[etree._Element]:
        for group in self.root.findall("equality"):
            yield from group.iterchildren(etree.Element)

    def _connect(self, element: etree._Element, name: str) -> list[RawItem]:
        if element.get("site1") is not None or element.get("site2") is not None:
            ends = self._sites(element, name)
        else:
            ends = self._anchor(element, name)
        if ends is None:
            return []
        (link_a, a), (link_b, b) = ends
        if link_a == link_b:
            self._fault(f"connect {name!r} joins link {link_a!r} to itself", "Name two bodies", element)
            return []
        places = {"xyz_a": text_of(a), "xyz_b": text_of(b)}
        fields: dict[str, Any] = {"name": name, "link_a": link_a, "link_b": link_b} | places
        around = [joint.name for joint in self.tree.path_between(link_a, link_b)]
        active = tuple(joint for joint in around if joint in self.actuated)
        if active:
            fields["active"] = active
        return [RawItem("closure", fields, self.source, element.sourceline)]

    def _anchor(self, element: etree._Element, name: str) -> _Ends | None:
        """Return both ends of a pin given in the frame of body1; at zero it is the same point of body2."""
        anchor = parse_floats(element.get("anchor", ""), 3)
        if isinstance(anchor, str) or element.get("body1") is None:
            message = f"connect {name!r} has no body1 with an anchor of three numbers, and no site1 and site2"
            self._fault(message, "Give one of the two", element)
            return None
        first = self._place(str(element.get("body1")), name, element)
        second = self._place(element.get("body2", _WORLD), name, element)
        if first is None or second is None:
            return None
        at_zero = self.tree.frames_at_zero
        here = first.frame[:, :3] @ np.array(anchor) + first.frame[:, 3]  # in the frame of the link
        there = at_zero[first.link][:, :3] @ here + at_zero[first.link][:, 3]
        frame = at_zero[second.link]
        return (first.link, here), (second.link, frame[:, :3].T @ (there - frame[:, 3]))

    def _sites(self, element: etree._Element, name: str) -> _Ends | None:
        """Return both ends of a pin between two sites."""
        found: list[tuple[str, Array]] = []
        for key in ("site1", "site2"):
            site = self.bodies.sites.get(str(element.get(key)))
            if site is None:
                hint = name_hint(str(element.get(key)), self.bodies.sites)
                self._fault(
                    f"connect {name!r} names the site {element.get(key)!r}, which does not exist", hint, element
                )
                return None
            place = self._place(site[0], name, element)
            if place is None:
                return None
            found.append((place.link, place.frame[:, :3] @ site[1] + place.frame[:, 3]))
        return found[0], found[1]

    def _place(self, body: str, name: str, element: etree._Element) -> Place | None:
        """Return the link of a body; None if there is none with certainly the same placement."""
        if body == _WORLD and _WORLD not in self.tree.links:
            return self._world(name, element)
        if body not in self.bodies.frames:
            hint = name_hint(body, self.bodies.frames)
            self._fault(f"connect {name!r} names the body {body!r}, which does not exist", hint, element)
            return None
        if body not in self.tree.links:
            hint = name_hint(body, self.tree.links)
            self._fault(f"connect {name!r}: body {body!r} is not a link of the URDF", hint, element)
            return None
        return Place(body, np.eye(3, 4)) if self._is_alike(body, name, element) else None

    def _world(self, name: str, element: etree._Element) -> Place | None:
        """Return the root link for the world; it must be fixed to it."""
        root = self.tree.root
        if root not in self.bodies.frames:
            return Place(root, np.eye(3, 4))
        if root in self.bodies.moving:
            message = f"connect {name!r} holds a body to the world, in which the robot's root {root!r} moves"
            self._fault(message, "Name two bodies of the robot", element)
            return None
        frame = self.bodies.frames[root]
        return Place(root, _relative(frame, np.eye(3, 4)))

    def _is_alike(self, body: str, name: str, element: etree._Element) -> bool:
        """Return whether a body, and those above it, are placed like the links of their names; report it if not."""
        if body in self.checked:
            return self.checked[body]
        found = True
        lineage = [link for link in self.tree.lineage(body) if link in self.bodies.frames]
        for link in lineage:
            joint = self.tree.parent_joint.get(link)
            moved = self.bodies.joints.get(link)
            if joint is None or moved is None or not joint.moves:
                continue
            off = float(np.abs(np.cross(moved.axis, joint.axis)).max())
            beside = float(np.abs(np.cross(moved.pos, joint.axis)).max()) if moved.turns else 0.0
            if max(off, beside) > MJCF_FRAME or moved.turns != (joint.type != "prismatic"):
                message = f"connect {name!r}: body {link!r} moves about another axis than link {link!r} of the URDF"
                self._fault(message, _ALIKE, element)
                found = False
        start = self.bodies.frames.get(self.tree.root, np.eye(3, 4))  # a root without a body is part of the world
        for link in lineage:
            here, there = _relative(start, self.bodies.frames[link]), self.tree.frames_at_zero[link]
            apart = float(np.abs(here - there).max())
            self.apart = max(self.apart, float(np.linalg.norm(here[:, 3] - there[:, 3])))
            if apart > MJCF_FRAME:
                message = (
                    f"connect {name!r}: body {link!r} is not where link {link!r} of the URDF is at zero, seen from the "
                )
                self._fault(
                    f"{message}root: they differ by {apart:.3g} (m, or of a rotation's entries)", _ALIKE, element
                )
                found = False
                break
        self.checked[body] = found
        return found

    def _follower(self, element: etree._Element, name: str) -> list[RawItem]:
        """Return `theta_1 = c_0 + c_1 theta_2`; both are measured from the drawn pose, as in the URDF."""
        words = element.get("polycoef", "").split()
        numbers = parse_floats(" ".join([*words, *_LINEAR[len(words) :]]), len(_LINEAR))
        names = [element.get("joint1"), element.get("joint2")]
        unknown = [one for one in names if one not in {joint.name for joint in self.tree.moving_joints}]
        if unknown or isinstance(numbers, str) or any(numbers[2:]):
            why = f"{unknown[0]!r} is not a moving joint of the URDF" if unknown else "it is no linear equation"
            self._fault(f"equality {name!r} couples joints, and {why}", _AWAY, element)
            return []
        joints = {joint.name: joint for joint in self.tree.moving_joints}
        for one in names:
            moved = self.bodies.joints.get(joints[str(one)].child)
            if moved is None or moved.name != one or float(moved.axis @ joints[str(one)].axis) < 1.0 - MJCF_FRAME:
                message = f"equality {name!r}: joint {one!r} does not turn about the same axis as in the URDF"
                self._fault(message, _AWAY, element)
                return []
        offset, multiplier = numbers[:2]
        fields = {"joint": names[0], "primary": names[1], "multiplier": repr(multiplier), "offset": repr(offset)}
        return [RawItem("follower", fields, self.source, element.sourceline)]

    def _fault(self, message: str, remedy: str, element: etree._Element) -> None:
        self.problems.add(message, remedy, element.sourceline, self.source)


def _relative(frame: Array, other: Array) -> Array:
    """Return a frame (3, 4) relative to another one."""
    turned: Array = frame[:, :3].T
    return np.column_stack((turned @ other[:, :3], turned @ (other[:, 3] - frame[:, 3])))
