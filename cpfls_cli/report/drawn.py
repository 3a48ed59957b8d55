"""The numbers behind a figure: its panels and what is drawn in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from cpfls_cli.arrays import Array

Form = Literal["line", "points", "bars", "band", "map", "mark"]


@dataclass(frozen=True)
class Series:
    """One thing that is drawn.

    Attributes
    ----------
    label : str
        As in the legend; empty where it has none.
    form : {"line", "points", "bars", "band", "map", "mark"}
        A mark is a level or a span: ends of x and of y, infinite where it goes from edge to edge.
    x, y : array, shape (points,)
    low, high : array, shape (points,), or None
        Ends of a band or of error bars.
    value : array, shape (points,), or None
        Colour of a map.
    spread : tuple of (array, array), or None
        Samples evenly spread over a curve of which only the extremes are drawn.
    """

    label: str
    form: Form
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    value: Array | None = None
    spread: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    Attributes
    ----------
    title, x_label, y_label : str
        Labels with units.
    x_names, y_names : mapping of float to str
        Words that stand at positions of an axis in place of numbers.
    """

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    x_names: Mapping[float, str] = field(default_factory=dict)
    y_names: Mapping[float, str] = field(default_factory=dict)
