"""Settings of a sweep: which settings of a study are tried, and how often each."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated, Any

from annotated_types import Ge, Le, MinLen
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings


@dataclass(frozen=True, kw_only=True)
class SweepSetting(Settings):
    """One column of a sweep: what is different in it."""

    name: Annotated[str, MinLen(1), Doc("how it is called in tables")]
    set: Annotated[
        dict[str, Any],
        Doc("keys of reduction and identification, as --set takes them; reduction.size: null learns from all samples"),
    ] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SweepSettings(Settings):
    """What `cpfls sweep` runs: every setting with every seed."""

    seeds: Annotated[int, Ge(1), Le(10_000), Doc("runs of each setting, with seed, seed + 1, seed + 2 and so on")] = 10
    set: Annotated[dict[str, Any], Doc("keys of every setting that does not set them itself")] = field(
        default_factory=dict
    )
    settings: Annotated[
        tuple[SweepSetting, ...], Doc("what is tried, by name; empty: the study as it is, once for each seed")
    ] = ()

    def __post_init__(self) -> None:
        """Refuse settings that cannot be told apart."""
        count = Counter(setting.name for setting in self.settings)
        for number, setting in enumerate(self.settings):
            if count[setting.name] > 1:
                raise SettingError(f"settings.{number}.name", "stands more than once; give each setting its own name")
