"""Annotations inside the URDF: `<pinbound:annotations>` blocks, read and written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

from lxml import etree

from pinbound.annotations.records import FIELDS, NAMESPACE, RawItem
from pinbound.exceptions import Problems, UnsupportedError, name_hint
from pinbound.model.document import local_name
from pinbound.model.vocabulary import looks_like_ours

__all__ = ["inline_text", "read_inline"]

_NAMESPACED = etree.XPath("descendant::*[namespace-uri()]")


def read_inline(root: etree._Element, problems: Problems) -> list[RawItem]:
    """Return the raw items of every `<pinbound:annotations>` block of a `<robot>`; there may be several."""
    items: list[RawItem] = []
    foreign: set[str | None] = set()
    for element in cast(list[etree._Element], _NAMESPACED(root)):
        if not looks_like_ours(element):
            continue
        namespace = etree.QName(element).namespace
        if namespace in foreign:
            continue  # reported only once
        if namespace != NAMESPACE:
            foreign.add(namespace)
            problems.add(
                f"<{local_name(element)}> is in the namespace {namespace!r}, which nothing reads",
                f'Write xmlns:pinbound="{NAMESPACE}", which this version reads',
                element.sourceline,
            )
        elif local_name(element) == "annotations" and element.getparent() is root:
            items += _read_block(element, problems)
        elif not _inside_annotations(element, root):
            problems.add(
                f"<pinbound:{local_name(element)}> stands outside <pinbound:annotations>",
                "Move it into a <pinbound:annotations> directly below <robot>",
                element.sourceline,
            )
    return items


def _inside_annotations(element: etree._Element, root: etree._Element) -> bool:
    block = f"{{{NAMESPACE}}}annotations"
    return any(above.tag == block and above.getparent() is root for above in element.iterancestors())


def _read_block(block: etree._Element, problems: Problems) -> list[RawItem]:
    items = [RawItem("settings", dict(block.attrib), problems.source, block.sourceline)] if block.attrib else []
    for element in block.iterchildren(etree.Element):
        kind = local_name(element)
        valid = [kind for kind in FIELDS if kind != "settings"] + ["home"]
        if etree.QName(element).namespace != NAMESPACE or kind not in valid:
            problems.add(
                f"<{kind}> is no annotation",
                name_hint(kind, valid),
                element.sourceline,
            )
            continue
        conditions: list[dict[str, Any]] = []
        for child in element.iterchildren(etree.Element):
            if (
                kind == "rule"
                and child.tag == f"{{{NAMESPACE}}}where"
                and not len(child)
                and not (child.text or "").strip()
            ):
                conditions.append({str(key): value for key, value in child.attrib.items()})
                continue
            problems.add(f"<{local_name(child)}> stands inside <pinbound:{kind}>", "Remove it", child.sourceline)
        fields: dict[str, Any] = {str(key): value for key, value in element.attrib.items()}
        if conditions:
            fields["where"] = tuple(conditions)
        text = " ".join((element.text or "").split())
        if kind == "assumption":
            fields["text"] = text
        elif text:
            problems.add(f"<pinbound:{kind}> holds the text {text!r}", "Use attributes", element.sourceline)
        items.append(RawItem(kind, fields, problems.source, element.sourceline))
    return items


def inline_text(items: Iterable[RawItem]) -> str:
    """Return a `<pinbound:annotations>` block with the items, to paste below `<robot>`.

    Raises:
        UnsupportedError: If a joint of home has a name that XML does not allow for an attribute.
    """
    block = etree.Element(f"{{{NAMESPACE}}}annotations", nsmap={"pinbound": NAMESPACE})
    for item in items:
        if item.kind == "settings":
            for key, value in item.fields.items():
                block.set(key, value)
            continue
        element = etree.SubElement(block, f"{{{NAMESPACE}}}{item.kind}")
        if item.kind == "assumption":
            element.text = item.fields["text"]
            continue
        for key, value in item.fields.items():
            if key == "where":
                for condition in value:
                    _set_attributes(etree.SubElement(element, f"{{{NAMESPACE}}}where"), condition)
                continue
            try:
                _set_attributes(element, {key: value})
            except ValueError as error:
                raise UnsupportedError(f"{key!r} cannot be written as XML ({error}); write a sidecar") from error
    etree.indent(block)
    return etree.tostring(block, encoding="unicode") + "\n"


def _set_attributes(element: etree._Element, fields: Mapping[str, Any]) -> None:
    """Set attributes: texts unchanged, names separated by spaces, coefficients as `joint: number, joint: number`."""
    for key, value in fields.items():
        text = ", ".join(f"{name}: {c}" for name, c in value) if key == "coefficients" else value
        element.set(key, text if isinstance(text, str) else " ".join(text))
