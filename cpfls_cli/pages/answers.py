"""The answer that a command gave with an artifact, worded again from what the artifact holds."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from cpfls_cli.artifacts.prediction import PredictionRecord
from cpfls_cli.artifacts.spec import Record
from cpfls_cli.config.load import validate
from cpfls_cli.config.study import resolved
from cpfls_cli.config.yaml_text import parse_yaml
from cpfls_cli.errors import ConfigError
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Block, Text


def answer_again(page: str, record: Record, path: Path) -> Iterator[Block]:
    """Give the answer of the command that made an artifact, or say why it cannot be worded.

    Parameters
    ----------
    page : str
        Module of `pages` that words it.
    """
    try:
        study = validate(parse_yaml(record.origin.config, f"{path}: /config"), f"{path}: /config")
    except ConfigError as error:
        yield Text(f"what its command answered cannot be shown: {error}", "warning")
        return
    source = Source(path.name, "", record, resolved(study), study.vehicle, 0)
    answer = import_module(f"cpfls_cli.pages.{page}").answer
    yield from answer(record.findings if isinstance(record, PredictionRecord) else source)
