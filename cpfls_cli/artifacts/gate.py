"""What files of results have in common, where they come from, and the one gate through which they are opened."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from cpfls_cli.artifacts.patience import patient
from cpfls_cli.errors import InputError, NotAnArtifactError
from cpfls_cli.files import FileState, is_hdf5, is_sealed, read_content, state_of
from cpfls_cli.version import __version__

SCHEMA_VERSION = 4
"""Raised when a dataset is renamed, removed or changes its meaning; new optional datasets do not raise it."""

CONFIG = "config"
"""Path of the resolved study, in every artifact."""

INPUTS = "inputs"
"""Path of the group with one group for each input file, by role."""

PART = 8192
"""Samples of a compressed artifact that are written at a time, each such part compressed on its own."""


class DatasetSpec(NamedTuple):
    """One dataset of a file.

    Attributes
    ----------
    path : str
        HDF5 path below the root.
    dimensions : tuple of str
        Labels of the axes; time or samples first. Digits fix the length, ``axis`` is 3.
    units : str
        SI units; ``1`` for a pure number, ``text`` for text.
    frame : str
        Frame of reference of its components.
    description : str
        What it holds.
    """

    path: str
    dimensions: tuple[str, ...]
    units: str
    frame: str
    description: str


@dataclass(frozen=True)
class InputFile:
    """A file that an artifact was made from.

    Attributes
    ----------
    name : str
        File name without its folder.
    sha256 : str
        Hexadecimal.
    format : str
        Artifact format, or the suffix of another file.
    """

    name: str
    sha256: str
    format: str


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
        raise InputError(f"{path}: damaged: {' '.join(str(error.args[0] if error.args else error).split())}") from None


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


def dataset_of(group: h5py.Group, name: str) -> h5py.Dataset | None:
    """Look up a dataset that lies in the file, as large as it says; None where there is something else."""
    # By the library below: a dataset looked up and asked by its object takes three times as long.
    found = h5py.h5o.open(group.id, name.encode())
    if not isinstance(found, h5py.h5d.DatasetID):
        return None
    space, wrong, packed = found.get_space(), "", False
    # What lies in the file in one piece has a place there, and nothing else has.
    if found.get_offset() is None:
        made = found.get_create_plist()
        packed = made.get_nfilters() > 0
        if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
            wrong = "lies in another file; an artifact must hold all that it refers to"
    declared = space.get_simple_extent_npoints() * found.get_type().get_size()
    held = found.get_storage_size() * (_MOST_PACKED if packed else 1)
    if space.get_simple_extent_type() == h5py.h5s.NULL:
        wrong = wrong or "holds nothing, not even a shape"
    elif declared > held:
        # What no program has written reads as one number over and over, for as long as the shape says.
        wrong = wrong or f"declares {declared:.3g} bytes, and the file holds {held:.3g} of them at most"
    if wrong:
        raise ValueError(f"{group.name}/{name}".lstrip("/") + f" {wrong}")
    return h5py.Dataset(found, readonly=True)


def held_format(path: Path, file: h5py.File) -> str:
    """Name the format of an open file; one that cpfls did not make is refused."""
    name = file.attrs.get("format")
    if not isinstance(name, str) or not name.startswith("cpfls/"):
        raise InputError(f"{path}: an HDF5 file, but not made by cpfls (no root attribute 'format')")
    return name


MAKERS = {
    "flight": "simulate` or `cpfls import",
    "twin": "simulate",
    "selection": "reduce",
    "prediction": "replay",
    "gains": "tune",
    "disagreement": "compare",
    "diagnosis": "diagnose",
    "extended": "extend",
    "identified": "identify",
    "model": "identify",
    "flight-numbers": "changed",
    "checkpoint": "identify",
    "vehicle-checkpoint": "vehicle",
}
"""Commands that made files of this version and earlier ones, by kind or format, where they are not called alike."""


def other_version(path: Path, file: h5py.File) -> InputError:
    """Say of a file of a newer version that it is one, and of an earlier one which command makes it again."""
    schema = file.attrs.get("schema_version")
    if isinstance(schema, int | np.integer) and schema > SCHEMA_VERSION:
        return InputError(
            f"{path}: schema_version = {schema}: written by a newer cpfls; this one reads up to {SCHEMA_VERSION}"
        )
    version = file.attrs.get("cpfls_version", "1")
    name = str(file.attrs.get("kind", "") or file.attrs.get("format", "")).removeprefix("cpfls/")
    return InputError(
        f"{path}: was written by cpfls {version}, whose files this version does not read; make it again with "
        f"`cpfls {MAKERS.get(name, name)}`"
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


def stage_module(attributes: Mapping[str, Any]) -> str:
    """Name the module of the stage that made a file, by its root attributes; empty where it holds no result.

    A module ends in a line where Python has the word of its command; one with a line before its name is no command:
    other stages keep what it makes.
    """
    module = str(attributes.get("stage", "")).replace("-", "_")
    module += "_" * iskeyword(module)
    names = (module, f"_{module}") if re.fullmatch(r"[a-z]\w*", module) else ()
    folder = Path(__file__).parents[1] / "stages"
    return next((name for name in names if (folder / f"{name}.py").is_file()), "")


def identified(path: Path, file: h5py.File) -> tuple[str, Origin]:
    """Tell the format of an open file, and where it comes from; one that no stage of this version made is refused."""
    name = held_format(path, file)
    if file.attrs.get("schema_version") != SCHEMA_VERSION or not stage_module(file.attrs):
        raise other_version(path, file)
    return name, origin_of(file)


@lru_cache(maxsize=64)
def _known_of(state: FileState) -> tuple[str, Origin]:
    with opened_file(state.path) as file, patient(state.path):
        return identified(state.path, file)


def _known(path: Path) -> tuple[str, Origin] | None:
    """Look into a file that stays as it is once only; None where it is no good: who reads it then says why."""
    try:
        return _known_of(state_of(path))
    except (OSError, ValueError, InputError):
        return None


def format_name(path: Path) -> str | None:
    """Tell the format of a file without reading it whole; None where no stage made it."""
    known = _known(path)
    return None if known is None else known[0]


def read_origin(path: Path) -> Origin:
    """Read where a result comes from, and none of its data."""
    if (known := _known(path)) is not None:
        return known[1]
    with opened_file(path) as file, patient(path):
        return identified(path, file)[1]
