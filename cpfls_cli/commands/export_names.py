"""Names of an export: its form, its files, and the prefix of the names in it."""

from __future__ import annotations

import keyword
import re
from pathlib import Path

from cpfls_cli.errors import InputError
from cpfls_cli.export.text import checked_identifier, identifier

_ENDINGS = {"json": ".json", "c": ".c", "python": ".py"}
# What the module imports: under such a name it would import itself.
_IMPORTED = ("numpy", "sys", "warnings")


def form_of(output: Path) -> str:
    """Choose a form by the suffix of a file.

    Returns
    -------
    {"json", "c", "python"}

    Raises
    ------
    InputError
    """
    for form, ending in _ENDINGS.items():
        if output.suffix == ending:
            return form
    endings = ", ".join(f"{ending} ({form})" for form, ending in _ENDINGS.items())
    raise InputError(f"{output}: the ending tells no form; end the name in one of {endings}")


def prefix_of(output: Path, form: str, name: str | None) -> str:
    """Choose the prefix of the names in source code.

    Parameters
    ----------
    name : str or None
        What was asked for.

    Raises
    ------
    InputError
    """
    if name is None:
        return identifier(output.stem)
    if form == "python":
        raise InputError(f"--name {name}: a module of Python is called as its file is; leave --name out, or rename -o")
    return checked_identifier(name)


def outputs_of(output: Path, form: str) -> list[Path]:
    """Name the files to be written, the one that needs the others last.

    Raises
    ------
    InputError
    """
    ending = _ENDINGS[form]
    if output.suffix != ending:
        raise InputError(f"{output}: --format {form} writes a file that ends in {ending}; name it so")
    if form == "python" and not _importable(output.stem):
        raise InputError(
            f"{output}: Python cannot import a module of this name; use letters, digits and _, no digit first, none of "
            f"its own words, not {' or '.join(_IMPORTED)}, such as {identifier(output.stem)}_model.py"
        )
    if form != "c":
        return [output]
    if not re.fullmatch(r"[A-Za-z0-9_.+-]+", output.stem):
        raise InputError(f"{output}: C includes its header by name; use letters, digits and any of _ . + - in it")
    return [output.with_suffix(".h"), output]


def _importable(stem: str) -> bool:
    return stem.isidentifier() and not keyword.iskeyword(stem) and stem not in _IMPORTED
