"""Symbols that record what is computed with them, and write it in a language: plain Python, NumPy, C99, JAX, CasADi.

What is computed twice is computed once, what no result needs is left out, and numbers that are known are folded in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.values import Each, Functions, Tangent, Value, differentiable, plus

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
        self.by_rotor: set[int] = set()
        """Arrays with one value for each rotor."""
        self.rotors = 0

    def node(self, *operation: Any) -> Symbol:
        """Record an operation, or find it."""
        place = self._places.setdefault(operation, len(self.nodes))
        if place == len(self.nodes):
            self.nodes.append(operation)
            name, *inner = operation
            if name == "array" or (name not in _OF_ALL_ROTORS and not self.by_rotor.isdisjoint(inner)):
                self.by_rotor.add(place)
        return Symbol(self, place)

    def known(self, value: Value) -> Symbol:
        """Record a number, or one for each rotor, shape (rotor, 1)."""
        if isinstance(value, Symbol):
            return value
        if isinstance(value, np.ndarray):
            return self.node("array", *value.ravel().tolist())
        return self.node("number", float(value))

    def given(self, value: Symbol, *operation: Any) -> None:
        """Say what an operation gives, before it is recorded."""
        self._places[operation] = value.place

    def inputs(self, name: str, count: int, *, rotors: int = 0) -> tuple[Symbol, ...]:
        """Make arguments of the function that is traced, with one value for each of so many rotors."""
        made = tuple(self.node("input", f"{name}{index}") for index in range(count))
        self.by_rotor.update(x.place for x in made if rotors)
        self.rotors = rotors or self.rotors
        return made


def _operators(name: str) -> tuple[Callable[[Symbol, Value], Value], Callable[[Symbol, Value], Value]]:
    """Make the operator of a symbol with another number, and that of another number with a symbol."""
    return lambda self, other: self.by(name, self, other), lambda self, other: self.by(name, other, self)


class Symbol:
    """A number that is not known yet."""

    __slots__ = ("graph", "place")
    __array_ufunc__ = None

    def __init__(self, graph: Graph, place: int) -> None:
        self.graph, self.place = graph, place

    def made(self, name: str, *arguments: Value) -> Symbol:
        """Record an operation on numbers."""
        known = self.graph.known
        return self.graph.node(name, *[x.place if x.__class__ is Symbol else known(x).place for x in arguments])

    def by(self, name: str, a: Value, b: Value) -> Value:
        """Record an operation of which it is one side, unless another number makes it nothing."""
        other = a if b is self else b
        if other.__class__ is Symbol:
            return self._of_two(name, a, b)
        if isinstance(other, (Each, Tangent)):
            return NotImplemented
        if isinstance(other, (int, float)):
            if (name in "+-" and other == 0 and b is other) or (name in "*/" and other == 1 and b is other):
                return self
            if (name == "+" and other == 0) or (name == "*" and other == 1):
                return self
            if other == 0 and (name == "*" or (name == "/" and a is other)):
                return 0
        return self.made(name, a, b)

    def _of_two(self, name: str, a: Symbol, b: Symbol) -> Symbol:
        """Record an operation on symbols; what is subtracted is not made negative to be added."""
        nodes, places = self.graph.nodes, (a.place, b.place)
        if name in "+-":
            if nodes[b.place][0] == "negative":
                return self._of_two("-" if name == "+" else "+", a, Symbol(self.graph, nodes[b.place][1]))
            if name == "+" and nodes[a.place][0] == "negative":
                places = b.place, nodes[a.place][1]
                name = "-"
        return self.graph.node(name, *places)

    __add__, __radd__ = _operators("+")
    __sub__, __rsub__ = _operators("-")
    __mul__, __rmul__ = _operators("*")
    __truediv__, __rtruediv__ = _operators("/")
    __lt__ = _operators("<")[0]
    __gt__ = _operators(">")[0]

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


def _by_numpy(name: str) -> Callable[..., Value]:
    def called(*arguments: Value) -> Value:
        for argument in arguments:
            if isinstance(argument, Symbol):
                return argument.made(name, *arguments)
        return getattr(np, _NUMPY.get(name, name))(*arguments)

    return called


def _by_rotor(values: Iterable[Value]) -> Value:
    column = np.array([*values], dtype=float)[:, None]
    return column if column.any() else 0


def array_symbols(rotors: int) -> Functions:
    """Give functions of symbols for arrays, and of such with derivatives.

    Their first axis is that of the rotors where there is one value for each of them.
    """

    def total(x: Value) -> Value:
        if not isinstance(x, Symbol):
            return float(x.sum()) if isinstance(x, np.ndarray) else rotors * x
        return x.made("total", x) if x.place in x.graph.by_rotor else rotors * x

    names = ("sqrt", "exp", "sin", "cos", "floor", "where")
    plain = Functions(
        **{name: _by_numpy(name) for name in names},
        arctan2=_by_numpy("atan2"),
        absolute=_by_numpy("abs"),
        largest=_by_numpy("largest"),
        smallest=_by_numpy("smallest"),
        rotors=_by_rotor,
        total=total,
    )
    return differentiable(plain, lambda value, _: value)


def traced(
    graph: Graph, arguments: Mapping[str, Sequence[Symbol]], results: Sequence[Sequence[Value]]
) -> Callable[..., Any]:
    """Make a function of what was recorded, of floats: a tuple of tuples from inputs by the name of their tuple."""
    return _compiled(python_source(graph, arguments, results))["step"]  # type: ignore[no-any-return]


def traced_in_two(
    graph: Graph,
    first: tuple[str, Sequence[Symbol]],
    arguments: Mapping[str, Sequence[Symbol]],
    results: Sequence[Sequence[Value]],
    *,
    short: bool = False,
) -> Callable[..., Callable[..., Any]]:
    """Make a function of one argument that gives a function of the others, of arrays; see `traced`.

    What depends on the first one alone is computed once. `short`: of arrays of few values, for which it is worth longer
    compiling.
    """
    places = [[graph.known(x).place for x in group] for group in results]
    early = {x.place for x in first[1]}
    for place, (name, *inner) in enumerate(graph.nodes):
        if name in _GIVEN[1:] or (name not in _GIVEN and early.issuperset(inner)):
            early.add(place)
    uses = _uses(graph, [*chain(*places)], early)
    known = {place: f"known{place}" for place in sorted(early) if uses[place]}
    lines, texts = written(graph, [Symbol(graph, place) for place in known], ARRAYS)
    lines += [f"{name} = array({text})" for name, text in zip(known.values(), texts, strict=True)]
    unpacked = f"{', '.join(graph.nodes[x.place][1] for x in first[1])}, = {first[0]}" if first[1] else ""
    if short:
        step = [*_InPlace(graph, known, uses, places).written(arguments)]
    else:
        step = python_source(graph, arguments, results, ARRAYS, known).splitlines()
    body = "\n    ".join([unpacked, *lines, *step, "return step"])
    return _compiled(f"def made({first[0]}):\n    {body}\n", arrays=True)["made"]  # type: ignore[no-any-return]


_IN_PLACE = {name: name for name in ("negative", "sqrt", "exp", "sin", "cos", "floor")}
_IN_PLACE |= {"+": "add", "-": "subtract", "*": "multiply", "/": "divide", "total": "add"}
_IN_PLACE |= {"abs": "absolute", "atan2": "arctan2"}
"""Functions of NumPy that write into an array that is there."""


class _InPlace:
    """A function of arrays that computes in arrays made once for a size, each again as soon as it is free.

    A short operation of NumPy takes twice as long where it makes its result, and three times as long where one value
    for all rotors meets one for each: those are computed rotor by rotor. What the function gives is made anew.
    """

    def __init__(
        self, graph: Graph, known: Mapping[int, str], uses: list[int], results: Sequence[Sequence[int]]
    ) -> None:
        self._graph, self._known, self._uses, self._results = graph, known, uses, results
        self._rotors, self._text, self._kept = range(graph.rotors), dict(known), {*chain(*results)}
        self._lines: list[str] = []
        # Names of arrays with one value, then of those with one for each rotor; all that were made, and those free.
        self._made: tuple[dict[str, None], dict[str, None]] = {}, {}
        self._free: tuple[list[str], list[str]] = [], []
        # What is taken rotor by rotor although it is none of these, and constants of rotors taken over the size.
        self._split: dict[str, None] = {}
        self._spread: dict[str, None] = {}
        for place, (name, *inner) in enumerate(graph.nodes):
            if self._uses[place] and place not in known:
                self._text[place] = inner[0] if name == "input" else self._write(place, name, inner)

    def written(self, arguments: Mapping[str, Sequence[Symbol]]) -> Iterator[str]:
        """Write its lines."""
        named = {name: [self._graph.nodes[x.place][1] for x in group] for name, group in arguments.items() if group}
        rows = {name: self._names_of_rows(name) for name in (*self._split, *self._made[1])}
        constants = (name for name in self._known.values() if name in self._split)
        yield from (f"{rows[name]} = [{name}[row, 0, ...] for row in {[*self._rotors]}]" for name in constants)
        yield "room = {}"
        yield f"def step({', '.join(arguments)}):"
        yield from (f"    {', '.join(names)}, = {name}" for name, names in named.items())
        plain, wide = self._made
        if there := [*plain, *wide, *(rows[name] for name in wide), *(f"over_{name}" for name in self._spread)]:
            size = f"{next(iter(named.values()))[0]}.shape[-1]"
            counts = f"{len(plain)}, {len(wide)}, {len(self._rotors)}, {_tuple(self._spread)}"
            yield f"    if {size} not in room:"
            yield "        room.clear()"
            yield f"        room[{size}] = arrays_of({size}, {counts})"
            yield f"    {_tuple(there)} = room[{size}]"
        yield from (f"    {line}" for line in self._lines)
        groups = (_tuple(self._text[place] for place in group) for group in self._results)
        yield f"    return {_tuple(groups)}"

    def _write(self, place: int, name: str, inner: Sequence[int]) -> str:
        """Write an operation, and say where its result is."""
        wide, kept, sums = place in self._graph.by_rotor, place in self._kept, name == "total"
        if name not in _IN_PLACE or (wide and kept) or (sums and len(self._rotors) < 2):
            self._lines.append(f"t{place} = {ARRAYS.written(name, [self._text[each] for each in inner])}")
            self._release(inner)
            return f"t{place}"
        by_row = sums or (wide and any(x not in self._graph.by_rotor and x not in self._known for x in inner))
        texts = [*zip(*map(self._rows, inner), strict=True)] if by_row else [tuple(self._over(x, wide) for x in inner)]
        self._release(inner)
        into = f"t{place}" if kept else self._taken(wide)
        if sums:
            (first,), (second,), *others = texts
            texts = [(first, second), *((into, other) for (other,) in others)]
        for row, operands in enumerate(texts):
            own = f"{into}_{row}" if by_row and not sums else into
            made = kept and row == 0
            called = ", ".join(operands if made else (*operands, own))
            self._lines.append(f"{f'{own} = ' if made else ''}{_IN_PLACE[name]}({called})")
        return into

    def _rows(self, place: int) -> list[str]:
        """Name what there is for each rotor."""
        text = self._text[place]
        if place not in self._graph.by_rotor:
            return [text] * len(self._rotors)
        if text not in self._made[1] and text not in self._split:
            self._split[text] = None
            if place not in self._known:
                self._lines.append(f"{self._names_of_rows(text)} = {text}")
        return [f"{text}_{row}" for row in self._rotors]

    def _names_of_rows(self, text: str) -> str:
        return _tuple(f"{text}_{row}" for row in self._rotors)

    def _over(self, place: int, wide: bool) -> str:
        """Name an operand, a constant of rotors over the size."""
        text = self._text[place]
        if not wide or place not in self._known or place not in self._graph.by_rotor:
            return text
        self._spread[text] = None
        return f"over_{text}"

    def _taken(self, wide: bool) -> str:
        """Name an array that is free."""
        made, free = self._made[wide], self._free[wide]
        if free:
            return free.pop()
        name = f"{'wide' if wide else 'one'}{len(made)}"
        made[name] = None
        return name

    def _release(self, places: Sequence[int]) -> None:
        """Free the arrays of what is not needed any more."""
        for place in places:
            self._uses[place] -= 1
            wide = place in self._graph.by_rotor
            if not self._uses[place] and self._text[place] in self._made[wide]:
                self._free[wide].append(self._text[place])


def _arrays_of(size: int, plain: int, wide: int, rotors: int, constants: Sequence[Array]) -> list[Any]:
    """Make the arrays that a function computes in; those with one value for each rotor, then their rows."""
    of_rotors = [np.empty((rotors, size)) for _ in range(wide)]
    spread = (np.array(np.broadcast_to(each, (rotors, size))) for each in constants)
    return [*(np.empty(size) for _ in range(plain)), *of_rotors, *(tuple(each) for each in of_rotors), *spread]


@lru_cache(maxsize=32)
def _compiled(source: str, arrays: bool = False) -> dict[str, Any]:
    of_arrays = {name: getattr(np, _NUMPY.get(name, name)) for name in (*_FUNCTIONS, *_OF_ARRAYS, *_IN_PLACE.values())}
    names: dict[str, Any] = {
        **(of_arrays if arrays else _FUNCTIONS),
        "array": np.array,
        "arrays_of": _arrays_of,
        # The method takes twice as long of few values.
        "sum_of": np.add.reduce,
        "inf": math.inf,
        "nan": math.nan,
    }
    exec(compile(source, "<traced>", "exec"), names)
    return names


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
ARRAYS = Language({"total": "sum_of({})"})
_OF_ARRAYS = ("where", "largest", "smallest")
_NUMPY = {"atan2": "arctan2", "largest": "maximum", "smallest": "minimum"}
"""Functions that NumPy has by another name."""
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


def python_source(
    graph: Graph,
    arguments: Mapping[str, Sequence[Symbol]],
    results: Sequence[Sequence[Value]],
    language: Language = PYTHON,
    known: Mapping[int, str] | None = None,
) -> str:
    """Write what `traced` makes as text: a function called ``step``; some operations may have names already."""
    flat = [x for group in results for x in group]
    lines, texts = written(graph, flat, language, known=known)
    named = {name: [graph.nodes[x.place][1] for x in group] for name, group in arguments.items()}
    unpacked = [f"{', '.join(names)}, = {name}" for name, names in named.items() if names]
    text = iter(texts)
    groups = (_tuple(next(text) for _ in group) for group in results)
    body = "\n    ".join([*unpacked, *lines, f"return {_tuple(groups)}"])
    return f"def step({', '.join(arguments)}):\n    {body}\n"


def written(
    graph: Graph,
    results: Sequence[Value],
    language: Language,
    parts: Mapping[int, str] | None = None,
    known: Mapping[int, str] | None = None,
) -> tuple[list[str], list[str]]:
    """Write what was recorded: lines, and expressions of the results in terms of them.

    Parameters
    ----------
    parts : mapping of int to str, optional
        What is said before the operations that begin at a place.
    known : mapping of int to str, optional
        Names of operations that are computed elsewhere, by place.
    """
    text = dict(known or {})
    uses = _uses(graph, [x.place for x in results if isinstance(x, Symbol)], text)
    lines: list[str] = []
    said = ""
    for place, (name, *inner) in enumerate(graph.nodes):
        said = (parts or {}).get(place, said)
        if not uses[place] or place in text:
            continue
        if name in _GIVEN:
            column = f"array({[[value] for value in inner]})"
            text[place] = {"input": inner[0], "array": column}.get(name) or language.number.format(inner[0])
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


_GIVEN = ("input", "number", "array")
"""What is no operation."""
_OF_ALL_ROTORS = ("input", "number", "total")
"""What is no array by rotor, whatever it is made of."""


def _uses(graph: Graph, results: Sequence[int], known: Container[int] = ()) -> list[int]:
    """Count how often each operation is needed for the results, beyond those that are known."""
    uses = [0] * len(graph.nodes)
    waiting = [*results]
    while waiting:
        place = waiting.pop()
        uses[place] += 1
        if uses[place] == 1 and place not in known and graph.nodes[place][0] not in _GIVEN:
            waiting.extend(graph.nodes[place][1:])
    return uses
