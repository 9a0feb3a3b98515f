"""XML of somebody else's: parsed without entities, below limits, every value checked.

An ``XmlElement`` knows its file and its place in it, so that each complaint names both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

from artgym.errors import AssetError, MissingDependencyError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

#: More elements than any description of at most 200 links needs.
MAX_ELEMENTS = 50_000
#: Bodies of MJCF lie in each other.
MAX_DEPTH = 256

_DECLARATION = re.compile(r"<\?xml[^>]*?encoding\s*=\s*[\"']([^\"']*)[\"']", re.DOTALL)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WRITE_UTF8 = "Save the file as UTF-8 and declare no other encoding."


def parse_xml(data: bytes, file: str) -> Element:
    """The root element of an XML document.

    Args:
        data: the document.
        file: what it is called in messages.

    Raises:
        AssetError: not well-formed, not UTF-8, too deep, too many elements, or with a document
            type, entities or external references.
        MissingDependencyError: defusedxml is not installed.
    """
    try:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import DefusedXMLParser, ParseError
    except ImportError:
        raise MissingDependencyError(
            "reading XML needs defusedxml: pip install 'defusedxml>=0.7'"
        ) from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise AssetError(
            file,
            "not UTF-8",
            element=f"byte {error.start}",
            value=data[error.start : error.start + 8],
            remedy=_WRITE_UTF8,
        ) from None
    declared = _DECLARATION.match(text.lstrip())
    # UTF-16 of Latin letters is UTF-8 with zeros, and the parser would recognise it.
    encoding = "UTF-16" if "\0" in text else declared[1] if declared else "utf-8"
    if encoding.lower() not in ("utf-8", "utf8", "ascii", "us-ascii"):
        raise AssetError(
            file,
            "an encoding other than UTF-8",
            element="XML declaration",
            value=encoding,
            remedy=_WRITE_UTF8,
        )
    parser = DefusedXMLParser(target=_limited_builder(file), encoding="utf-8", forbid_dtd=True)
    try:
        parser.feed(text)
        return parser.close()
    except DefusedXmlException as error:
        raise AssetError(
            file,
            "a document type, an entity or an external reference",
            element="prolog",
            value=type(error).__name__,
            remedy="Remove <!DOCTYPE ...> and write what its entities stand for.",
        ) from None
    except ParseError as error:
        line, column = error.position
        raise AssetError(
            file,
            f"not well-formed XML: {error}",
            element=f"line {line}, column {column}",
            remedy="Correct the file there, or copy it again if it is cut off.",
        ) from None


def _limited_builder(file: str) -> Any:
    """A tree builder that gives up on documents too deep or too long."""
    from xml.etree.ElementTree import TreeBuilder

    class Limited:
        def __init__(self) -> None:
            self._builder = TreeBuilder()
            self._count = self._depth = 0
            self.data = self._builder.data
            self.close = self._builder.close

        def start(self, tag: str, attributes: dict[str, str]) -> Element:
            # An attribute takes as much room as an element.
            self._count += 1 + len(attributes) // 16
            self._depth += 1
            if self._count > MAX_ELEMENTS or self._depth > MAX_DEPTH:
                what = "elements" if self._count > MAX_ELEMENTS else "levels of elements"
                limit = MAX_ELEMENTS if self._count > MAX_ELEMENTS else MAX_DEPTH
                raise AssetError(
                    file, f"more than {limit} {what}", element=f"<{tag}>", remedy="Simplify it."
                )
            return self._builder.start(tag, attributes)

        def end(self, tag: str) -> Element:
            self._depth -= 1
            return self._builder.end(tag)

    return Limited()


@dataclass(frozen=True)
class XmlElement:
    """An element of a document with its place in it.

    Attributes:
        element: the element.
        file: what the document is called in messages.
        place: what the element is called in messages: "joint 'hinge' axis".
    """

    element: Element
    file: str
    place: str

    @property
    def tag(self) -> str:
        """The element's name."""
        return self.element.tag

    def refuse(self, problem: str, *, remedy: str, value: object = None) -> NoReturn:
        """Raises an AssetError that names this element."""
        raise AssetError(self.file, problem, element=self.place, value=value, remedy=remedy)

    def named(self, place: str) -> XmlElement:
        """The same element, called otherwise in messages."""
        return XmlElement(self.element, self.file, place)

    def children(self, tag: str | None = None) -> list[XmlElement]:
        """Child elements, all or those of one name, called "<this> <tag>" in messages."""
        found = []
        for child in self.element:
            if isinstance(child.tag, str) and tag in (None, child.tag):
                found.append(XmlElement(child, self.file, f"{self.place} {child.tag}".strip()))
        return found

    def child(self, tag: str) -> XmlElement | None:
        """The only child of a name, or None.

        Raises:
            AssetError: there are several.
        """
        found = self.children(tag)
        if len(found) > 1:
            self.refuse(f"{len(found)} elements <{tag}>", remedy="Keep one of them.")
        return found[0] if found else None

    def required_child(self, tag: str) -> XmlElement:
        """The only child of a name.

        Raises:
            AssetError: there is none, or several.
        """
        found = self.child(tag)
        if found is None:
            self.refuse(f"no <{tag}>", remedy=f"Add the element <{tag}>.")
        return found

    def only_children(self, known: Iterable[str]) -> None:
        """Refuses children whose names are not known; those of other namespaces are passed over.

        Raises:
            AssetError: an unknown child; the message lists the known ones.
        """
        known = set(known)
        for child in self.children():
            if child.tag not in known and not child.tag.startswith("{"):
                self.refuse(
                    f"unknown element <{child.tag}>",
                    remedy=f"Remove it; known here: {', '.join(sorted(known))}.",
                )

    def text(self, key: str, default: str | None = None) -> str:
        """An attribute.

        Raises:
            AssetError: missing and without default, or empty.
        """
        value = self.element.get(key, default)
        if value is None or not value.strip():
            self.refuse(
                f"no attribute {key!r}" if value is None else f"an empty attribute {key!r}",
                remedy=f"Give {key}=.",
            )
        return value.strip()

    def name(self, key: str = "name") -> str:
        """An attribute that names something: printable, at most 128 characters.

        Raises:
            AssetError: missing or no such name.
        """
        value = self.text(key)
        if len(value) > 128 or not value.isprintable():
            self.refuse(
                f"{key}= is no name",
                value=value,
                remedy="Use at most 128 printable characters.",
            )
        return value

    def numbers(
        self, key: str, count: int, default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """An attribute of finite numbers.

        Raises:
            AssetError: missing and without default, another count of numbers, or not finite.
        """
        if self.element.get(key) is None and default is not None:
            return default
        value = self.text(key)
        tokens = value.split(maxsplit=count)
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        numbers = tuple(
            float(t) if len(t) <= 64 and _NUMBER.fullmatch(t) else math.nan for t in tokens
        )
        if len(numbers) != count or not all(math.isfinite(n) for n in numbers):
            self.refuse(
                f"{key}= is not {expected}", value=value, remedy=f"Give {key}= as {expected}."
            )
        return numbers

    def number(self, key: str, default: float | None = None) -> float:
        """An attribute of one finite number.

        Raises:
            AssetError: as for ``numbers``.
        """
        return self.numbers(key, 1, None if default is None else (default,))[0]

    def positive(self, key: str, count: int = 1) -> tuple[float, ...]:
        """An attribute of finite numbers above zero.

        Raises:
            AssetError: as for ``numbers``, or not above zero.
        """
        numbers = self.numbers(key, count)
        if min(numbers) <= 0:
            self.refuse(
                f"{key}= is not above zero",
                value=self.text(key),
                remedy=f"Give {key}= in SI units, above zero.",
            )
        return numbers
