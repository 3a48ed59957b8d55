"""XML in which every element and every number knows its place, so that one number alone can be replaced."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from cpfls_cli.errors import InputError

_LARGEST = 20_000_000
_DEEPEST = 100
_HUGE = 1e30
"""No number of a model is as large, and products of smaller ones are numbers."""
_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*(/?)>")
_ATTRIBUTE = re.compile(rb"\s([^\s=]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
TEMPLATE = "a template; render it first (xacro FILE > rendered.urdf, or jinja), and give what comes out"
_WORD = re.compile(rb"\S+")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class Span:
    """Bytes of a file, from the first to behind the last."""

    file: Path
    start: int
    end: int


@dataclass(frozen=True)
class Stated:
    """A number of a model: its value in SI units, and its place.

    Attributes
    ----------
    where : str
        File, line and element; or what is taken where the file does not state it.
    span : Span or None
        Of the number itself; None where it is not stated.
    scale : float
        The number in the file over its value in SI units, to the power.
    power : int
        Of the value: -1 where the file states a reciprocal, such as a rate for a time constant.
    name : str
        As files write it; empty where its format has one name for it.
    also : tuple of Stated
        Other numbers, as the file has them, that change in proportion to that of the file, as the rest of a curve does.
    """

    value: float
    where: str
    span: Span | None = None
    scale: float = 1.0
    power: int = 1
    name: str = ""
    also: tuple[Stated, ...] = ()

    def written(self, value: float) -> float:
        """Give a value in SI units as the file states it."""
        return self.scale * value**self.power


@dataclass
class Node:
    """An element of XML with its place."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    start: int
    parent: Node | None
    children: list[Node] = field(default_factory=list)
    text: str = ""
    close: int = 0
    """Of its end tag; of one that is closed at once, of the element itself."""

    def all(self, *tags: str) -> list[Node]:
        """List the children of these names."""
        return [child for child in self.children if child.tag in tags]

    def first(self, *path: str) -> Node | None:
        """Find an element below, by the names on the way to it."""
        found: Node | None = self
        for tag in path:
            found = next((child for child in found.children if child.tag == tag), None) if found else None
        return found

    def walk(self) -> Iterator[Node]:
        """List the element and all below it."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def name(self) -> str:
        """Its attribute `name`."""
        return self.attributes.get("name", "")

    @property
    def where(self) -> str:
        """File, line and element, for messages and reasons."""
        own = f"<{self.tag}>" if not self.name else f"<{self.tag} name='{self.name}'>"
        owner = self.parent
        while owner is not None and not owner.name:
            owner = owner.parent
        below = f" of {owner.tag} {owner.name}" if owner is not None and not self.name else ""
        return f"{self.file.name} line {self.line}: {own}{below}"

    def error(self, message: str) -> InputError:
        """Make the error of this element."""
        return InputError(f"{self.file}, line {self.line}, <{self.tag}>: {message}")

    def numbers(
        self, attribute: str | None = None, count: int | None = None, scale: float = 1.0, usual: str = ""
    ) -> list[Stated]:
        """Read the numbers of its text, or of an attribute or what it is by default, each with its place."""
        text = self.text if attribute is None else self.attributes.get(attribute, usual)
        words, spans = text.split(), self.spans(attribute)
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self._no_number(text, attribute) from None
        if (count is not None and len(values) != count) or not all(abs(each) < _HUGE for each in values):
            raise self._no_number(text, attribute, count or 1)
        where = self.where if attribute is None else f"{self.where}, {attribute}"
        known = spans if len(spans) == len(values) else [None] * len(values)
        return [Stated(value / scale, where, span, scale) for value, span in zip(values, known, strict=True)]

    def number(self, attribute: str | None = None, scale: float = 1.0) -> Stated:
        """Read one number of its text, or of an attribute."""
        return self.numbers(attribute, 1, scale)[0]

    def _no_number(self, text: str, attribute: str | None, count: int = 1) -> InputError:
        of = "" if attribute is None else f"{attribute} = "
        wanted = "a number" if count == 1 else f"{count} numbers"
        template = f"; it is {TEMPLATE}" if any(mark in text for mark in ("{{", "${")) else f"; write {wanted} there"
        return self.error(f"{of}{text!r} is not {wanted}{template}")

    @property
    def opening(self) -> re.Match[bytes] | None:
        """Its first tag in the file; the group is the slash of one that is closed at once."""
        return _TAG.match(raw_bytes(self.file), self.start)

    def spans(self, attribute: str | None = None) -> list[Span | None]:
        """Find the words of its text, or of an attribute, in the file."""
        raw, tag = raw_bytes(self.file), self.opening
        if tag is None:
            return []
        if attribute is not None:
            named = (each for each in _ATTRIBUTE.finditer(tag[0]) if each[1] == attribute.encode())
            own = next(((each.start(each.lastindex or 0), each.end(each.lastindex or 0)) for each in named), (0, 0))
            first, last = (self.start + end for end in own) if own != (0, 0) else own
        else:
            first, last = tag.end(), self.close
        # Comments inside count as blanks, so that what follows keeps its place.
        inside = _COMMENT.sub(lambda found: b" " * len(found[0]), raw[first:last])
        return [Span(self.file, first + word.start(), first + word.end()) for word in _WORD.finditer(inside)]


_READ: dict[Path, bytes] = {}


def raw_bytes(file: Path) -> bytes:
    """Give the bytes of a file as they were read."""
    return _READ[file]


class _Builder:
    """Target of the parser: makes nodes."""

    def __init__(self, file: Path) -> None:
        self.file, self._open = file, list[Node]()
        self.expat: Any = None
        self.root: Node | None = None
        self.deepest = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        above = self._open[-1] if self._open else None
        at = self.expat
        node = Node(tag, dict(attributes), self.file, at.CurrentLineNumber, at.CurrentByteIndex, above)
        if above is None:
            self.root = node
        else:
            above.children.append(node)
        self._open.append(node)
        self.deepest = max(self.deepest, len(self._open))

    def end(self, _tag: str) -> None:
        self._open.pop().close = self.expat.CurrentByteIndex

    def data(self, text: str) -> None:
        if self._open:
            self._open[-1].text += text

    def close(self) -> Node | None:
        return self.root


def read_bytes(file: Path) -> bytes:
    """Read a file, and keep its bytes to correct them; InputError if it cannot be read, or is larger than any model."""
    try:
        with file.open("rb") as stream:
            raw = stream.read(_LARGEST + 1)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from None
    if len(raw) > _LARGEST:
        raise InputError(f"{file}: is larger than {_LARGEST / 1e6:g} MB, which no model is")
    _READ[file] = raw
    return raw


def read_xml(file: Path) -> Node:
    """Read a file of XML; entities and document types, which no model needs, are refused.

    InputError if it cannot be read, or is no XML.
    """
    raw = read_bytes(file)
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in raw[:4]:
        raise InputError(f"{file}: is in UTF-16; save it in UTF-8")
    builder = _Builder(file)
    parser = DefusedXMLParser(target=builder, forbid_dtd=True)
    builder.expat = parser.parser
    try:
        parser.feed(raw)
        root = parser.close()
    except DefusedXmlException:
        raise InputError(
            f"{file}: has a DOCTYPE or entities of its own, which no model needs and which can fill a memory; remove "
            "them"
        ) from None
    except (ValueError, LookupError):
        raise InputError(f"{file}: is in an encoding that cannot be read; save it in UTF-8") from None
    except ParseError as error:
        raise InputError(f"{file}: is no valid XML: {error}; correct it there") from None
    if builder.deepest > _DEEPEST:
        raise InputError(f"{file}: has {builder.deepest} elements in each other, which no model has; correct it there")
    assert isinstance(root, Node), "a file without an element is no XML"
    macro = next((each for each in root.walk() if re.match(r"\{http.*xacro\}", each.tag)), None)
    if macro is not None:
        raise InputError(f"{file}, line {macro.line}: is {TEMPLATE}")
    return root
