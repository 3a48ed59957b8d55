"""The base of all settings: frozen, keyword-only dataclasses that the config validates at the edge."""

from __future__ import annotations

from typing import Any, ClassVar


class Settings:
    """Base class of settings.

    The domain only declares plain dataclasses with `typing.Annotated` bounds; the attribute below tells the
    validating library to refuse unknown keys, text for numbers, and values that are not finite.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "allow_inf_nan": False, "strict": True}
