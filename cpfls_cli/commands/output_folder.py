"""An output that is a folder: refused before anything is computed, and filled whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cpfls_cli.errors import InputError


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
