"""Errors that a user can cause, each with one message that names the file, the key, the value and the remedy."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_CONTROL = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\xad\\u061c\\u180e\\u200b-\\u200f\\u2028-\\u202e\\u2060-\\u206f\\ufeff\\ufff9-\\ufffb"
    "\\U000e0000-\\U000e007f]"
)
"""What a terminal or a page obeys or does not show: controls but line breaks and tabs, and what turns text."""


class CpflsError(Exception):
    """Base of every error that ends a command with a message instead of a traceback."""

    exit_code = 1


class ComputationError(CpflsError):
    """A stage ran on valid input and could not produce a result (exit code 1)."""


class OutputError(CpflsError):
    """A file can no longer be written, for example on a full disk (exit code 1)."""


class StoppedError(CpflsError):
    """Work was stopped by an interrupt before it had a result.

    Parameters
    ----------
    exit_code : int
        128 plus the number of the signal.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class InputError(CpflsError):
    """A file, an artifact or an option is not what the command needs (exit code 2)."""

    exit_code = 2


class NotAnArtifactError(InputError):
    """A file that an artifact was expected in holds something else (exit code 2).

    Attributes
    ----------
    path : Path
        Of the file.
    """

    def __init__(self, path: Path, message: str) -> None:
        super().__init__(message)
        self.path = path


class ConfigError(InputError):
    """One or more keys of a study config are wrong; the message lists all of them (exit code 2)."""


class SettingError(ValueError):
    """A combination of settings is wrong; the error names the key of the section.

    Parameters
    ----------
    key : str
        Key inside the section whose settings are validated.
    message : str
        What is wrong and what to do about it.
    """

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


@contextmanager
def about(what: object, *kinds: type[CpflsError]) -> Iterator[None]:
    """Say in front of an error of one of these kinds what it is about; it becomes one of the first kind that it is."""
    try:
        yield
    except kinds as error:
        kind = next(kind for kind in kinds if isinstance(error, kind))
        raise kind(f"{what}: {error}") from None


def visible(text: str) -> str:
    """Write control characters as escapes: names in files are data, and may hold what is taken for orders."""
    return _CONTROL.sub(lambda found: repr(found.group())[1:-1], text)


def install_command(extra: str) -> str:
    """Say how to install what an optional part needs."""
    return f'pip install "cpfls[{extra}]"'
