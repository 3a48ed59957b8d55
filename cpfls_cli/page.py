"""What a person reads of a result: one template in Markdown, shown on a terminal, as HTML and as Markdown.

In addition to Markdown, a template knows

- folds, ``::: Title`` to ``:::``, which a terminal opens with -v and a page by a click; with ``{open}`` behind it the
  page shows them open;
- figures, ``![caption](name)`` on a line of their own, which a terminal leaves out;
- notes, ``> text``, which a terminal prints on standard error; those with a tone however many others there are;
- ``{% notes texts %}`` and ``{% paragraphs texts %}`` for several, with a tone behind a comma, and
  ``{% list name = x for y in z if w %}``;
- tones, ``{good}``, ``{warning}`` or ``{unsure}`` behind a cell, a heading or a paragraph;
- names, ``{#name}`` behind a heading of a section, for links, or behind the paragraph before a table, its caption;
- ``#`` for the answer, ``##`` for a section, ``###`` for a card of it, with ``{wide}`` as wide as the page, ``####``
  for a heading without one; an answer that begins with a verdict, ``# NO CHANGE: nothing moved {good}``, is a box with
  the paragraphs behind it.

Whatever ``{{ }}`` shows is data: none of it is taken for Markdown.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import count, pairwise
from pathlib import Path
from typing import Any, cast
from urllib.parse import quote

import numpy as np
from jinja2 import BytecodeCache, Environment, FileSystemLoader, StrictUndefined, nodes
from jinja2.bccache import Bucket
from jinja2.ext import Extension
from jinja2.parser import Parser
from markdown_it import MarkdownIt
from markdown_it.rules_core import StateCore
from markdown_it.token import Token
from markdown_it.tree import SyntaxTreeNode
from markupsafe import Markup

from cpfls_cli.errors import visible
from cpfls_cli.report.content import (
    STRUCK,
    UNKNOWN,
    Block,
    Box,
    Cell,
    Facts,
    Folded,
    Heading,
    Listing,
    Picture,
    Plot,
    Table,
    Text,
    Tone,
    change,
    number,
    percent,
    printed,
    sentence,
    whole_percent,
    with_interval,
)
from cpfls_cli.result import column
from cpfls_cli.rounding import apart
from cpfls_cli.version import __version__
from cpfls_cli.words import joined

Figures = Mapping[str, Callable[[], str]]
"""Figures by the name that a template shows them under: each gives HTML, or nothing where there is nothing to show."""

TEMPLATES = Path(__file__).with_name("templates")
TONES = ("good", "note", "warning", "unsure")
_MARKS = re.compile(rf"\s*\{{((?: ?(?:{'|'.join(TONES)}|open|wide|#[\w-]+))+)\}}(?=$|\s*\||\n)")
_TONED_CELL = re.compile(rf"(?<=\| )([^|\n]*[^|\s]) \{{(?:{'|'.join(TONES)})\}}(?= \|)")
_CODE = re.compile("`([^`]+)`")
_FENCE = re.compile("`{3,}")
_FIGURE = re.compile(r"!\[(.*)\]\(([\w-]+)\)")
_HEADING = re.compile(r"(#{1,4}) (.+)")
_VERDICT = re.compile(r"([A-Z][A-Z ,;:-]*[A-Z]): (.+)")
_ESCAPED_STRUCK = re.compile(r"\\~\\~([^~]*)\\~\\~(?= impossible)")
_SPECIAL = re.compile(r"(?<![^\W_])_|_(?![^\W_])|[\\`*{}\[\]<>|#~&]|^(?:[-+=:]|\d+[.)](?=\s|$))")
_TABLE = re.compile(r"<table[^>]*>.*?</table>", re.DOTALL)
_LONG = 36
"""Characters from which the words of a cell are a sentence, which a terminal breaks."""
_NEAR = 0.1
"""Share of its half width by which an interval may be off the middle and is still written with one number."""


def escaped(value: Any) -> Markup:
    """Write a value so that Markdown shows it as it is: on one line, its controls visible."""
    if isinstance(value, Markup):
        return value
    return Markup(_unmarked(UNKNOWN if value is None else visible(" ".join(str(value).split()))))


def _unmarked(text: str) -> str:
    return _SPECIAL.sub(lambda found: f"{found[0][:-1]}\\{found[0][-1]}", text)


def said(text: str) -> Markup:
    """Write a sentence in which only what stands between backticks is marked, as code."""
    parts = _CODE.split(visible(" ".join(text.split())))
    return Markup("".join(code(part) if at % 2 else _unmarked(part) for at, part in enumerate(parts)))


def code(text: object) -> Markup:
    """Write text as code: what is typed, names of files and parameters."""
    shown = visible(" ".join(str(text).split()))
    fence = "`" * (1 + max(map(len, re.findall("`+", shown)), default=0))
    pad = " " if shown.startswith("`") or shown.endswith("`") else ""
    return Markup(f"{fence}{pad}{shown}{pad}{fence}")


def listing(text: str) -> Markup:
    """Write text verbatim, of several lines."""
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return Markup(f"{fence}text\n{text.rstrip()}\n{fence}")


def toned(value: Any, tone: Tone) -> Markup:
    """Write a highlighted value."""
    return Markup(f"{escaped(value)} {{{tone}}}" if tone in TONES else escaped(value))


def interval(estimate: Any, unit: str = "", factor: float = 1.0) -> str:
    """Write an estimate with its 95 % interval, as ``163 ± 37``; by both ends where it is not in their middle."""
    if estimate is None or not np.isfinite(estimate.value):
        return UNKNOWN
    value, *ends = (factor * each for each in (estimate.value, estimate.low, estimate.high))
    low, high = sorted(ends)
    shown = [printed(each) for each in with_interval(value, low, high)]
    behind = f" {unit}" if unit else ""
    half = 0.5 * (high - low)
    if not np.isfinite(half) or half <= 0:
        return shown[0] + behind
    if abs(high - value - half) > _NEAR * half or "×" in shown[0]:
        return f"{shown[0]} [{shown[1]}, {shown[2]}]{behind}"
    # Rounded as the value is.
    decimals = len(shown[0].partition(".")[2])
    return f"{shown[0]} ± {half:.{decimals}f}{behind}"


def plural(count: int, word: str, words: str = "") -> str:
    """Write a count with its word."""
    return f"{count} {word if count == 1 else words or word + 's'}"


def duration(seconds: float) -> str:
    """Write a time: ``4.2 s``, ``42 s`` or ``3 min 20 s``."""
    if not np.isfinite(seconds):
        return UNKNOWN
    if seconds < 99.5:
        return f"{seconds:.1f} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


def table(header: Sequence[Any], rows: Iterable[Sequence[Any]], left: Iterable[int] = (0,)) -> Markup:
    """Write a table; columns are aligned right but for those that are named, numbers have four digits."""
    words = set(left)
    rules = [Markup(":--" if index in words else "--:") for index in range(len(header))]
    lines = (" | ".join(map(_cell, row)) for row in (header, rules, *rows))
    return Markup("\n".join(f"| {line} |" for line in lines))


def _cell(value: Any) -> str:
    return re.sub(r"(?<!\\)\|", r"\|", escaped(number(value) if isinstance(value, float) else value))


_FILTERS: Mapping[str, Callable[..., Any]] = {
    "address": lambda file: Markup(quote(os.fsencode(file))),
    "capitalize_first": lambda text: text[:1].upper() + text[1:],
    "change": change,
    "code": code,
    "duration": duration,
    "interval": interval,
    "joined": lambda words, last="and": Markup(joined(map(escaped, words), last)),
    "number": lambda value, digits=4: UNKNOWN if value is None else number(value, digits),
    "percent": whole_percent,
    "plural": plural,
    "sentence": lambda text: sentence(text) if not isinstance(text, Markup) else Markup(sentence(text)),
    "share": percent,
    "toned": toned,
}


_NOTHING: Mapping[str, Any] = {}


class _Listed(Extension):
    """Several at once: ``{% notes xs %}``, ``{% paragraphs xs, "warning" %}``, ``{% list x = f(y) for y in ys %}``."""

    tags = {"notes", "paragraphs", "list"}  # noqa: RUF012  # as the library declares it

    def parse(self, parser: Parser) -> nodes.Node | list[nodes.Node]:
        """Read what is listed, and the tone of all of it."""
        tag = next(parser.stream)
        if tag.value == "list":
            return [each.set_lineno(tag.lineno) for each in self._listed(parser)]
        given = [nodes.Const("> " if tag.value == "notes" else ""), parser.parse_expression()]
        if parser.stream.skip_if("comma"):
            given.append(parser.parse_expression())
        return nodes.Output([self.call_method("written", given)], lineno=tag.lineno)

    @staticmethod
    def _listed(parser: Parser) -> Iterator[nodes.Node]:
        """Read a name, what is listed under it, and of what: as a loop that appends."""
        name = parser.parse_assign_target(name_only=True)
        parser.stream.expect("assign")
        each = parser.parse_expression()
        parser.stream.expect("name:for")
        target = parser.parse_assign_target(extra_end_rules=("name:in",))
        parser.stream.expect("name:in")
        every = parser.parse_tuple(with_condexpr=False, extra_end_rules=("name:if",))
        test = parser.parse_expression() if parser.stream.skip_if("name:if") else None
        append = nodes.Getattr(nodes.Name(name.name, "load"), "append", "load")
        yield nodes.Assign(name, nodes.List([]))
        yield nodes.For(target, every, [nodes.ExprStmt(nodes.Call(append, [each], [], None, None))], [], test, False)

    def written(self, begin: str, texts: Iterable[Any], tone: str = "") -> Markup:
        """Write each with a blank line behind it."""
        behind = f" {{{tone}}}" if tone else ""
        return Markup("".join(f"{begin}{escaped(text)}{behind}\n\n" for text in texts))


class _Compiled(BytecodeCache):
    """Templates as compiled, once for all stages: what each adds is looked up when they are rendered."""

    def __init__(self) -> None:
        self.kept: dict[tuple[str, str], Any] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        bucket.code = self.kept.get((bucket.key, bucket.checksum))

    def dump_bytecode(self, bucket: Bucket) -> None:
        self.kept[bucket.key, bucket.checksum] = bucket.code


_COMPILED = _Compiled()


_MADE: dict[tuple[Path, int], tuple[Environment, Mapping[str, Any]]] = {}
"""What renders templates, with what they know besides what all do: the same for one mapping as long as that lives."""


def environment(folder: Path, added: Mapping[str, Any]) -> Environment:
    """Give what renders the templates of a folder, with what a stage adds."""
    if (folder, id(added)) in _MADE:
        return _MADE[folder, id(added)][0]
    made = Environment(
        loader=FileSystemLoader([folder, TEMPLATES]),
        # What macros give is not escaped again; everything else that is shown is data.
        autoescape=True,
        finalize=escaped,
        undefined=StrictUndefined,
        bytecode_cache=_COMPILED,
        extensions=[_Listed],
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters.update(_FILTERS)
    made.globals.update(
        np=np, apart=apart, listing=listing, said=said, table=table, zip=zip, column=column, quoted=shlex.quote, **added
    )
    functions = {name: each for name, each in added.items() if callable(each)}
    made.filters.update(functions)
    made.tests.update(functions)
    _MADE[folder, id(added)] = made, added
    return made


def words(
    template: str, given: Any, *, folder: Path = TEMPLATES, added: Mapping[str, Any] | None = None, **more: Any
) -> str:
    """Word a result by its template, in which it is ``r``.

    `added`: what the template knows besides what all do, functions also as filters and tests; `more`: what it knows of
    this result.
    """
    own = environment(folder, _NOTHING if added is None else added)
    return own.get_template(f"{template}.md.j2").render(r=given, **more)


@dataclass
class Node:
    """A part of a page: ``words`` in Markdown, a ``heading``, a ``fold`` or a ``figure``, with its marks."""

    kind: str
    text: str = ""
    level: int = 0
    name: str = ""
    marks: tuple[str, ...] = ()
    inner: list[Node] = field(default_factory=list)


def tree(text: str) -> list[Node]:
    """Take a page apart into headings, folds, figures and what is plain Markdown between them."""
    page: list[Node] = []
    open_nodes, fence = [page], ""
    for line in text.splitlines():
        into = open_nodes[-1]
        verbatim = bool(fence)
        if fence:
            fence = "" if line == fence else fence
        elif begins := _FENCE.match(line):
            fence, verbatim = begins[0], True
        if not verbatim and line == ":::" and len(open_nodes) > 1:
            open_nodes.pop()
        elif not verbatim and line.startswith("::: "):
            into.append(_marked(line.removeprefix("::: "), Node("fold")))
            open_nodes.append(into[-1].inner)
        elif not verbatim and (heading := _HEADING.fullmatch(line)):
            into.append(_marked(heading[2], Node("heading", level=len(heading[1]))))
        elif not verbatim and (figure := _FIGURE.fullmatch(line)):
            into.append(Node("figure", figure[1], name=figure[2]))
        else:
            if not into or into[-1].kind != "words":
                into.append(Node("words"))
            into[-1].text += line + "\n"
    return page


def _marked(text: str, node: Node) -> Node:
    found = _MARKS.search(text)
    marks = found[1].split() if found else []
    node.text, node.marks = text[: found.start()] if found else text, tuple(own for own in marks if own[0] != "#")
    node.name = next((own[1:] for own in marks if own[0] == "#"), "")
    return node


@cache
def _markdown() -> MarkdownIt:
    made = MarkdownIt("commonmark", {"html": False}).enable("table")
    # Before escaped characters become text, so that no data can be a mark.
    made.core.ruler.after("inline", "marks", _take_marks)
    return made


def _take_marks(state: StateCore) -> None:
    """Make marks behind a cell or a paragraph the class of it, and a name behind a caption that of its table."""
    table: list[Token] = []
    caption: Token | None = None
    for before, token in zip(state.tokens, state.tokens[1:], strict=False):
        last = token.children[-1] if token.children else None
        if last is not None and last.type == "text" and (found := _MARKS.search(last.content)):
            last.content = last.content[: found.start()]
            marks = found[1].split()
            caption = before if marks[-1][0] == "#" else None
            before.attrSet("class", " ".join("caption" if own[0] == "#" else own for own in marks))
            before.attrs |= {"id": f"{marks[-1][1:]}-caption"} if caption else {}
        elif caption is not None and token.type == "table_open":
            name = str(caption.attrs["id"])
            token.attrs |= {"id": name.removesuffix("-caption"), "aria-labelledby": name}
            caption = None
        table = [] if before.type == "table_open" else [*table, before]
        if token.type == "table_close":
            _name_cells(table)


def _name_cells(table: Sequence[Token]) -> None:
    """Say of which column a cell is, as narrow screens show one cell below the other; first cells name their rows."""
    titles = [_plain_line(words.content) for cell, words in pairwise(table) if cell.type == "th_open"]
    column = 0
    for cell in table:
        column = 0 if cell.type == "tr_open" else column + (cell.type == "td_close")
        if cell.type == "th_open":
            cell.attrSet("scope", "col")
        elif cell.type == "td_open" and column:
            cell.attrSet("data-title", titles[column])
        elif cell.type == "td_open":
            cell.attrSet("scope", "row")
        cell.tag = "th" if cell.type in {"td_open", "td_close"} and column == (cell.type == "td_close") else cell.tag


def blocks(text: str, pictures: Mapping[str, Picture] | None = None, prefix: str = "") -> list[Block]:
    """Give a page as blocks, without headings of nothing and figures that are not given, as on a terminal.

    `prefix` begins the names of shown figures and tables on the page.
    """
    made = list(_boxed(_blocks(tree(text), pictures or {}, prefix, count(1))))
    empty = (Heading, Folded, type(None))
    return [
        block
        for block, after in pairwise([*made, None])
        if block and (block is made[0] or not (isinstance(block, Heading) and isinstance(after, empty)))
    ]


def _boxed(given: Iterable[Block]) -> Iterator[Block]:
    """Put paragraphs behind a verdict into its box."""
    box: Box | None = None
    for block in given:
        if box and isinstance(block, Text) and block.tone == "plain":
            box = replace(box, sentences=(*box.sentences, block.text))
            continue
        yield from [box] if box else []
        box = block if isinstance(block, Box) else None
        yield from [] if box else [block]
    yield from [box] if box else []


def _blocks(
    nodes: Iterable[Node], pictures: Mapping[str, Picture], prefix: str, numbers: Iterator[int]
) -> Iterator[Block]:
    for node in nodes:
        if node.kind == "heading":
            text = _plain_line(node.text)
            verdict = _VERDICT.fullmatch(text) if node.level == 1 else None
            tone = cast(Tone, next((mark for mark in node.marks if mark in TONES), "note"))
            yield Box(verdict[1], verdict[2], (), tone) if verdict else Heading(text)
        elif node.kind == "fold":
            inner = list(_blocks(node.inner, pictures, prefix, numbers))
            yield Folded(_plain_line(node.text), inner, "open" in node.marks)
        elif node.kind == "figure" and node.name in pictures:
            caption = _plain_line(node.text)
            yield Plot(f"{prefix}{node.name}", caption, pictures[node.name], caption)
        elif node.kind == "words":
            title: SyntaxTreeNode | None = None
            for each in SyntaxTreeNode(_markdown().parse(node.text)).children:
                if each.attrs.get("class") == "caption":
                    title = each
                    continue
                for block in _blocks_of(each):
                    if isinstance(block, Table) and title is not None:
                        name = str(title.attrs["id"]).removesuffix("-caption")
                        yield replace(block, name=name, caption=_plain(title))
                    elif isinstance(block, Table) and prefix:
                        yield replace(block, name=f"{prefix}table-{next(numbers)}")
                    else:
                        yield block
                title = None


def _plain_line(text: str) -> str:
    return _plain(SyntaxTreeNode(_markdown().parseInline(text)))


def _plain(node: SyntaxTreeNode) -> str:
    """Give the text of a node as a terminal prints it."""
    written = {"text": "{}", "code_inline": "`{}`", "softbreak": " ", "hardbreak": " "}
    return "".join(written[each.type].format(each.content) for each in node.walk() if each.type in written)


def _blocks_of(node: SyntaxTreeNode) -> Iterator[Block]:
    if node.type == "paragraph":
        yield Text(_plain(node))
    elif node.type == "blockquote":
        yield from (Text(_plain(each), "warning", always="class" in each.attrs) for each in node.children)
    elif node.type in {"bullet_list", "ordered_list"}:
        yield from _items(node)
    elif node.type == "table":
        yield _table(node)
    elif node.type in {"fence", "code_block"}:
        yield Listing(node.content)


def _items(node: SyntaxTreeNode) -> Iterator[Block]:
    """Give items as lines; those of the form ``**Term**: text`` as terms with their values."""
    facts: list[tuple[str, str]] = []
    for index, item in enumerate(node.children):
        said = " ".join(map(_plain, item.children))
        first = next(
            (
                each
                for each in item.walk()
                if each.type in {"strong", "code_inline", "text"} and (each.children or each.content)
            ),
            None,
        )
        if first is not None and first.type == "strong":
            term = _plain(first)
            facts.append((term, said.removeprefix(term).removeprefix(":").strip()))
            continue
        yield from [Facts(facts)] if facts else []
        facts = []
        yield Text(f"{'-' if node.type == 'bullet_list' else f'{index + 1}.'} {said}")
    yield from [Facts(facts)] if facts else []


def _table(node: SyntaxTreeNode) -> Table:
    header, *rows = [row.children for part in node.children for row in part.children]
    cells = [[Cell(_plain(each), cast(Tone, each.attrs.get("class", "plain"))) for each in row] for row in rows]
    left = frozenset(at for at, each in enumerate(header) if "left" in str(each.attrs.get("style", "left")))
    long = frozenset(at for at in left if any(len(row[at].text) > _LONG for row in cells))
    return Table("", "", [_plain(each) for each in header], cells, left, long)


def markdown(text: str) -> str:
    """Write a page as Markdown that every reader of Markdown knows; figures by their captions."""
    return "".join(_markdown_of(tree(text))).rstrip() + "\n"


def _markdown_of(nodes: Iterable[Node]) -> Iterator[str]:
    for node in nodes:
        if node.kind == "words":
            yield _ESCAPED_STRUCK.sub(r"~~\1~~", _MARKS.sub("", _TONED_CELL.sub(r"**\1**", node.text)))
        elif node.kind == "figure":
            yield f"*{'' if node.text.startswith('Figure') else 'Figure: '}{node.text}*\n\n"
        else:
            yield f'<a id="{node.name}"></a>\n\n' if node.name else ""
            yield f"{'#' * (node.level or 3)} {node.text}\n\n"
            yield from _markdown_of(node.inner)


def html(title: str, text: str, figures: Figures) -> str:
    """Write a page that needs nothing else, neither network nor scripts."""
    nodes = tree(text)
    answer = next((node for node in nodes if node.kind == "heading" and node.level == 1), None)
    rest = [node for node in nodes if node is not answer]
    first = next((at for at, node in enumerate(rest) if node.kind == "heading"), len(rest))
    made = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined)
    return made.get_template("page.html").render(
        title=visible(title),
        tone=" ".join(answer.marks) if answer else "",
        answer=Markup(_line(answer.text if answer else escaped(title))),
        intro=Markup("".join(_html(rest[:first], figures))),
        body=Markup("".join(_sections(rest[first:], figures))),
        contents=[(node.name, Markup(_line(node.text))) for node in rest if node.kind == "heading" and node.name],
        version=__version__,
    )


def _line(text: str) -> str:
    return cast(str, _markdown().renderInline(text))


def _sections(nodes: Sequence[Node], figures: Figures) -> Iterator[str]:
    """Write sections, each with its cards side by side where there is room."""
    begins = [at for at, node in enumerate(nodes) if node.kind == "heading" and node.level == 2]
    for begin, end in zip([0, *begins], [*begins, len(nodes)], strict=True):
        own = nodes[begin:end]
        if not own:
            continue
        heading = own[0] if own[0].kind == "heading" and own[0].level == 2 else None
        yield f'<section id="{heading.name}">' if heading and heading.name else "<section>"
        if heading:
            yield f"<h2{_class(heading)}>{_line(heading.text)}</h2>"
            own = own[1:]
        cards = [at for at, node in enumerate(own) if "open" in node.marks or (node.level and node.level < 4)]
        yield from _html(own[: cards[0] if cards else len(own)], figures)
        yield '<div class="cards">' if cards else ""
        for start, stop in zip(cards, [*cards, len(own)][1:], strict=True):
            card, behind = own[start], own[start + 1 : stop]
            yield f'<article class="{" ".join(("card", *card.marks))}"><h3>{_line(card.text)}</h3>'
            yield from _html(card.inner if card.kind == "fold" else behind, figures)
            yield "</article>"
            if card.kind == "fold" and behind:
                yield f'<div class="wide">{"".join(_html(behind, figures))}</div>'
        yield f"{'</div>' if cards else ''}</section>"


def _html(nodes: Iterable[Node], figures: Figures) -> Iterator[str]:
    for node in nodes:
        if node.kind == "words":
            made = cast(str, _markdown().render(node.text))
            # No text can be a tag: what is wide can be scrolled, with a keyboard too.
            made = _TABLE.sub(lambda found: f'<div class="{_shape(found[0])}" tabindex="0">{found[0]}</div>', made)
            yield STRUCK.sub(r"<s>\1</s>", made).replace("<pre>", '<pre tabindex="0">')
        elif node.kind == "heading":
            level = 3 if node.level == 4 else 4
            yield f"<h{level}{_class(node)}>{_line(node.text)}</h{level}>"
        elif node.kind == "fold":
            yield f"<details{' open' if 'open' in node.marks else ''}><summary>{_line(node.text)}</summary>"
            yield from _html(node.inner, figures)
            yield "</details>"
        elif drawn := figures[node.name]():
            yield f'<figure id="{node.name}">{drawn}<figcaption>{_line(node.text)}</figcaption></figure>'


def _shape(table: str) -> str:
    """Tell a table of sentences, whose cells stand one below the other on a narrow screen."""
    return "table prose" if any(len(cell) > _LONG for cell in re.findall(r"<td[^>]*>(.*?)</td>", table)) else "table"


def _class(node: Node) -> str:
    return f' class="{" ".join(node.marks)}"' if node.marks else ""
