"""Packages that only some commands need: loaded where they are used, with a remedy where they are missing."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from cpfls_cli.errors import InputError


def require_package(module: str, extra: str, path: Path) -> ModuleType:
    """Import a module of a package that reads a kind of file.

    Parameters
    ----------
    extra : str
        The extra of this program that installs it.
    path : Path
        The file to read.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        message = f'{path}: reading {path.suffix} needs the package {package}; pip install "cpfls[{extra}]"'
        raise InputError(message) from None
