"""Outputs, files and folders: refused before anything is computed, and written whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cpfls_cli.errors import InputError, OutputError


def check_output(path: Path, force: bool) -> None:
    """Refuse an output that cannot or must not be written, before anything is computed.

    Parameters
    ----------
    force : bool
        Allow an existing file to be replaced.

    Raises
    ------
    InputError
        If the file exists, its folder does not, or the folder cannot be written.
    """
    with _asked_for(path):
        if path.is_dir():
            raise InputError(f"{path}: is a folder; -o names a file")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is a device or a pipe; -o names a file")
        if path.exists() and not force:
            raise InputError(f"{path}: exists already; --force replaces it")


@contextmanager
def _asked_for(path: Path) -> Iterator[None]:
    """Make sure that the folder can be written; before anything is computed it is the option that is wrong."""
    try:
        with atomic_path(path):
            yield
    except OutputError as error:
        raise InputError(str(error)) from None


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary name beside a file, and remove what is left of it afterwards.

    Parameters
    ----------
    path : Path
        The file to be written in the end; the caller moves the temporary file there with `os.replace`.

    Raises
    ------
    OutputError
        If the folder does not exist or cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise OutputError(f"{path}: cannot write into the folder {path.parent}: {error.strerror}") from None
    temporary = Path(name)
    try:
        os.close(handle)
        # mkstemp makes private files; an artifact gets the permissions any new file would.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then move it in place.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        try:
            temporary.write_text(text, encoding="utf-8")
            os.replace(temporary, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None


def check_folder(folder: Path, force: bool) -> None:
    """Refuse a folder that cannot or must not be filled.

    Parameters
    ----------
    force : bool
        Allow files in it to be replaced.

    Raises
    ------
    InputError
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; -o names a folder")
    if folder.exists() and any(folder.iterdir()) and not force:
        raise InputError(f"{folder}: exists already and is not empty; --force replaces what is in it")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"{folder}: cannot be made: there is no folder {folder.parent}")


@contextmanager
def filled_folder(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    """Give a temporary folder beside a folder, and move its files in place at the end.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    names : sequence of str
        Files that may be written; those of an earlier run that are not written again are removed.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    try:
        temporary = Path(tempfile.mkdtemp(dir=folder.absolute().parent, prefix=f".{folder.name}.", suffix=".part"))
    except OSError as error:
        raise InputError(f"{folder}: cannot write beside it: {error.strerror}") from None
    try:
        yield temporary
        folder.mkdir(exist_ok=True)
        for name in names:
            if (temporary / name).exists():
                os.replace(temporary / name, folder / name)
            else:
                (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
