"""Check plain data against the settings classes: a study, or every error at once."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from cpfls_cli.config.messages import describe_errors, without_unknown_keys
from cpfls_cli.config.preset import with_preset
from cpfls_cli.config.study import SECTIONS, Study


def checked(data: dict[str, Any], source: str) -> tuple[Study | None, list[str]]:
    """Check plain data as a study.

    Parameters
    ----------
    source : str
        Name of the file, for messages.

    Returns
    -------
    study : Study or None
        None where there are errors.
    errors : list of str
        One line for each wrong key.
    """
    # A section that is named but left empty means its defaults.
    filled = with_preset({key: {} if value is None and key in SECTIONS else value for key, value in data.items()})
    try:
        return Study.model_validate_json(json.dumps(filled)), []
    except ValidationError as error:
        errors = [*error.errors(), *_hidden_errors(filled, error.errors())]
        return None, describe_errors(errors, filled, source)


def _hidden_errors(data: dict[str, Any], found: list[ErrorDetails]) -> list[ErrorDetails]:
    """Find what an unknown key hides: rules between the keys of a section run only where all its keys are known."""
    try:
        Study.model_validate_json(json.dumps(without_unknown_keys(data, found)))
    except ValidationError as error:
        return error.errors()
    return []
