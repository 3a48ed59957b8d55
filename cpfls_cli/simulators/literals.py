"""Numbers in text with their places: Python that only states numbers, TOML and JSON of numbers, and ``#define`` of C.

All of them are read as expressions of Python, which none of them is executed as: literals, arrays of them, arithmetic,
names that were assigned before, and constants and elementary functions of NumPy. Whatever else a file has is refused.
A number that is written as a literal has its place; of one that is an expression, the place is that of the expression.
"""

from __future__ import annotations

import ast
import json
import math
import operator
import re
import tomllib
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import Span, Stated, read_bytes

_MOST = 10_000
"""Numbers of a file; lists of lists grow without end in a few lines."""
_TOO_MANY = "more numbers than a vehicle has"
_TWO: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_ONE: dict[type, Callable[[Any], Any]] = {ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.not_}
_FUNCTIONS = {name: getattr(np, name) for name in ("sqrt", "sin", "cos", "tan", "radians", "deg2rad")}
_ARRAYS = ("array", "asarray")
_MODULES = ("numpy", "math")
_WORDS = {"true": True, "false": False, "null": None, "inf": math.inf, "nan": math.nan}
"""Of JSON and TOML."""
Key = tuple[str | int, ...]


class _RefusedError(Exception):
    """What a file has that states no number."""

    def __init__(self, node: ast.AST, what: str) -> None:
        super().__init__(what)
        self.line = getattr(node, "lineno", 1)


@dataclass
class Numbers:
    """The numbers of a file by the names on the way to each, and how to say where they are."""

    file: Path
    found: dict[Key, Stated] = field(default_factory=dict)

    def get(self, *key: str | int, scale: float = 1.0) -> Stated | None:
        """Find a number; `scale` is that in the file over its value in SI units."""
        own = self.found.get(key)
        return None if own is None else Stated(own.value / scale, own.where, own.span, scale, name=own.name)

    def need(self, *key: str | int, scale: float = 1.0) -> Stated:
        """Find a number that a vehicle has to have."""
        own = self.get(*key, scale=scale)
        if own is None:
            raise InputError(f"{self.file}: states no {written(key)}; write a number for it")
        return own

    def count(self, *key: str | int) -> int:
        """Count what is listed under a name."""
        return len(self.below(*key))

    def below(self, *key: str | int) -> list[str | int]:
        """List the names under one, in the order of the file."""
        return list(
            dict.fromkeys(own[len(key)] for own in self.found if own[: len(key)] == key and len(own) > len(key))
        )

    def row(self, *key: str | int, count: int, scale: float = 1.0) -> list[Stated]:
        """Find a list of numbers."""
        if self.count(*key) != count:
            raise InputError(f"{self.file}: {written(key)} has {self.count(*key)} numbers; write {count}")
        return [self.need(*key, place, scale=scale) for place in range(count)]


def written(key: Key) -> str:
    """Write the names on the way to a number as files do."""
    first, *rest = key
    return str(first) + "".join(f"[{each}]" if isinstance(each, int) else f".{each}" for each in rest)


@dataclass
class Expressions:
    """Expressions of one file, evaluated in the order in which they are written.

    Attributes
    ----------
    start : callable
        From a line, from 1, and a column of the text that is parsed to the byte of the file.
    """

    file: Path
    start: Callable[[int, int], int]
    nodes: dict[str, ast.expr] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    modules: set[str] = field(default_factory=set)
    visited: int = 0

    def assign(self, name: str, node: ast.expr) -> None:
        """Take note of a name, whose value is evaluated now."""
        if not isinstance(node, ast.Dict):
            self.values[name] = self.value(node)
        self.nodes[name] = node

    def value(self, node: ast.expr) -> Any:
        """Evaluate what is a number, or an array of them."""
        with np.errstate(all="raise", under="ignore"):
            return self._value(node)

    def _value(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=bool() | str() | None):
                return node.value
            case ast.Constant(value=int() | float() as number):
                return float(number)
            case ast.Name(id=name) if name in self.values:
                return self.values[name]
            case ast.Name(id=name) if name in _WORDS:
                return _WORDS[name]
            case ast.Attribute(value=ast.Name(id=module), attr="pi") if module in self.modules:
                return math.pi
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _ONE:
                return _ONE[type(op)](self._number(operand))
            case ast.BinOp(left=left, op=op, right=right) | ast.Compare(left=left, ops=[op], comparators=[right]) if (
                type(op) in _TWO
            ):
                first, second = self._number(left), self._number(right)
                if math.prod(np.broadcast_shapes(np.shape(first), np.shape(second))) > _MOST:
                    raise _RefusedError(node, _TOO_MANY)
                return _TWO[type(op)](first, second)
            case ast.BoolOp(op=op, values=parts):
                return (all if isinstance(op, ast.And) else any)([bool(self.value(part)) for part in parts])
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return self._array(node, [self.value(part) for part in parts])
        called = self._called(node)
        if called is not None and called[0] in _ARRAYS:
            return np.asarray(self.value(called[1]), dtype=float)
        if called is not None:
            return _FUNCTIONS[called[0]](self._number(called[1]))
        raise _RefusedError(node, f"{_short(node)} is no number, nor arithmetic of them")

    def _array(self, node: ast.expr, parts: list[Any]) -> Any:
        if any(part is None or isinstance(part, str) for part in parts):
            return parts
        if sum(np.size(part) for part in parts) > _MOST:
            raise _RefusedError(node, _TOO_MANY)
        # Of lists, sums and multiples are longer lists, so none of them is an array.
        return np.array(parts, dtype=float).tolist()

    def _number(self, node: ast.expr) -> Any:
        value = self.value(node)
        if value is None or isinstance(value, str | list):
            raise _RefusedError(node, f"{_short(node)} is no number")
        return np.asarray(value, dtype=float)[()]

    def _called(self, node: ast.expr) -> tuple[str, ast.expr] | None:
        match node:
            case ast.Call(func=ast.Attribute(value=ast.Name(id=module), attr=name), args=[one]) if (
                module in self.modules and (name in _FUNCTIONS or name in _ARRAYS)
            ):
                return name, one
        return None

    def leaves(self, node: ast.expr, key: Key) -> Iterator[tuple[Key, Stated]]:
        """List the numbers of an expression, each with its place."""
        if isinstance(node, ast.Name) and isinstance(self.nodes.get(node.id), ast.Dict | ast.List | ast.Call):
            node = self.nodes[node.id]
        self.visited += 1
        if self.visited > _MOST:
            raise _RefusedError(node, _TOO_MANY)
        called = self._called(node)
        inner = called[1] if called is not None and called[0] in _ARRAYS else node
        if isinstance(inner, ast.Dict):
            for name, each in zip(inner.keys, inner.values, strict=True):
                if not isinstance(name, ast.Constant) or not isinstance(name.value, str):
                    raise _RefusedError(inner, "a key that is no text")
                yield from self.leaves(each, (*key, name.value))
        elif isinstance(inner, ast.List | ast.Tuple):
            for place, each in enumerate(inner.elts):
                yield from self.leaves(each, (*key, place))
        else:
            yield from self._leaf(node, key)

    def _leaf(self, node: ast.expr, key: Key) -> Iterator[tuple[Key, Stated]]:
        value, where = self.value(node), f"{self.file.name} line {node.lineno}: "
        if value is None or isinstance(value, str | list):
            return
        if np.ndim(value):
            for place in np.ndindex(np.shape(value)):
                name = written((*key, *place))
                yield (*key, *place), Stated(float(value[place]), f"{where}{name} (an expression)", name=name)
            return
        if not abs(value) < math.inf:
            raise _RefusedError(node, f"{written(key)} is {value:g}")
        ends = self.start(node.lineno, node.col_offset), self.start(node.end_lineno or 0, node.end_col_offset or 0)
        yield key, Stated(float(value), where + written(key), Span(self.file, *ends), name=written(key))


def _short(node: ast.AST) -> str:
    text = ast.unparse(node)
    return text if len(text) < 40 else f"{text[:37]}..."


def _tree(text: str, mode: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        return ast.parse(text, mode=mode)


def _parsed(file: Path, text: str, mode: str, what: str) -> Any:
    try:
        return _tree(text, mode)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
        raise InputError(f"{file}{line}: is no {what} that can be read; correct it there") from None


def _collected(expressions: Expressions, parts: Iterator[tuple[Key, ast.expr]], remedy: str) -> Numbers:
    """Collect the numbers of named expressions; what none of them is said with its line."""
    numbers = Numbers(expressions.file)
    try:
        for key, node in parts:
            numbers.found.update(expressions.leaves(node, key))
    except _RefusedError as error:
        raise InputError(f"{expressions.file}, line {error.line}: {error}; {remedy}") from None
    except (ArithmeticError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{expressions.file}: has arithmetic that fails ({error}); {remedy}") from None
    return numbers


def _text_of(file: Path) -> tuple[str, Callable[[int, int], int]]:
    """Read a text, and what gives the byte of a line and a column of it."""
    raw = read_bytes(file)
    bom = 3 if raw.startswith(b"\xef\xbb\xbf") else 0
    try:
        text = raw[bom:].decode()
    except UnicodeDecodeError:
        raise InputError(f"{file}: is not in UTF-8; save it so") from None
    if "\0" in text or "\f" in text:
        raise InputError(f"{file}: is no text; give the file of a vehicle")
    starts = [bom, *(bom + end.end() for end in re.finditer(rb"\r\n|\r|\n", raw[bom:]))]
    return text, lambda line, column: starts[line - 1] + column


def python_numbers(file: Path) -> Numbers:
    """Read a module that states numbers, and does nothing else."""
    remedy = "only numbers, arrays and arithmetic of constants are read, and nothing of the file is executed"
    text, start = _text_of(file)
    tree, names = _parsed(file, text, "exec", "Python"), Expressions(file, start)

    def parts() -> Iterator[tuple[Key, ast.expr]]:
        for line in tree.body:
            match line:
                case ast.Expr(value=ast.Constant(value=str())):
                    continue
                case ast.Import(names=imported) if all(each.name in _MODULES for each in imported):
                    names.modules |= {each.asname or each.name for each in imported}
                case (
                    ast.Assign(targets=[ast.Name(id=name)], value=node)
                    | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as node)
                ) if name not in names.nodes:
                    names.assign(name, node)
                    yield (name,), node
                case _:
                    raise _RefusedError(line, f"{_short(line)} states no number, or one twice")

    return _collected(names, parts(), remedy)


def json_numbers(file: Path) -> Numbers:
    """Read an object of JSON, with comments behind ``#`` as ArduPilot takes them out."""
    text, start = _text_of(file)
    try:
        held = json.loads(re.sub(r"#[^\r\n]*", "", text))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: is no valid JSON: {error}; correct it there") from None
    if not isinstance(held, dict):
        raise InputError(f"{file}: is no object of JSON with the parameters of a frame; give one")
    tree = _parsed(file, f"({text}\n)", "eval", "JSON")
    names = Expressions(file, lambda line, column: start(line, column - (line == 1)))
    parts = iter([((), tree.body)])
    return _collected(names, parts, "write numbers there")


def toml_numbers(file: Path) -> Numbers:
    """Read TOML of numbers in sections."""
    text, start = _text_of(file)
    try:
        held = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{file}: is no valid TOML: {error}; correct it there") from None
    tree, names = _parsed(file, text, "exec", "TOML of plain numbers in sections"), Expressions(file, start)

    lines = text.split("\n")

    def parts() -> Iterator[tuple[Key, ast.expr]]:
        section: Key = ()
        for line in tree.body:
            match line:
                case ast.Expr(value=ast.List(elts=[_])):
                    header = lines[line.lineno - 1].partition("]")[0]
                    section = tuple(each.strip(" \t\"'") for each in header.strip(" \t[").split("."))
                case ast.Assign(targets=[ast.Name(id=name)], value=node):
                    yield (*section, name), node
                case _:
                    raise _RefusedError(line, f"{_short(line)} is no number of a section")

    numbers = _collected(names, parts(), "write plain numbers in sections, without quotes or dashes in names")
    if any(_at(held, key) != each.value for key, each in numbers.found.items()):
        raise InputError(f"{file}: has numbers that are written in a way which is not read; write them in decimals")
    return numbers


def _at(held: Any, key: Key) -> Any:
    for each in key:
        if isinstance(held, list):
            held = held[each] if isinstance(each, int) and each < len(held) else None
        else:
            held = held.get(each) if isinstance(held, dict) else None
    return held


_DIRECTIVE = re.compile(r"[ \t]*#[ \t]*(\w+)[ \t]*([^\r\n]*)")
_DEFINED = re.compile(r"defined\s*\(?\s*(\w+)\s*\)?")
_COMMENT = re.compile(r"//[^\r\n]*|/\*.*?\*/", re.DOTALL)
_SUFFIX = re.compile(r"(?<=[\d.])[fFlLuU]+\b")
_OF_C = ((r"&&", " and "), (r"\|\|", " or "), (r"!(?!=)", " not "))


def header_numbers(file: Path, options: Sequence[str]) -> Numbers:
    """Read what a header of C defines where options are defined and nothing else is."""
    # A character for a byte; comments and suffixes count as blanks, so that what follows keeps its place.
    plain = _COMMENT.sub(lambda own: re.sub(r"[^\r\n]", " ", own[0]), read_bytes(file).decode("latin-1"))
    plain = _SUFFIX.sub(lambda own: " " * len(own[0]), plain)
    numbers, defined, branches = Numbers(file), set(options), list[tuple[bool, bool]]()
    names, place = Expressions(file, lambda _line, column: column), 0
    names.values.update(dict.fromkeys(options, 1.0))
    for line, own in enumerate(plain.splitlines(keepends=True), 1):
        found, place = _DIRECTIVE.match(own), place + len(own)
        if found is None:
            continue
        word, rest = found[1], found[2].rstrip()
        if word == "define" and all(holds for holds, _ in branches):
            _define(numbers, names, defined, rest, line, place - len(own) + found.start(2))
        elif word in ("if", "ifdef", "ifndef"):
            branches.append((False, not all(holds for holds, _ in branches)))
        elif word == "endif" and branches:
            branches.pop()
        if word in ("if", "ifdef", "ifndef", "elif", "else") and branches:
            # Of each level whether its branch holds, and whether one did before.
            before = branches[-1][1]
            holds = not before and (word == "else" or _holds(names, defined, word, rest, line))
            branches[-1] = (holds, before or holds)
    return numbers


def _define(numbers: Numbers, names: Expressions, defined: set[str], rest: str, line: int, place: int) -> None:
    found = re.fullmatch(r"(\w+)(?:\s+(\S.*))?", rest)
    if found is None:
        return
    defined.add(found[1])
    if found[2] is None:
        return
    names.start = lambda _line, column: place + found.start(2) + column
    try:
        node = ast.increment_lineno(_tree(found[2], "eval"), line - 1).body
        names.values[found[1]] = names.value(node)
        numbers.found.update(names.leaves(node, (found[1],)))
    except (_RefusedError, SyntaxError, ArithmeticError, ValueError, TypeError, RecursionError, MemoryError):
        # Strings, casts and the like, which no vehicle is made of.
        names.values.pop(found[1], None)


def _holds(names: Expressions, defined: set[str], word: str, rest: str, line: int) -> bool:
    if word in ("ifdef", "ifndef"):
        return (rest.strip() in defined) == (word == "ifdef")
    text = _DEFINED.sub(lambda own: str(int(own[1] in defined)), rest)
    for pattern, other in _OF_C:
        text = re.sub(pattern, other, text)
    # What is not defined counts as 0.
    text = re.sub(r"\b[A-Za-z_]\w*", lambda own: own[0] if own[0] in {*names.values, "and", "or", "not"} else "0", text)
    try:
        return bool(names.value(_tree(text.strip(), "eval").body))
    except (_RefusedError, SyntaxError, ArithmeticError, ValueError, TypeError, RecursionError, MemoryError):
        raise InputError(f"{names.file}, line {line}: the condition {rest!r} is not understood; resolve it") from None


def with_comment(file: Path, raw: bytes, lines: Sequence[str]) -> bytes:
    """Put a comment at the top of a file, behind lines that begin with ``#``; none into JSON that has none."""
    end = "\r\n" if b"\r\n" in raw else "\n"
    if file.suffix.lower() == ".h":
        text = end.join(lines).replace("*/", "* /")
        return f"/* {text} */{end}".encode() + raw
    if file.suffix.lower() == ".json" and not re.search(rb"^[ \t]*#", raw, re.MULTILINE):
        return raw
    # A byte order mark, an interpreter and an encoding stay first.
    first = re.match(rb"(?:\xef\xbb\xbf)?(?:#[^\r\n]*(?:\r\n|\r|\n))*", raw)
    at = first.end() if first else 0
    return raw[:at] + "".join(f"# {line}{end}" for line in lines).encode() + raw[at:]
