"""The one gate through which artifacts are opened, and the rules of their formats, one small rule after the other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import h5py
import numpy as np

from cpfls_cli.artifacts.formats import record_of_format, stage_module
from cpfls_cli.artifacts.patience import patient
from cpfls_cli.artifacts.spec import (
    CONFIG,
    FIXED,
    INPUTS,
    SCHEMA_VERSION,
    DatasetSpec,
    Format,
    Header,
    InputFile,
)
from cpfls_cli.errors import InputError, NotAnArtifactError
from cpfls_cli.files import is_hdf5, is_sealed, read_content, text_sha256
from cpfls_cli.version import __version__
from cpfls_cli.words import some

# Text in memory and in a file.
_KINDS = {"U": "text", "S": "text", "i": "numbers", "u": "numbers", "f": "numbers"}
_LARGEST = 1e150
"""Nothing that is measured or computed comes near; the square of a larger number is none."""
_BLOCK = 1 << 18
"""Numbers that are checked at a time."""


class Checkable(Protocol):
    """An artifact as its format and its datasets by path."""

    @property
    def spec(self) -> Format:
        """Its format."""
        ...

    @property
    def data(self) -> Mapping[str, Any]:
        """Its datasets by path."""
        ...


def check_artifact(artifact: Checkable) -> list[str]:
    """Find everything in an artifact that its format does not allow, a sentence each."""
    return [*check_structure(artifact), *check_values(artifact)]


def check_structure(artifact: Checkable) -> list[str]:
    """Find datasets of the wrong shape or kind, without a look at their values."""
    return [finding for rule in (_dimensions, _kinds) for finding in rule(artifact)]


def check_values(artifact: Checkable) -> list[str]:
    """Find values that the format does not allow, some rows at a time: datasets may still lie in their file."""
    return [finding for rule in (_finite, _time_ascends, _within, _holds) for finding in rule(artifact)]


def _dimensions(artifact: Checkable) -> Iterator[str]:
    lengths: dict[str, tuple[int, str]] = {}
    for spec, values in _present(artifact):
        if values.ndim != len(spec.dimensions):
            yield f"{spec.path}: has {values.ndim} dimensions, expected {len(spec.dimensions)} {spec.dimensions}"
            continue
        for label, length in zip(spec.dimensions, values.shape, strict=True):
            fixed = int(label) if label.isdigit() else FIXED.get(label)
            known, where = (fixed, "the format") if fixed else lengths.setdefault(label, (length, spec.path))
            if length != known:
                yield f"{spec.path}: {length} along '{label}', but {known} by {where}"


def _kinds(artifact: Checkable) -> Iterator[str]:
    for spec, values in _present(artifact):
        wanted = "text" if spec.units == "text" else "numbers"
        held = _KINDS.get(values.dtype.kind) or str(values.dtype)
        if held != wanted:
            yield f"{spec.path}: holds {held}, expected {wanted}"


def _finite(artifact: Checkable) -> Iterator[str]:
    for spec, values in _present(artifact):
        if values.dtype.kind != "f" or spec.gaps:
            continue
        bad, first = 0, 0
        for start, block in _blocks(values):
            # False for what is no number too.
            wrong = ~(np.abs(block) < _LARGEST).all(axis=tuple(range(1, block.ndim)))
            if not bad and wrong.any():
                first = start + int(np.argmax(wrong))
            bad += int(np.count_nonzero(wrong))
        if bad:
            fault = (
                f"beyond {_LARGEST:g}"
                if np.isfinite(values[first] if values.ndim else values[()]).all()
                else "not finite"
            )
            yield f"{spec.path}: {bad} samples are {fault}, the first at index {first}"


def _time_ascends(artifact: Checkable) -> Iterator[str]:
    time, last = {spec.path: values for spec, values in _present(artifact)}.get("time"), -np.inf
    if time is None or time.ndim != 1 or time.dtype.kind not in "iuf":
        return
    if len(time) < 2:
        yield f"time: holds {len(time)} samples; at least two are needed"
    for start, block in _blocks(time):
        falling = np.diff(block.astype(float), prepend=last) <= 0
        if falling.any():
            yield f"time: does not ascend at index {start + int(np.argmax(falling))}"
            return
        last = float(block[-1])


def _within(artifact: Checkable) -> Iterator[str]:
    """Find indices that lead to nothing, and numbers below what is possible."""
    present = list(_present(artifact))
    lengths = {label: n for spec, held in present for label, n in zip(spec.dimensions, held.shape, strict=False)}
    for spec, values in present:
        low, most = (0, lengths[spec.into] - 1) if spec.into in lengths else (spec.least, np.inf)
        if low == -np.inf or values.dtype.kind not in "iuf":
            continue
        what = f"is not an index into the {most + 1} of '{spec.into}'" if spec.into else f"is below {low:g}"
        for start, block in _blocks(values):
            wrong = (block < low) | (block > most)
            if wrong.any():
                row = int(np.nonzero(wrong)[0][0])
                where = f" at index {start + row}" if values.ndim else ""
                yield f"{spec.path}: {block[wrong][0]}{where} {what}"
                break


def _holds(artifact: Checkable) -> Iterator[str]:
    for spec, values in _present(artifact):
        if spec.holds and spec.holds not in np.asarray(values[()]).astype(str):
            yield f"{spec.path}: lacks {spec.holds}"


def _blocks(values: Any) -> Iterator[tuple[int, np.ndarray]]:
    """Give the rows of an array or of a dataset in its file, some at a time, each time with the index of the first."""
    if values.ndim == 0:
        yield 0, np.reshape(values[()], 1)
        return
    rows = max(1, _BLOCK // max(1, math.prod(values.shape[1:])))
    for start in range(0, len(values), rows):
        yield start, np.asarray(values[start : start + rows])


def _present(artifact: Checkable) -> Iterator[tuple[DatasetSpec, Any]]:
    for spec in artifact.spec.datasets:
        if spec.path in artifact.data:
            values = artifact.data[spec.path]
            yield spec, values if hasattr(values, "ndim") else np.asarray(values)


class Stored(NamedTuple):
    """An artifact that still lies in its file."""

    spec: Format
    header: Header
    data: Mapping[str, h5py.Dataset]


@contextmanager
def opened_file(path: Path) -> Iterator[h5py.File]:
    """Open a file that ends in its seal: the one gate through which anything of it is read.

    HDF5 trusts what it parses, and damage there may keep it busy for ever; so it opens nothing whose seal does not fit.
    """
    _require_sealed(path)
    try:
        with patient(path):
            file = h5py.File(path, "r")
        with file:
            with patient(path):
                _refuse_links(file)
            yield file
    except (OSError, LookupError, RuntimeError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        raise InputError(f"{path}: damaged: {one_line(error)}") from None


@contextmanager
def opened(path: Path, *wanted: Format) -> Iterator[Stored]:
    """Open an artifact of one of these formats, or of any."""
    with opened_file(path) as file:
        with patient(path):
            stored = stored_of(path, file)
        if wanted and not any(each.includes(stored.spec) for each in wanted):
            asked = " or ".join(f"{w.name} (made by {w.makers})" for w in wanted)
            made = f" made by {stored.spec.makers}" if stored.spec.kind else ""
            raise InputError(f"{path}: is a {stored.spec.name}{made}; this command needs a {asked}")
        yield stored


def stored_of(path: Path, file: h5py.File) -> Stored:
    """Look up what an open file holds; the path is for messages."""
    spec = _identify(path, file)
    # Most formats know many datasets that a file need not hold; to look for each took longer than to read the others.
    names: set[bytes] = set()
    file.id.links.visit(names.add)
    data = {d.path: own for d in spec.datasets if d.path.encode() in names and (own := dataset_of(file, d.path))}
    return Stored(spec, _read_header(file), data)


def _require_sealed(path: Path) -> None:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, not an artifact")
    if not path.is_file():
        raise InputError(f"{path}: is a device or a pipe, not a file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: is empty")
    if not is_hdf5(path):
        raise NotAnArtifactError(path, f"{path}: cannot be read as an artifact: not an HDF5 file, or damaged")
    if not is_sealed(path):
        raise NotAnArtifactError(
            path,
            f"{path}: cannot be read as an artifact: it does not end in the checksum that cpfls writes: cut off, "
            "changed by another program, or not made by cpfls; docs/format.md says how to add one",
        )
    if not read_content(path).intact:
        raise InputError(f"{path}: damaged: its content does not match the checksum at its end; copy or make it again")


def _refuse_links(file: h5py.File) -> None:
    """Refuse what leads to other places, in the file or out of it."""

    def elsewhere(name: bytes, link: h5py.h5l.LinkInfo) -> tuple[str, int] | None:
        return None if link.type == h5py.h5l.TYPE_HARD else (name.decode(errors="surrogateescape"), link.type)

    # Of the library below: opening each link as an object took a quarter of the time to open a file.
    found = file.id.links.visit(elsewhere, info=True)
    if found is not None:
        kind = {h5py.h5l.TYPE_SOFT: "SoftLink", h5py.h5l.TYPE_EXTERNAL: "ExternalLink"}.get(found[1], "link")
        raise ValueError(f"{found[0]} is a {kind}; an artifact must hold all that it refers to")


_MOST_PACKED = 1100
"""Bytes that gzip makes of one, at most: 1032 where all are equal."""


def dataset_of(file: h5py.File, path: str) -> h5py.Dataset | None:
    """Look up a dataset that lies in the file, as large as it says; None where there is something else."""
    # By the library below: a dataset looked up and asked by its object takes three times as long.
    found = h5py.h5o.open(file.id, path.encode())
    if not isinstance(found, h5py.h5d.DatasetID):
        return None
    made = found.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
        raise ValueError(f"{path} lies in another file; an artifact must hold all that it refers to")
    if found.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        raise ValueError(f"{path} holds nothing, not even a shape")
    declared = found.get_space().get_simple_extent_npoints() * found.get_type().get_size()
    held = found.get_storage_size() * (_MOST_PACKED if made.get_nfilters() else 1)
    if declared > held:
        # What no program has written reads as one number over and over, for as long as the shape says.
        raise ValueError(f"{path} declares {declared:.3g} bytes, and the file holds {held:.3g} of them at most")
    return h5py.Dataset(found, readonly=True)


def _identify(path: Path, file: h5py.File) -> Format:
    name = _text_attribute(file, "format")
    if name is None or not name.startswith("cpfls/"):
        raise InputError(f"{path}: an HDF5 file, but not made by cpfls (no root attribute 'format')")
    version = file.attrs.get("schema_version")
    if not isinstance(version, int | np.integer):
        raise InputError(f"{path}: the root attribute 'schema_version' is missing or not a number")
    if version < 1:
        raise InputError(f"{path}: schema_version = {version}: damaged; versions count from 1")
    if version > SCHEMA_VERSION:
        raise InputError(
            f"{path}: schema_version = {version}: written by a newer cpfls; this one reads up to {SCHEMA_VERSION}"
        )
    if version < SCHEMA_VERSION:
        raise old_file(path, file)
    known = record_of_format(name, _text_attribute(file, "kind") or "")
    if known is None:
        where = "command; `cpfls info` shows what it holds" if stage_module(file.attrs) else "cpfls"
        raise InputError(f"{path}: format = '{name}': not known to this {where}")
    return known.spec()


_MAKERS = {
    "flight": "simulate` or `cpfls import",
    "twin": "simulate",
    "selection": "reduce",
    "prediction": "predict",
    "gains": "tune",
    "disagreement": "compare",
    "diagnosis": "diagnose",
    "extended": "extend",
    "identified": "identify",
    "model": "identify",
    "flight-numbers": "changed",
}
"""Commands that made files of earlier versions, by kind or format, where they are not called alike."""


def old_file(path: Path, file: h5py.File) -> InputError:
    """Say of a file of an earlier version which command makes it again."""
    version = file.attrs.get("cpfls_version", "1")
    name = str(file.attrs.get("kind", "") or file.attrs.get("format", "")).removeprefix("cpfls/")
    return InputError(
        f"{path}: was written by cpfls {version}, whose files this version does not read; make it again with "
        f"`cpfls {_MAKERS.get(name, name)}`"
    )


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where the result of a stage comes from.

    Attributes
    ----------
    stage : str
        That made it, as its command is typed.
    inputs : mapping of str to InputFile
        By role.
    seed : int or None
        None where nothing is drawn.
    config : str
        The resolved study; empty where there is none.
    cautions : tuple of str
        What speaks against what it rests on.
    """

    stage: str
    inputs: Mapping[str, InputFile] = field(default_factory=dict)
    seed: int | None = None
    config: str = ""
    cautions: tuple[str, ...] = ()
    version: str = __version__


def origin_of(file: h5py.File) -> Origin:
    """Read where a result comes from."""
    inputs = {
        role: InputFile(*(str(own.attrs[key]) for key in ("name", "sha256", "format")))
        for role, own in file.get(INPUTS, {}).items()
    }
    return Origin(
        stage=str(file.attrs["stage"]),
        inputs=inputs,
        seed=int(file.attrs["seed"]) if "seed" in file.attrs else None,
        config=bytes(file[CONFIG][()]).decode() if CONFIG in file else "",
        cautions=tuple(str(file.attrs["cautions"]).splitlines()),
        version=str(file.attrs["cpfls_version"]),
    )


def _read_header(file: h5py.File) -> Header:
    inputs = {
        role: InputFile(*(str(group.attrs[key]) for key in ("name", "sha256", "format")))
        for role, group in file.get(INPUTS, {}).items()
    }
    config = bytes(file[CONFIG][()]).decode()
    if text_sha256(config) != file.attrs["config_sha256"]:
        raise ValueError(f"/{CONFIG} was changed after the file was written (config_sha256 differs)")
    cautions = tuple(str(file.attrs.get("cautions", "")).splitlines())
    return Header(str(file.attrs["cpfls_version"]), int(file.attrs["seed"]), config, inputs, cautions)


def require_all(path: Path, stored: Stored) -> None:
    """Refuse an artifact that lacks what every one of its format holds."""
    record = record_of_format(stored.spec.name, stored.spec.kind)
    assert record is not None, "its format is known"
    missing = record.lacking(stored.data)
    if missing:
        raise InputError(f"{path}: the {stored.spec.name} lacks {some(missing, 5)}; make it again")


def refuse(path: Path, findings: Sequence[str]) -> None:
    """Refuse a file in which something was found."""
    if findings:
        raise InputError("\n".join(f"{path}: {finding}" for finding in findings))


def one_line(error: Exception) -> str:
    """Word an error of a library in one line."""
    return " ".join(str(error.args[0] if error.args else error).split())


def _text_attribute(file: h5py.File, name: str) -> str | None:
    value = file.attrs.get(name)
    return value if isinstance(value, str) else None
