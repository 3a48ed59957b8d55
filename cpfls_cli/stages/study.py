"""What the stages take from a study beside its settings: messages that name keys, and random generators."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from cpfls_cli.config.resolved import resolved
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ConfigError, SettingError


@contextmanager
def settings_of(section: str, study: Study) -> Iterator[None]:
    """Name the config key and its value where the numerics refuse a setting that does not suit the data.

    Parameters
    ----------
    section : str
        Section of the config whose settings are in use.

    Raises
    ------
    ConfigError
    """
    try:
        yield
    except SettingError as error:
        key = f"{section}.{error.key}"
        raise ConfigError(f"{key} = {json.dumps(_value(study, key))}: {error}") from None


def _value(study: Study, key: str) -> Any:
    value: Any = resolved(study, [key])
    for part in key.split("."):
        value = value[part]
    return value


def generator(study: Study, stage: str) -> np.random.Generator:
    """Make the random generator of a stage, so that stages draw independently of each other."""
    return np.random.default_rng([study.seed, zlib.crc32(stage.encode())])
