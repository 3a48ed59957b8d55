"""Symbols that record what is computed with them, and write it in a language: plain Python, C99, JAX, CasADi.

What is computed twice is computed once, what no result needs is left out, and numbers that are known are folded in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

from cpfls_cli.vehicle.values import Each, Functions, Value, plus

_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "sqrt": math.sqrt,
    "exp": math.exp,
    "sin": math.sin,
    "cos": math.cos,
    "atan2": math.atan2,
    "floor": math.floor,
    "abs": abs,
}


class Graph:
    """Operations in the order in which they were made, each with its arguments by their places."""

    def __init__(self) -> None:
        self.nodes: list[tuple[Any, ...]] = []
        self._places: dict[tuple[Any, ...], int] = {}

    def node(self, *operation: Any) -> Symbol:
        """Record an operation, or find it."""
        place = self._places.setdefault(operation, len(self.nodes))
        if place == len(self.nodes):
            self.nodes.append(operation)
        return Symbol(self, place)

    def given(self, value: Symbol, *operation: Any) -> None:
        """Say what an operation gives, before it is recorded."""
        self._places[operation] = value.place

    def inputs(self, name: str, count: int) -> tuple[Symbol, ...]:
        """Make arguments of the function that is traced."""
        return tuple(self.node("input", f"{name}{index}") for index in range(count))


class Symbol:
    """A number that is not known yet."""

    __slots__ = ("graph", "place")
    __array_ufunc__ = None

    def __init__(self, graph: Graph, place: int) -> None:
        self.graph, self.place = graph, place

    def made(self, name: str, *arguments: Value) -> Symbol:
        """Record an operation on numbers."""
        places = (x.place if isinstance(x, Symbol) else self.graph.node("number", float(x)).place for x in arguments)
        return self.graph.node(name, *places)

    def _by(self, name: str, a: Value, b: Value) -> Value:
        other = a if b is self else b
        if isinstance(other, Each):
            return NotImplemented
        if isinstance(other, (int, float)):
            if (name in "+-" and other == 0 and b is other) or (name in "*/" and other == 1 and b is other):
                return self
            if (name == "+" and other == 0) or (name == "*" and other == 1):
                return self
            if other == 0 and (name == "*" or (name == "/" and a is other)):
                return 0
        return self.made(name, a, b)

    def __add__(self, other: Value) -> Value:
        return self._by("+", self, other)

    def __radd__(self, other: Value) -> Value:
        return self._by("+", other, self)

    def __sub__(self, other: Value) -> Value:
        return self._by("-", self, other)

    def __rsub__(self, other: Value) -> Value:
        return self._by("-", other, self)

    def __mul__(self, other: Value) -> Value:
        return self._by("*", self, other)

    def __rmul__(self, other: Value) -> Value:
        return self._by("*", other, self)

    def __truediv__(self, other: Value) -> Value:
        return self._by("/", self, other)

    def __rtruediv__(self, other: Value) -> Value:
        return self._by("/", other, self)

    def __lt__(self, other: Value) -> Value:
        return self._by("<", self, other)

    def __gt__(self, other: Value) -> Value:
        return self._by(">", self, other)

    def __neg__(self) -> Symbol:
        return self.made("negative", self)

    def __pow__(self, power: float) -> Value:
        if power in (2, 3):
            return self * self if power == 2 else self * self * self
        return self.made("**", self, power)


def _called(name: str, *arguments: Value) -> Value:
    if isinstance(arguments[0], Each):
        return Each(_called(name, one, *arguments[1:]) for one in arguments[0])
    for argument in arguments:
        if isinstance(argument, Symbol):
            return argument.made(name, *arguments)
    return _FUNCTIONS[name](*arguments)


def _where(condition: Value, yes: Value, no: Value) -> Value:
    if isinstance(condition, Each):
        ends = [one.values if isinstance(one, Each) else (one,) * len(condition.values) for one in (yes, no)]
        return Each(map(_where, condition.values, *ends))
    if not isinstance(condition, Symbol):
        return yes if condition else no
    if isinstance(yes, Each) or isinstance(no, Each):
        count = len(yes.values if isinstance(yes, Each) else no.values)
        return _where(Each((condition,) * count), yes, no)
    return condition.made("where", condition, yes, no)


def _total(x: Value) -> Value:
    return plus(*x.values) if isinstance(x, Each) else x


SYMBOLS = Functions(
    sqrt=partial(_called, "sqrt"),
    exp=partial(_called, "exp"),
    sin=partial(_called, "sin"),
    cos=partial(_called, "cos"),
    arctan2=partial(_called, "atan2"),
    floor=partial(_called, "floor"),
    absolute=partial(_called, "abs"),
    where=_where,
    largest=lambda a, b: _where(a > b, a, b),
    smallest=lambda a, b: _where(a < b, a, b),
    rotors=Each,
    total=_total,
)
"""Functions of symbols; of floats they give floats."""


def traced(
    graph: Graph, arguments: Mapping[str, Sequence[Symbol]], results: Sequence[Sequence[Value]]
) -> Callable[..., Any]:
    """Make a function of what was recorded.

    Parameters
    ----------
    arguments : mapping of str to sequence of Symbol
        Inputs by the name of the argument that holds them as a tuple.
    results : sequence of sequence of value
        What it gives: a tuple of tuples.
    """
    return _compiled(python_source(graph, arguments, results))


@lru_cache(maxsize=32)
def _compiled(source: str) -> Callable[..., Any]:
    names: dict[str, Any] = {**_FUNCTIONS, "inf": math.inf, "nan": math.nan}
    exec(compile(source, "<traced>", "exec"), names)
    return names["step"]  # type: ignore[no-any-return]


class Language(NamedTuple):
    """How operations are written.

    Attributes
    ----------
    operations : mapping of str to str
        By the name of what is no function of the same name.
    line, number, function, comment : str
        A statement with a name and an expression, a number, a function with its name, a remark.
    longest : int
        Characters of an expression, beyond which it gets a line of its own.
    """

    operations: Mapping[str, str]
    line: str = "{} = {}"
    number: str = "({!r})"
    function: str = "{}"
    comment: str = "# {}"
    longest: int = 160

    def written(self, name: str, arguments: Sequence[str]) -> str:
        """Write an operation."""
        form = self.operations.get(name) or _OPERATORS.get(name)
        return form.format(*arguments) if form else f"{self.function.format(name)}({', '.join(arguments)})"


_OPERATORS = {name: f"({{}} {name} {{}})" for name in ("+", "-", "*", "/", "<", ">", "**")} | {"negative": "(-{})"}
PYTHON = Language({"where": "({1} if {0} else {2})"})
C = Language(
    {"where": "({} ? {} : {})", "**": "MATH(pow)({}, {})", "abs": "MATH(fabs)({})"},
    line="const real {} = {};",
    number="R({!r})",
    function="MATH({})",
    comment="/* {} */",
    longest=80,
)
"""With the macros of the export: ``R`` of a number, ``MATH`` of a function."""
LIBRARY = Language({"sqrt": "_length({})", "atan2": "_direction({}, {})"}, function="_{}", longest=80)
"""JAX or CasADi, by functions of the export that hide which, and have derivatives where there is no airflow."""


def python_source(graph: Graph, arguments: Mapping[str, Sequence[Symbol]], results: Sequence[Sequence[Value]]) -> str:
    """Write what `traced` makes as text: a function called ``step``."""
    flat = [x for group in results for x in group]
    lines, texts = written(graph, flat, PYTHON)
    named = {name: [graph.nodes[x.place][1] for x in group] for name, group in arguments.items()}
    unpacked = [f"{', '.join(names)}, = {name}" for name, names in named.items() if names]
    text = iter(texts)
    groups = (_tuple(next(text) for _ in group) for group in results)
    body = "\n    ".join([*unpacked, *lines, f"return {_tuple(groups)}"])
    return f"def step({', '.join(arguments)}):\n    {body}\n"


def written(
    graph: Graph, results: Sequence[Value], language: Language, parts: Mapping[int, str] | None = None
) -> tuple[list[str], list[str]]:
    """Write what was recorded: lines, and expressions of the results in terms of them.

    Parameters
    ----------
    parts : mapping of int to str, optional
        What is said before the operations that begin at a place.
    """
    uses = _uses(graph, [x.place for x in results if isinstance(x, Symbol)])
    text: dict[int, str] = {}
    lines: list[str] = []
    said = ""
    for place, (name, *inner) in enumerate(graph.nodes):
        said = (parts or {}).get(place, said)
        if not uses[place]:
            continue
        if name in ("input", "number"):
            text[place] = inner[0] if name == "input" else language.number.format(inner[0])
            continue
        text[place] = language.written(name, [text[each] for each in inner])
        if uses[place] > 1 or len(text[place]) > language.longest:
            lines += [language.comment.format(said)] if said else []
            lines.append(language.line.format(f"t{place}", text[place]))
            text[place], said = f"t{place}", ""
    return lines, [text[x.place] if isinstance(x, Symbol) else language.number.format(float(x)) for x in results]


def used(graph: Graph, results: Sequence[Value]) -> set[str]:
    """Name the inputs that results need."""
    uses = _uses(graph, [x.place for x in results if isinstance(x, Symbol)])
    return {node[1] for node, count in zip(graph.nodes, uses, strict=True) if count and node[0] == "input"}


def _tuple(items: Iterable[str]) -> str:
    return f"({''.join(f'{item}, ' for item in items)})"


def _uses(graph: Graph, results: Sequence[int]) -> list[int]:
    """Count how often each operation is needed for the results."""
    uses = [0] * len(graph.nodes)
    waiting = [*results]
    while waiting:
        place = waiting.pop()
        uses[place] += 1
        if uses[place] == 1 and graph.nodes[place][0] not in ("input", "number"):
            waiting.extend(graph.nodes[place][1:])
    return uses
