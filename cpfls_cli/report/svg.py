"""Figures as SVG inside a page: equal bytes for equal figures, no id twice, nothing from outside."""

from __future__ import annotations

import io
import re
from xml.etree import ElementTree

from matplotlib.figure import Figure

_NAMESPACE = "http://www.w3.org/2000/svg"
_PLACES = {"d", "x", "y"}
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}(?!\d*e)")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")


def inline_svg(figure: Figure, name: str, description: str) -> str:
    """Write a figure as an ``svg`` element for an HTML page.

    Parameters
    ----------
    name : str
        Unique on the page; ids inside the figure start with it.
    description : str
        What the figure shows, for those who do not see it.
    """
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    root = ElementTree.fromstring(stream.getvalue())
    _strip(root)
    _rename_ids(root, name)
    _shorten(root)
    for attribute in ("width", "height", "version"):
        root.attrib.pop(attribute, None)
    root.attrib |= {"xmlns": _NAMESPACE, "role": "img", "aria-label": description}
    return ElementTree.tostring(root, encoding="unicode")


def _strip(element: ElementTree.Element) -> None:
    """Drop metadata, style sheets (they would rule the whole page) and name spaces, which HTML does not know."""
    element.tag = element.tag.rsplit("}", 1)[-1]
    for key in list(element.attrib):
        element.set(key.rsplit("}", 1)[-1], element.attrib.pop(key))
    for child in list(element):
        if child.tag.rsplit("}", 1)[-1] in {"metadata", "style"}:
            element.remove(child)
        else:
            _strip(child)


def _rename_ids(root: ElementTree.Element, name: str) -> None:
    """Keep only the ids that something refers to, each with the name of the figure before it."""
    used = {reference for element in root.iter() for reference in _references(element)}
    for element in root.iter():
        identifier = element.attrib.pop("id", None)
        if identifier in used:
            element.set("id", f"{name}-{identifier}")
        for key, value in element.attrib.items():
            if key == "href" and value.startswith("#"):
                element.set(key, f"#{name}-{value[1:]}")
            elif "url(#" in value:
                element.set(key, _REFERENCE.sub(rf"url(#{name}-\1)", value))


def _shorten(root: ElementTree.Element) -> None:
    """Write places with two decimals, a fiftieth of a pixel on a screen: most of a page would be digits else."""
    for element in root.iter():
        for key in _PLACES & set(element.attrib):
            words = " ".join(element.attrib[key].split())
            element.set(key, _LONG_NUMBER.sub(lambda digits: f"{float(digits[0]):.2f}", words))


def _references(element: ElementTree.Element) -> list[str]:
    found = [match for value in element.attrib.values() for match in _REFERENCE.findall(value)]
    target = element.get("href", "")
    return [*found, target[1:]] if target.startswith("#") else found
