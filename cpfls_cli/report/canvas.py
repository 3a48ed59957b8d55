"""One style for all figures, and the one way to draw them: long curves thinned out, written as SVG inside a page."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import TYPE_CHECKING, Any, Literal, NamedTuple
from unicodedata import category
from xml.etree import ElementTree

import numpy as np
from markupsafe import escape

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import visible
from cpfls_cli.report.content import Picture, Plot, number, plain, power_of_ten

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes as Axes
    from matplotlib.axis import Axis, Ticker
    from matplotlib.figure import Figure as Figure
    from matplotlib.text import Text
    from matplotlib.ticker import Formatter, Locator
else:
    # What modules that draw write at their arguments.
    Axes = Figure = Any

# Matplotlib is loaded where something is drawn: the sentences of a page are also those of the terminal.
WIDTH = 7.6
# Both ends of a band are drawn at the samples that either of them keeps.
_BAND_POINTS = 400
GREY = "#767676"
NOT_FIRST = "\N{WORD JOINER}"
"""Stands before a name that matplotlib would take for one of its own, until the figure is drawn."""
_OWN_LABEL = re.compile(r"_(child\d+|nolegend_|container\d+)")
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#1b4f8a", "linestyle": "-"},
    {"color": "#c4570a", "linestyle": (0, (5, 1.6))},
    {"color": "#12805c", "linestyle": (0, (6, 1.5, 1.2, 1.5))},
    {"color": "#8b2f7f", "linestyle": (0, (1.3, 1.3))},
    {"color": "#7a5c00", "linestyle": (0, (8, 2))},
    {"color": "#3d3d3d", "linestyle": (0, (4, 1.4, 1.2, 1.4, 1.2, 1.4))},
)
"""Colour and dashes together, so that a print in black and white can be read."""

BASELINE: dict[str, Any] = {"color": GREY, "linestyle": (0, (3, 2)), "linewidth": 1.2}
"""Whatever a result is compared with."""

HELD: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 1.6)), "linewidth": 1.2}
"""The simplest prediction: that nothing changes."""

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    # Else every round of a layout measures all ticks, for titles to give way to those above a plot: none are there.
    "axes.titley": 1.0,
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.handlelength": 2.8,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
}

_NAMESPACE = "http://www.w3.org/2000/svg"
_COORDINATES = {"d", "x", "y"}
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}(?!\d*e)")
_POWER = re.compile(r"\$\\mathdefault\{(-?)(?:([\d.]+)\\times)?10\^\{(-?\d+)\}\}\$")
"""How Matplotlib asks for a power of ten to be typeset."""
_REFERENCE = re.compile(r"url\(#([^)]+)\)")

# Two for each pixel that a curve is wide on a usual screen.
_LARGEST = 1500
_DOTS_PER_INCH = 72
"""Of an SVG."""

_LAYOUT_ROUNDS = 2
"""Ticks follow the size of a plot, and its margins follow its ticks: two rounds settle that."""

_AT_THE_END = 1e-9
"""Share of an axis by which rounding may put a tick beyond the end of it."""

_WIDE_RANGE = 1000.0
"""Ratio of the ends of a logarithmic axis from which on only powers of ten have room."""

_POINTS = 12
"""Of a curve that are all listed for who does not see it."""


def plot(name: str, caption: str, description: str, height: float, draw: Callable[[Figure], None]) -> Plot:
    """Describe a figure, which `draw` fills when it is asked for; its height is in inches, at a width of 7.6."""
    return Plot(name, caption, _Drawing(name, description, height, draw), description)


@dataclass(frozen=True)
class _Drawing:
    """A figure in the style of the pages."""

    name: str
    description: str
    height: float
    draw: Callable[[Figure], None]
    width: float = WIDTH

    @cached_property
    def svg(self) -> str:
        with self._drawn() as figure:
            # It is drawn once for both.
            vars(self)["rows"] = list(_rows(figure))
            return _inline_svg(figure, self.name, self.description)

    @cached_property
    def rows(self) -> list[tuple[str, ...]]:
        with self._drawn() as figure:
            return list(_rows(figure))

    def figure(self) -> Figure:
        with self._drawn() as figure:
            # Ticks take their style when they are first laid out.
            figure.draw_without_rendering()
            return figure

    @contextmanager
    def _drawn(self) -> Iterator[Figure]:
        import matplotlib
        from matplotlib.figure import Figure

        style: Any = {**_STYLE, "svg.hashsalt": self.name}
        with matplotlib.rc_context():
            # A reader's own matplotlib settings must not change the page.
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(style)
            figure = Figure(figsize=(self.width, self.height), layout="constrained")
            self.draw(figure)
            _show_as_written(figure)
            yield figure


@dataclass(frozen=True)
class Drawn:
    """A figure of a result.

    Attributes
    ----------
    height : float, inch, or callable
        Or what gives it, of the result.
    draw : callable
        Fills the figure, with the result before it.
    holds : callable
        Whether there is anything to draw.
    width : float, inch
        Narrower for cards, of which two are in a row.
    """

    description: str
    height: float | Callable[[Any], float]
    draw: Callable[[Any, Figure], None]
    holds: Callable[[Any], object] = bool
    width: float = WIDTH

    def __call__(self, given: Any) -> str:
        """Write it as HTML, under no name."""
        picture = picture_of(self, "figure", given)
        return "" if picture is None else picture.svg


@dataclass(frozen=True)
class _Written:
    """A figure that is HTML already."""

    svg: str
    rows: Sequence[tuple[str, ...]] = ()

    def figure(self) -> Figure:
        """Draw nothing."""
        raise NotImplementedError("it is HTML alone")


def picture_of(draw: Callable[[Any], str], name: str, given: Any) -> Picture | None:
    """Give a figure of a result, its ids beginning with a name; None where there is nothing to draw."""
    if isinstance(draw, Drawn):
        if not draw.holds(given):
            return None
        height = draw.height(given) if callable(draw.height) else draw.height
        return _Drawing(name, draw.description, height, lambda figure: draw.draw(given, figure), draw.width)
    written = draw(given)
    return _Written(written) if written else None


def pictures(figures: Mapping[str, Callable[[Any], str]], prefix: str, given: Any) -> dict[str, Picture]:
    """Give those figures of a result in which there is something to draw, their ids beginning with a prefix."""
    made = ((name, picture_of(draw, f"{prefix}{name}", given)) for name, draw in figures.items())
    return {name: picture for name, picture in made if picture is not None}


def figure_html(picture: Picture) -> str:
    """Write a figure, what it draws folded away as a table."""
    plot = f'<div class="plot">{picture.svg}</div>'
    if not picture.rows:
        return plot
    head = "".join(f'<th scope="col">{title}</th>' for title in ("Panel", "Curve", "x", "y"))
    rows = "".join(f"<tr>{''.join(f'<td>{escape(visible(cell))}</td>' for cell in row)}</tr>" for row in picture.rows)
    table = f'<div class="table" tabindex="0"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    return f"{plot}<details><summary>Numbers</summary>{table}</details>"


def _rows(figure: Figure) -> Iterator[tuple[str, ...]]:
    """List panel, curve, x and y of what is drawn: of a long curve its first, lowest, highest and last point."""
    for axes in figure.axes:
        words = [_words_at(axis) for axis in (axes.xaxis, axes.yaxis)]
        sides: tuple[Any, ...] = ("left", "center", "right")
        title = next(filter(None, map(axes.get_title, sides)), "")
        x, y = _label(axes, "x") or figure.get_supxlabel(), _label(axes, "y") or figure.get_supylabel()
        panel = f"{', '.join(filter(None, (title, y)))}{f' over {x}' if x else ''}"
        for label, points in _curves(axes):
            places = np.arange(len(points))
            if len(points) > _POINTS:
                places = np.unique([0, np.argmin(points[:, 1]), np.argmax(points[:, 1]), len(points) - 1])
            name = "" if _OWN_LABEL.fullmatch(label) else label.replace(NOT_FIRST, "")
            for point in points[places]:
                shown = (own.get(float(at)) or number(float(at) + 0.0, 4) for own, at in zip(words, point, strict=True))
                yield (panel, name, *shown)


def _label(axes: Axes, which: Literal["x", "y"]) -> str:
    """Find the label of an axis, which may stand at another panel that shares it."""
    shared: Any = axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()
    around = (axes, *(other for other in axes.figure.axes if other in shared.get_siblings(axes)))
    return next(filter(None, (str(getattr(other, f"get_{which}label")()) for other in around)), "")


def _words_at(axis: Axis) -> dict[float, str]:
    """Find the words that a figure wrote at its ticks itself."""
    from matplotlib.ticker import FixedLocator

    ticks = [float(tick) for tick in axis.get_majorticklocs()]
    fixed = isinstance(axis.get_major_locator(), FixedLocator)
    return dict(zip(ticks, axis.get_major_formatter().format_ticks(ticks), strict=True)) if fixed else {}


def _curves(axes: Axes) -> Iterator[tuple[str, Array]]:
    """List the labels of curves, points, bars and bands with their points, shape (points, 2); no levels and spans."""
    from matplotlib.collections import PathCollection, PolyCollection
    from matplotlib.container import BarContainer, ErrorbarContainer

    for container in axes.containers:
        if isinstance(container, BarContainer):
            boxes = np.array([[*bar.get_xy(), bar.get_width(), bar.get_height()] for bar in container]).reshape(-1, 4)
            flat = container.orientation == "horizontal"
            yield str(container.get_label()), boxes[:, :2] + boxes[:, 2:] * ((1.0, 0.5) if flat else (0.5, 1.0))
        elif isinstance(container, ErrorbarContainer):
            ends = np.concatenate([own.vertices for each in container[2] for own in each.get_paths()])
            yield str(container.get_label()), ends[np.isfinite(ends).all(axis=1)]
    drawn: list[tuple[Any, list[Any]]] = [(own, [np.column_stack(own.get_data())]) for own in axes.lines]
    drawn += [(own, [own.get_offsets()]) for own in axes.collections if isinstance(own, PathCollection)]
    bands = (own for own in axes.collections if isinstance(own, PolyCollection))
    drawn += [(own, [path.vertices for path in own.get_paths()]) for own in bands]
    for artist, pieces in drawn:
        points = np.ma.filled(np.ma.asarray(np.concatenate(pieces), float), np.nan) if pieces else np.empty((0, 2))
        if artist.get_transform() == axes.transData or isinstance(artist, PathCollection):
            known = points[np.isfinite(points).all(axis=1)]
            if len(known):
                yield str(artist.get_label()), known


def line(axes: Axes, x: Array, y: Array, **style: Any) -> None:
    """Draw a curve in a style of `Axes.plot`, thinned out so that no peak is lost."""
    kept = kept_samples(y)
    axes.plot(x[kept], y[kept], **style)
    plain_ticks(axes.yaxis)


def band(axes: Axes, x: Array, low: Array, high: Array, **style: Any) -> None:
    """Shade the range of a curve in a style of `Axes.fill_between`, thinned out so that no peak is lost."""
    kept = np.union1d(kept_samples(low, _BAND_POINTS), kept_samples(high, _BAND_POINTS))
    axes.fill_between(x[kept], low[kept], high[kept], **{"linewidth": 0.0, "zorder": 1.0, **style})


def stacked(figure: Figure, rows: int) -> list[Axes]:
    """Make plots one above the other with one x axis."""
    return list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])


def in_columns(figure: Figure, plots: int, columns: int, *, share_y: bool = False) -> np.ndarray[Any, Any]:
    """Make plots in columns with one x axis; what is left over of the last row stays empty."""
    panels = figure.subplots(ceil(plots / columns), columns, sharex=True, sharey=share_y, squeeze=False)
    for axes in panels.flat[plots:]:
        axes.set_axis_off()
    return panels


def legend_above(axes: Axes, columns: int = 4) -> None:
    """Put a legend above a plot, where it hides no curve."""
    axes.legend(*named(axes), loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.1)


def legend_over(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """Put one legend above a whole figure, of the curves of one of its plots."""
    figure.legend(*named(axes), loc="outside upper left", ncols=columns)


def named(axes: Axes) -> tuple[list[Artist], list[str]]:
    """Find what a legend shows, and its names; matplotlib would leave out a file whose name begins with ``_``."""
    artists: tuple[Any, ...] = (*axes.lines, *axes.patches, *axes.collections, *axes.containers)
    for artist in artists:
        label = str(artist.get_label())
        if label.startswith("_") and not _OWN_LABEL.fullmatch(label):
            artist.set_label(NOT_FIRST + label)
    return axes.get_legend_handles_labels()


def plain_ticks(axis: Axis) -> None:
    """Write every tick of a linear scale in full: a factor in the corner of a plot is easily overlooked."""
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, smallest=1e-4)))


def logarithmic(axes: Axes, low: float, high: float, steps: Sequence[int] = (1, 2, 5)) -> None:
    """Make the x axis logarithmic, with ticks that are written in full: at 1, 2 and 5 if there is room."""
    steps = steps if high < _WIDE_RANGE * low else (1,)
    axes.set_xscale("log")
    axes.set_xticks([], minor=True)
    for own in (steps, (1, 2, 5)):
        ticks = [step * 10.0**power for power in range(-4, 9) for step in own]
        shown = [tick for tick in ticks if 0.99 * low <= tick <= 1.01 * high]
        if len(shown) > 1:
            break
    axes.set_xticks(shown, [plain(tick) for tick in shown])


def style_of(index: int) -> dict[str, Any]:
    """Get the style of the curve with this number; styles repeat after six."""
    return STYLES[index % len(STYLES)]


def kept_samples(values: Array, largest: int = _LARGEST) -> IntArray:
    """Choose about so many samples to draw a curve: the lowest and highest of every stretch, and both ends."""
    samples = len(values)
    if samples <= largest:
        return np.arange(samples)
    stretch = np.arange(samples) * (largest // 2) // samples
    order = np.lexsort((values, stretch))
    ends = np.searchsorted(stretch[order], np.arange(largest // 2), side="right")
    starts = np.concatenate([[0], ends[:-1]])
    return np.unique(np.concatenate([order[starts], order[ends - 1], [0, samples - 1]]))


def _show_as_written(figure: Figure) -> None:
    """Show every text as it is: a dollar sign in a name is no mathematics, and SVG has no control characters."""
    for text in _texts(figure):
        if written := text.get_text():
            own = written.replace(NOT_FIRST, "")
            text.set_text("".join(each if _is_shown(each) else "\N{REPLACEMENT CHARACTER}" for each in own))
            text.set_parse_math(False)


def _is_shown(character: str) -> bool:
    # To Python no space is printable but the usual one.
    return character.isprintable() or character == "\n" or category(character) == "Zs"


def _texts(artist: Artist) -> Iterator[Text]:
    """Find the texts of a figure, without ticks that the library makes of numbers when it draws."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from matplotlib.ticker import FixedLocator

    if isinstance(artist, Text):
        yield artist
    if isinstance(artist, Axis) and not isinstance(artist.get_major_locator(), FixedLocator):
        yield artist.label
    else:
        for part in artist.get_children():
            yield from _texts(part)


def _inline_svg(figure: Figure, name: str, description: str) -> str:
    """Write a figure as an ``svg`` element for an HTML page; ids inside it start with the name of the figure."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream, canvas = io.StringIO(), FigureCanvasSVG(figure)
    figure.set_dpi(_DOTS_PER_INCH)
    with warnings.catch_warnings():
        # A browser finds other fonts for what the one that measures the text lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        # Laid out here and drawn once: `savefig` draws twice, of which the first is for a layout.
        _lay_out(figure)
        canvas.print_svg(stream, metadata={"Date": None})  # type: ignore[no-untyped-call]  # matplotlib leaves it untyped
    root = ElementTree.fromstring(stream.getvalue())
    _strip(root)
    _rename_ids(root, name)
    for element in root.iter():
        # Two decimals of coordinates are a fiftieth of a pixel on a screen: else most of a page would be digits.
        for key in _COORDINATES & set(element.attrib):
            words = " ".join(element.attrib[key].split())
            element.set(key, _LONG_NUMBER.sub(lambda digits: f"{float(digits[0]):.2f}", words))
    for attribute in ("width", "height", "version"):
        root.attrib.pop(attribute, None)
    # Below this its words are too small to read: a page scrolls it.
    least = f"min-width:{_DOTS_PER_INCH * figure.get_figwidth():.0f}px"
    root.attrib |= {"xmlns": _NAMESPACE, "role": "img", "aria-label": description, "style": least}
    return ElementTree.tostring(root, encoding="unicode")


def _lay_out(figure: Figure) -> None:
    """Lay out a figure with the outermost and the widest tick of each axis, and fix the ticks that suit its size.

    Matplotlib would choose, make and measure all ticks several times in each of its rounds.
    """
    engine = figure.get_layout_engine()
    free = list(_free_ticks(figure))
    ticks = [_ticks(axis, locator, formatter) for axis, _, locator, formatter in free]
    for _ in range(_LAYOUT_ROUNDS):
        before = ticks
        for (_, ticker, _, _), each in zip(free, before, strict=True):
            _fix(ticker, each.few())
        if engine is not None:
            engine.execute(figure)
        ticks = [_ticks(axis, locator, formatter) for axis, _, locator, formatter in free]
        if all(now.length <= then.length for now, then in zip(ticks, before, strict=True)):
            break
    figure.set_layout_engine("none")
    for (_, ticker, _, _), each in zip(free, ticks, strict=True):
        _fix(ticker, each)


def _free_ticks(figure: Figure) -> Iterator[tuple[Axis, Ticker, Locator, Formatter]]:
    """Find whose ticks are for the library to choose; panels that share an axis share its ticks."""
    from matplotlib.ticker import FixedLocator, NullLocator

    both = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    shared = {ticker: axis for axis in both for ticker in (axis.major, axis.minor)}
    for ticker, axis in shared.items():
        locator, formatter = ticker.locator, ticker.formatter
        if locator and formatter and not isinstance(locator, FixedLocator | NullLocator):
            yield axis, ticker, locator, formatter


class _Ticks(NamedTuple):
    """Where the ticks of an axis are and what is written at them, with the factor in its corner."""

    places: list[float]
    words: list[str]
    corner: str

    @property
    def length(self) -> int:
        return max(map(len, self.words), default=0)

    def few(self) -> _Ticks:
        """Take the first, the last and the one with the longest word."""
        widest = [index for index, word in enumerate(self.words) if len(word) == self.length][:1]
        kept = sorted({*range(len(self.words))[:1], *widest, *range(len(self.words))[-1:]})
        return _Ticks([self.places[index] for index in kept], [self.words[index] for index in kept], self.corner)


def _ticks(axis: Axis, locator: Locator, formatter: Formatter) -> _Ticks:
    """Find the ticks of an axis as large as it is."""
    low, high = sorted(axis.get_view_interval())
    rounding = _AT_THE_END * (high - low)
    places = [float(place) for place in locator() if low - rounding <= place <= high + rounding]
    words = [_POWER.sub(_without_mathematics, word) for word in formatter.format_ticks(places)]
    return _Ticks(places, words, formatter.get_offset())


def _fix(ticker: Ticker, ticks: _Ticks) -> None:
    from matplotlib.ticker import FixedFormatter, FixedLocator

    formatter = FixedFormatter(ticks.words)
    formatter.set_offset_string(ticks.corner)
    ticker.locator, ticker.formatter = FixedLocator(ticks.places), formatter


def _without_mathematics(found: re.Match[str]) -> str:
    """Write a power of ten as in tables, without slow typesetting."""
    sign, factor, power = found.groups()
    return f"{'−' if sign else ''}{f'{factor} × ' if factor else ''}{power_of_ten(int(power))}"


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


def _references(element: ElementTree.Element) -> list[str]:
    references = [match for value in element.attrib.values() for match in _REFERENCE.findall(value)]
    target = element.get("href", "")
    return [*references, target[1:]] if target.startswith("#") else references
