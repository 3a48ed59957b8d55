"""The forms in which a report is written."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path


class Form(StrEnum):
    """What a report is written as."""

    HTML = "html"
    MARKDOWN = "md"
    JSON = "json"


_SUFFIXES = {".md": Form.MARKDOWN, ".markdown": Form.MARKDOWN, ".json": Form.JSON}


def form_of(path: Path) -> Form:
    """Choose a form by the suffix of a file; HTML where that says nothing."""
    return _SUFFIXES.get(path.suffix.lower(), Form.HTML)
