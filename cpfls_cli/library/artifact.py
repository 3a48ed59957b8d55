"""An artifact as a mapping from names to arrays, with units, and its figures; nothing heavy loads before it is used."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpfls_cli.errors import InputError, install_command

if TYPE_CHECKING:
    import os

    import numpy as np
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from cpfls_cli.artifacts.gate import DatasetSpec
    from cpfls_cli.report.source import Source
    from cpfls_cli.store import Origin


def read(path: str | os.PathLike[str]) -> Artifact:
    """Read an artifact of any format.

    Parameters
    ----------
    path : str or path
        What a command wrote, such as ``flight.h5``.

    Raises
    ------
    InputError
        If it is no good artifact; the message says why.
    """
    file = Path(path)
    made = _read(file)
    made._path = file
    return made


def _read(file: Path) -> Artifact:
    """Read an artifact that is in memory alone."""
    from cpfls_cli import store

    result, origin = store.read(file, import_module("cpfls_cli.stage").kind_of(file))
    held = store.flat(file)
    specs = {path: spec for path, (spec, _) in held.items()}
    return Artifact(result, origin, {path: values for path, (_, values) in held.items()}, specs)


class Artifact(Mapping[str, Any]):
    """What a command wrote, as a mapping from the names of its datasets to arrays of NumPy, numbers and text.

    Iterating gives the names. ``print(artifact)`` shows all datasets with shape, unit and meaning, as ``cpfls info``
    does.
    """

    def __init__(self, record: Any, origin: Origin, data: Mapping[str, Any], specs: Mapping[str, DatasetSpec]) -> None:
        self._record, self._origin, self._data, self._specs = record, origin, data, specs
        self._path: Path | None = None

    def __getitem__(self, name: str) -> Any:
        value = self._data[name]
        return value if value.ndim else value.item()

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)

    def __repr__(self) -> str:
        return f"<{self.format}: {len(self)} datasets{f' of {self._path}' if self._path else ''}>"

    def __str__(self) -> str:
        from cpfls_cli.report.content import Table
        from cpfls_cli.report.terminal import terminal_lines

        rows = [
            (name, "x".join(map(str, own.shape)) or "scalar", self.about(name).units, self.about(name).description)
            for name, own in self._data.items()
        ]
        header = ("Dataset", "Shape", "Unit", "What it holds")
        return "\n".join(terminal_lines([Table("datasets", self.format, header, rows, frozenset(range(4)))]))

    @property
    def path(self) -> Path:
        """The file that it was read from or written to.

        Raises
        ------
        InputError
            If it is in memory alone.
        """
        if self._path is None:
            raise InputError(f"a {self.format} in memory: has no file; write it first, with Artifact.write")
        return self._path

    @property
    def format(self) -> str:
        """Its format, such as ``cpfls/flight``."""
        return str(self._record.FORMAT)

    @property
    def summary(self) -> dict[str, Any]:
        """What its command prints with ``--json``, as far as the artifact holds it."""
        from cpfls_cli.result import plain

        return dict(plain(self._record))

    @property
    def config(self) -> dict[str, Any]:
        """The resolved config that it was made with, by section and key."""
        from cpfls_cli.config.load import parse_config

        return parse_config(self._origin.config, f"{self._path or self.format}: /config")

    def about(self, name: str) -> DatasetSpec:
        """Tell what a dataset holds: ``units``, ``dimensions``, ``frame``, ``description``."""
        if name not in self:
            raise KeyError(name)
        return self._specs[name]

    def to_xarray(self) -> xr.Dataset:
        """Give all datasets with named dimensions; units, frame and description stand in their ``attrs``.

        A dimension that a dataset has twice, as a matrix does, is named ``axis`` and ``axis_2``; one of the name of
        another dataset ends in ``_index``; one of another length in each group begins with the group.

        Raises
        ------
        InputError
            If xarray is not installed; the message says how to install it.
        """
        variables = {name: (self._dimensions(name), self[name], self._attributes(name)) for name in self}
        attributes = {"format": self.format, "cpfls_version": self._origin.version, "seed": self._origin.seed}
        made: xr.Dataset = _optional("xarray").Dataset(variables, attrs=attributes)
        return made

    def to_pandas(self, dimension: str | None = None) -> pd.DataFrame:
        """Give the datasets along one dimension as columns, such as ``attitude.roll`` and ``rotor_speed.0``.

        Units stand in ``attrs["units"]`` by column. The index is the dataset of the dimension's name where there is
        one, as of ``time``, and counts from 0 otherwise.

        Parameters
        ----------
        dimension : str, optional
            Label of the first axis; without it, that of the first dataset that is an array.

        Raises
        ------
        InputError
            If pandas is not installed, or no dataset has the dimension; the message says what to do.
        """
        along: dict[str, list[str]] = {}
        for name in self:
            along.setdefault(next(iter(self.about(name).dimensions), ""), []).append(name)
        numbers = along.pop("", [])
        wanted = next(iter(along), "") if dimension is None else dimension
        if wanted not in along:
            has = f"its dimensions are {', '.join(along)}" if along else f"it holds {len(numbers)} single values alone"
            raise InputError(f"a {self.format}: no dataset along '{wanted}'; {has}")
        columns = {column: values for name in along[wanted] for column, values in self._columns(name)}
        units = {column: self.about(column.partition(".")[0]).units for column in columns}
        pandas = _optional("pandas")
        index = pandas.Index(columns.pop(wanted), name=wanted) if wanted in columns else None
        frame: pd.DataFrame = pandas.DataFrame(columns, index=index)
        frame.attrs["units"] = units
        return frame if index is not None else frame.rename_axis(wanted)

    def figures(self, *others: Artifact) -> Figures:
        """Give the figures that ``cpfls report`` shows of it, as figures of matplotlib, by name.

        Parameters
        ----------
        *others : Artifact
            Given to the report as well: a flight with its model, models that are compared.
        """
        from cpfls_cli.config.study import ReportSettings
        from cpfls_cli.pages.page import sections_of
        from cpfls_cli.report.content import Plot, unfolded
        from cpfls_cli.report.source import Sources

        sources = [one._source(str(index)) for index, one in enumerate((self, *others))]
        sections = sections_of(Sources(sources, sources[0].vehicle, ReportSettings()))
        blocks = (block for section in sections for block in unfolded(section.blocks))
        return Figures({block.name: block.picture.figure for block in blocks if isinstance(block, Plot)})

    def write(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write it as its command does.

        Parameters
        ----------
        force : bool
            Replace an existing file.

        Raises
        ------
        InputError
            If the file exists, or its folder cannot be written.
        """
        from cpfls_cli import store
        from cpfls_cli.artifacts.output import check_output

        file = Path(path)
        check_output(file, force)
        store.write(file, self._record, self._origin)
        self._path = file

    def _source(self, number: str) -> Source:
        from cpfls_cli.report.source import source_of_result

        label = self._path.name if self._path else f"{self.format} {number}"
        return source_of_result(self._record, self._origin, self._path or self.format, label, number)

    def _dimensions(self, name: str) -> list[str]:
        """Name the dimensions of a dataset apart, also from datasets that are no coordinates.

        One that has another length in other groups is named with its group.
        """
        group = name.rpartition("/")[0]
        apart_by_group = self._of_several_lengths if group else frozenset()
        given = self.about(name).dimensions
        labels = tuple(f"{group}/{label}" if label in apart_by_group else label for label in given)
        named = {label for label in labels if label in self}
        taken = {label for label in named if self.about(label).dimensions != (label.rpartition("/")[2],)}
        counts = [labels[: index + 1].count(label) for index, label in enumerate(labels)]
        apart = [f"{label}_index" if label in taken else label for label in labels]
        return [label if count == 1 else f"{label}_{count}" for label, count in zip(apart, counts, strict=True)]

    @cached_property
    def _of_several_lengths(self) -> frozenset[str]:
        """Dimensions that have not one length only."""
        lengths: dict[str, set[int]] = {}
        for name, values in self._data.items():
            for label, length in zip(self.about(name).dimensions, values.shape, strict=True):
                lengths.setdefault(label, set()).add(length)
        return frozenset(label for label, own in lengths.items() if len(own) > 1)

    def _attributes(self, name: str) -> dict[str, str]:
        about = self.about(name)
        return {"units": about.units, "frame": about.frame, "long_name": about.description}

    def _columns(self, name: str) -> Iterator[tuple[str, np.ndarray]]:
        """Cut a dataset into columns along its first axis."""
        about, values = self.about(name), self._data[name]
        labels = [
            _labels(about, label, length) for label, length in zip(about.dimensions[1:], values.shape[1:], strict=True)
        ]
        rows = values.reshape(len(values), -1)
        for index, words in enumerate(product(*labels)):
            yield ".".join((name, *words)), rows[:, index]


class Figures(Mapping[str, "Figure"]):
    """Figures by name, each drawn anew when it is looked up."""

    def __init__(self, drawn: Mapping[str, Callable[[], Figure]]) -> None:
        self._drawn = drawn

    def __getitem__(self, name: str) -> Figure:
        return self._drawn[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._drawn)

    def __len__(self) -> int:
        return len(self._drawn)

    def __repr__(self) -> str:
        return f"Figures({', '.join(self)})"


def _labels(about: DatasetSpec, label: str, length: int) -> list[str]:
    from cpfls_cli.result import EULER

    if label != "axis":
        return [str(index) for index in range(length)]
    return ["roll", "pitch", "yaw"] if about.frame == EULER else ["x", "y", "z"]


def _optional(package: str) -> Any:
    """Import a package that is no part of the base install."""
    try:
        return import_module(package)
    except ImportError:
        raise InputError(f"needs the package {package}; {install_command('notebook')}") from None
