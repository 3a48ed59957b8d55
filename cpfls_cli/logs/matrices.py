"""Reader of HDF5, MATLAB's .mat, NumPy's .npz: arrays by their path, columns of a matrix one by one."""

import contextlib
import re
import struct
import subprocess
import sys
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from math import prod
from pathlib import Path
from typing import Any, Literal, NamedTuple

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.files import FileState, is_sealed, longest_read_s, most_held, state_of
from cpfls_cli.flightlog.recognised import LogTable
from cpfls_cli.flightlog.topics import STAMP
from cpfls_cli.flightlog.vocabulary import PARROT
from cpfls_cli.logs.dataflash import exported
from cpfls_cli.logs.formats import MOST_LISTED, LogContents
from cpfls_cli.units import known_unit
from cpfls_cli.words import some

_MOST_COLUMNS, _FEWEST_CLOCKS = 64, 2
_FITS = 0.5  # Share of its time that doubtful stamps have in common with the log's fastest.
_PROBE = """
import sys, h5py
states = 0
def count(name, own):
    global states
    # Of one byte each or of eight, they are read as numbers of eight.
    states += max(own.nbytes, 8 * (own.size or 0)) if isinstance(own, h5py.Dataset) else 0
def read(name, own):
    if isinstance(own, h5py.Dataset) and own.dtype.kind in "iufb" and own.ndim and own.size:
        rows = max(1, (1 << 20) * len(own) // own.size)
        for start in range(0, len(own), rows):
            own[start : start + rows]
with h5py.File(sys.argv[1], "r") as file:
    name = file.attrs.get("format")
    print(name if isinstance(name, str) and name.startswith("cpfls/") else "")
    file.visititems(count)
    if states > int(sys.argv[2]):
        print(f"claims {states / 1e9:.3g} GB of numbers, far more than a file of its size holds: damaged, or not a log")
        sys.exit(3)
    file.visititems(read)
"""
# Kind of a variable of a .mat that is compressed; what the probe of a file ends with that states too much.
_COMPRESSED, _INFLATED = 15, 3
_TIME_UNITS = ("s", "ms", "us", "ns")
# Columns of the buses that MathWorks' model of a Parrot minidrone logs, whose names are lost.
_STATES = "x y z yaw pitch roll vx vy vz gyro_x gyro_y gyro_z"
_SENSED = "acc_x acc_y acc_z gyro_x gyro_y gyro_z height pressure"
_BUSES = {"rt_estim": _STATES, "rt_estimatedStates": _STATES, "rt_sensor": _SENSED}
# What arrays of texts that name columns are called.
_LABELS = re.compile("label|name|column|header|field|channel|key", re.IGNORECASE)
_OBJECTS = "holds objects or tables, which MATLAB alone reads: save their columns as vectors"
# In place of values that are no numbers.
_NO_NUMBERS = np.empty(2, dtype=object)


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read arrays of numbers by their path, ``group/name`` of a vector, ``group/name[column]`` of a matrix.

    A matrix has its samples along its longer axis, and stamps whose attribute states a unit of time are converted to
    s. What is wider than 64 columns, or holds no numbers, is left out.
    """
    hdf5 = h5py.is_hdf5(path)
    # Of topics, which have clocks of their own, all is read.
    wanted = None if wanted is not None and any("." in name for name in wanted) else wanted
    kind, load = ("NumPy", _arrays) if path.suffix.lower() == ".npz" else ("MATLAB", _variables)
    try:
        if hdf5:
            found = _probed(state_of(path))
            if found.fault:
                raise InputError(f"{path}: {found.fault}")
            if found.artifact:
                raise InputError(f"{path}: is an artifact of this program ({found.artifact}), not a log")
        variables = {} if hdf5 else load(path)
        if (messages := exported(path, variables)) is not None:
            return messages
        columns, units, others = _read(_of_hdf5(path) if hdf5 else _labelled([*_of_mat(variables)]), wanted)
    except InputError:
        raise
    except Exception as error:
        # Each version of .mat breaks in its own way: what the parsers raise is no fixed set.
        raise InputError(f"{path}: cannot be read as {'HDF5' if hdf5 else kind}: {error}") from None
    if not columns:
        way = (
            f" (of something else: {some(others, MOST_LISTED)}): save each signal as an array of numbers"
            if others
            else ": nothing was logged, or what was is empty"
        )
        raise InputError(f"{path}: holds no vectors or matrices of numbers{way}")
    lost = f"arrays that are no columns of numbers are left out: {some(others, MOST_LISTED)}"
    own = _on_own_clocks(columns, units) if wanted is None else None
    if own is not None:
        return replace(own, warnings=(*own.warnings, *[lost] * bool(others)))
    columns = _of_one_length(columns)
    system = (
        f"{PARROT} minidrone"
        if any(name.startswith((*_BUSES, "rt_motor", "rt_yout/motors")) for name in columns)
        else ""
    )
    return LogContents({"": columns}, units, system=system, warnings=(lost,) if others and wanted is None else ())


def _on_own_clocks(columns: Mapping[str, Array], units: Mapping[str, str]) -> LogContents | None:
    """Make topics of structures or groups of several lengths with stamps each; None where few columns have them."""
    groups: dict[str, dict[str, Array]] = {}
    for name, values in columns.items():
        if len(values) > 1:
            groups.setdefault(name.rpartition("/")[0], {})[name] = values
    lengths = [{*map(len, own.values())} for own in groups.values()]
    if any(len(own) > 1 for own in lengths) or len(set[int]().union(*lengths)) < _FEWEST_CLOCKS:
        return None
    # What is no name of a topic.
    if any(not own or "." in own or own.endswith("[0]") for own in groups):
        return None
    tables: dict[str, LogTable] = {}
    for group, fields in groups.items():
        with contextlib.suppress(InputError):
            tables[group] = LogTable({"": fields}, units)
    said = _in_unit_of_fastest(tables)
    topics: dict[str, dict[str, Array]] = {}
    stated: dict[str, str] = {}
    for group, log in tables.items():
        clock = log.clock("")
        # A second clock under the name of the stamps would take their place.
        others = (name for name in groups[group] if name not in (log.time_column, f"{group}/{STAMP}"))
        named = {name.removeprefix(f"{group}/"): name for name in others}
        read = {STAMP: clock, **{own: groups[group][name] for own, name in named.items()}}
        topics[group] = {own: values[np.isfinite(clock)] for own, values in read.items()}
        stated |= {f"{group}.{own}": units[name] for own, name in named.items() if name in units}
    if len(topics) < _FEWEST_CLOCKS or 2 * sum(map(len, topics.values())) < sum(map(len, groups.values())):
        return None
    left = [group for group in groups if group not in topics]
    words = f"of few rows, or without stamps that rise from row to row, and left out: {some(left, MOST_LISTED)}"
    return LogContents(topics, stated, warnings=(*said, *[words] * bool(left)))


def _in_unit_of_fastest(tables: dict[str, LogTable]) -> list[str]:
    """Read stamps in the unit of the fastest ones where they cover its time better so; give the doubts of what is kept.

    Of slow rows a second between two looks like a millisecond. Left out are stamps that are only taken for such and do
    not fit, and rows without any, of which nobody knows when the first came.
    """
    for group in [group for group, log in tables.items() if log.time_column not in log.names]:
        del tables[group]
    said: list[str] = []
    for group, log in [*tables.items()]:
        fastest = max(tables.values(), key=lambda log: len(log.clock("")))
        shared: dict[str, float] = {}
        for unit in (log.time_unit, *[fastest.time_unit] * (log.time_column not in log.units)):
            clock = log.clock("") * (known_unit(unit).factor / known_unit(log.time_unit).factor)
            shared[unit] = _shared(clock, fastest.clock(""))
        unit = max(shared, key=shared.__getitem__)
        if log.time_doubt and shared[unit] < _FITS:
            del tables[group]
        elif log.time_doubt and unit == log.time_unit:
            said.append(log.time_doubt)
        log.time_unit = unit
    return said


def _shared(clock: Array, other: Array) -> float:
    """Share that two clocks have in common of the time from the first stamp of both to the last."""
    firsts, lasts = (np.nanmin(clock), np.nanmin(other)), (np.nanmax(clock), np.nanmax(other))
    return max(float(min(lasts) - max(firsts)), 0.0) / float(max(lasts) - min(firsts))


def _of_one_length(columns: dict[str, Array]) -> dict[str, Array]:
    """Leave out zeros that fill the longest columns up, and of states the sample more than the inputs between them."""
    longest = max(map(len, columns.values()), default=0)
    held = np.zeros(longest, dtype=bool)
    for own in columns.values():
        if len(own) == longest:
            held |= own != 0
    longest = int(np.flatnonzero(held).max(initial=-1)) + 1
    columns = {name: own[:longest] if len(own) == len(held) else own for name, own in columns.items()}
    lengths = sorted({len(own) for own in columns.values()} - {0, 1})
    return {name: own[: lengths[0]] for name, own in columns.items()} if np.diff(lengths).tolist() == [1] else columns


def is_log(path: Path) -> bool:
    """Tell an HDF5 file of another program from an artifact of this one; what cannot be read is none."""
    if not h5py.is_hdf5(path) or is_sealed(path):
        return False
    found = _probed(state_of(path))
    return found.readable and not found.artifact


class _Probed(NamedTuple):
    """What another process found of an HDF5 file, or why it did not come to its end."""

    readable: bool
    artifact: str
    fault: str = ""


@lru_cache(maxsize=64)
def _probed(state: FileState) -> _Probed:
    """Read an HDF5 file in another process first: in a damaged one HDF5 may turn for ever, and heeds no signal then."""
    limit = longest_read_s(state.size)
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE, state.path, str(most_held(state.size))],
            capture_output=True,
            timeout=limit,
            check=False,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return _Probed(False, "", f"damaged: HDF5 did not finish reading it within {limit:.0f} s")
    if done.returncode == _INFLATED:
        return _Probed(True, "", done.stdout.strip().splitlines()[-1])
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"HDF5 ended with {done.returncode}"])[-1]
        return _Probed(False, "", f"cannot be read as HDF5: {last}")
    return _Probed(True, done.stdout.strip())


def _read(
    arrays: Iterable[tuple[str, Any, str]], wanted: Collection[str] | None
) -> tuple[dict[str, Array], dict[str, str], list[str]]:
    """Name the columns of arrays and read those that are wanted; give their units, and the arrays that have none."""
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    others = []
    for name, array, unit in arrays:
        own = dict(_named(name, array, wanted))
        others += [name] if (array.size or 0) > 1 and not own else []
        factor = known_unit(unit).factor if unit in _TIME_UNITS else 1.0
        columns |= {column: factor * values for column, values in own.items()} if factor != 1.0 else own
        units |= {column: "s" if unit in _TIME_UNITS else unit for column in own if unit}
    return columns, units, others


def _of_hdf5(path: Path) -> Iterator[tuple[str, Any, str]]:
    found: dict[str, Any] = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, own: found.update({name: own}) if isinstance(own, h5py.Dataset) else None)
        # MATLAB keeps the insides of its cells, references and objects below such names.
        own = {name: dataset for name, dataset in found.items() if not name.startswith(("#refs#", "#subsystem#"))}
        objects = [name for name, dataset in own.items() if "MATLAB_object_decode" in dataset.attrs]
        if objects and len(objects) == len(own):
            raise InputError(f"{path}: {_OBJECTS}")
        for name, dataset in own.items():
            if name not in objects:
                unit = dataset.attrs.get("units", dataset.attrs.get("unit", ""))
                unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
                yield name, dataset, unit if isinstance(unit, str) else ""


def _variables(path: Path) -> dict[str, Any]:
    """Load a .mat of before 7.3: structures as mappings."""
    # A flight of this program is asked whether it is a matrix too, and needs none of this.
    import scipy.io

    _refuse_inflated(path)
    with warnings.catch_warnings():
        # Objects of MATLAB's own classes have no names, so that of several the last is kept: none of them is read.
        warnings.simplefilter("ignore", scipy.io.matlab.MatReadWarning)
        read = scipy.io.loadmat(str(path), simplify_cells=True)
    variables = {name: value for name, value in read.items() if not name.startswith("__")}
    if variables and all(isinstance(value, scipy.io.matlab.MatlabOpaque) for value in variables.values()):
        raise InputError(f"{path}: {_OBJECTS}")
    return variables


def _arrays(path: Path) -> dict[str, Any]:
    """Load a .npz, whose arrays of objects are programs and are left out."""
    with zipfile.ZipFile(path) as inside:
        _require_held(path, sum(own.file_size for own in inside.infolist()), path.stat().st_size)
    found: dict[str, Any] = {}
    with np.load(path) as archive:
        for name in archive.files:
            try:
                found[name] = archive[name]
            except ValueError:
                found[name] = _NO_NUMBERS
    return found


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Name what is in mappings by its path; a structure with time is one."""
    if not isinstance(value, dict) or _with_time(value):
        yield prefix, value
        return
    for name, own in value.items():
        yield from _flat(f"{prefix}/{name}" if prefix else name, own)


def _labelled(arrays: Sequence[tuple[str, Any, str]]) -> Iterator[tuple[str, Any, str]]:
    """Part the one matrix that has as many columns as a list of labels, each of which names nothing else."""
    texts = {name: own for name, own, _ in arrays if own.dtype.kind == "U" and _LABELS.search(name.rpartition("/")[2])}
    listed = {name: [text.strip() for text in own.ravel().tolist()] for name, own in texts.items()}
    lengths = Counter(map(len, listed.values()))
    held = Counter([*(name for name, _, _ in arrays), *(text for own in listed.values() for text in own)])
    labels = {
        len(own): (name, own)
        for name, own in listed.items()
        if lengths[len(own)] == 1 < len(own) and all(text and held[text] == 1 for text in own)
    }
    wide = [(name, own.shape[1]) for name, own, _ in arrays if own.ndim == 2 and own.shape[0] > own.shape[1]]
    widths = Counter(width for _, width in wide)
    parted = {name: labels[width] for name, width in wide if widths[width] == 1 and width in labels}
    used = {name for name, _ in parted.values()}
    for name, own, unit in arrays:
        if name in parted:
            yield from ((label, column, unit) for label, column in zip(parted[name][1], own.T, strict=True))
        elif name not in used:
            yield name, own, unit


def _of_mat(variables: Mapping[str, Any]) -> Iterator[tuple[str, Any, str]]:
    parts = dict(_flat("", variables))
    timed = {name: own for name, value in parts.items() if (own := _with_time(value))}
    yield from ((name, value, "") for name, value in parts.items() if isinstance(value, np.ndarray))
    if timed:
        longest = max(timed, key=lambda name: len(timed[name][0]))
        clock = timed[longest][0]
        yield "time" if "time" not in variables else f"{longest}/time", clock, "s"
        yield from _on_one_clock(timed, clock)


def _with_time(value: Any) -> tuple[Array, list[Mapping[str, Any]]] | None:
    """Take the time and the signals of what Simulink logs as a structure with time; None if it is none."""
    time = value.get("time") if isinstance(value, dict) else None
    if not isinstance(time, np.ndarray) or time.dtype.kind not in "iuf" or time.ndim != 1 or len(time) < 2:
        return None
    signals = value.get("signals")
    listed: list[Mapping[str, Any]] = [
        own for own in np.atleast_1d(signals) if isinstance(own, dict) and "values" in own
    ]
    return (time.astype(float), listed) if listed else None


def _on_one_clock(
    timed: Mapping[str, tuple[Array, list[Mapping[str, Any]]]], clock: Array
) -> Iterator[tuple[str, Array, str]]:
    """Lay what Simulink logs as structures with time on one clock; NaN where one has no sample."""
    half = 0.5 * float(np.median(np.diff(clock)))
    for name, (time, listed) in timed.items():
        # Who saves them calls them rt_NAME or NAME_rt.
        bus = f"rt_{name.removesuffix('_rt')}" if name.endswith("_rt") else name
        rows = np.minimum(np.searchsorted(clock, time - half), len(clock) - 1)
        near, named = np.abs(clock[rows] - time) < half, set[str]()
        for own in listed:
            values = np.asarray(own["values"])
            # Samples of a vector that is a column are along the last axis.
            values = values if values.shape[:1] == time.shape else values.T
            if values.dtype.kind not in "iufb" or values.shape[:1] != time.shape or values.ndim > 2:
                continue
            laid = np.full((len(clock), *values.shape[1:]), np.nan)
            laid[rows[near]] = values[near]
            # A label may stand for two, as of an estimate and of a sensor.
            label, block = str(own.get("label", "")).strip("<>[]"), str(own.get("blockName", "")).rpartition("/")[2]
            part = block if not label or label in named else label
            named.add(part)
            if bus in _BUSES and laid.ndim == 2:
                yield from ((f"{bus}/{part}", own, "") for part, own in zip(_BUSES[bus].split(), laid.T, strict=False))
            else:
                yield f"{name}/{part}" if len(listed) > 1 else name, laid, ""


def _refuse_inflated(path: Path) -> None:
    """Refuse a .mat whose compressed variables hold more than memory may, out of proportion to the file."""
    import scipy.io

    size = path.stat().st_size
    # What is stored in a byte each is read as numbers of eight. What MATLAB alone reads has no shape.
    with contextlib.suppress(TypeError):
        _require_held(path, sum(8 * prod(shape) for _, shape, _ in scipy.io.whosmat(str(path))), size)
    total = 0
    with path.open("rb") as stream:
        head = stream.read(128)
        if head[126:] not in (b"IM", b"MI"):
            return
        order: Literal["<", ">"] = ">" if head[126:] == b"MI" else "<"
        while len(tag := stream.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind != _COMPRESSED:
                stream.seek(length, 1)
                continue
            part, left = zlib.decompressobj(), stream.read(min(length, size))
            while left:
                total += len(part.decompress(left, 1 << 20))
                _require_held(path, total, size)
                left = part.unconsumed_tail


def _require_held(path: Path, total: int, size: int) -> None:
    if total > most_held(size):
        raise InputError(
            f"{path}: holds more than {total / 1e9:.2g} GB of numbers in {size / 1e6:.2g} MB: damaged, or not a log"
        )


def _named(name: str, array: Any, wanted: Collection[str] | None) -> Iterator[tuple[str, Array]]:
    """Name the columns of an array, and read those that are wanted."""
    shape = tuple(size for size in array.shape or () if size != 1)
    count = min(shape) if len(shape) == 2 else 1
    # Integers, floats and booleans.
    if not array.size or array.dtype.kind not in "iufb" or len(shape) not in (1, 2) or count > _MOST_COLUMNS:
        return
    names = [name] if len(shape) == 1 else [f"{name}[{column}]" for column in range(count)]
    if wanted is not None and not set(names) & set(wanted):
        yield from ((each, np.empty(0)) for each in names)
        return
    values = np.asarray(array[()], dtype=float).reshape(shape)
    columns = values if len(shape) == 2 and shape[0] < shape[1] else values.reshape(-1, count).T
    yield from zip(names, columns, strict=True)
