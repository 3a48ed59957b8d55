"""Results as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def plain(value: Any) -> Any:
    """Replace what JSON has no word for: numbers that are not finite become null.

    Parameters
    ----------
    value : object
        Nested mappings, lists and tuples of numbers and text.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return plain(value.item()) if hasattr(value, "item") else value
