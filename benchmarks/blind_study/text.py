"""Tables and shares as Markdown."""

from __future__ import annotations

NONE_TRIED = "none tried"


def table(heads, rows):
    """Write a table; nothing where there are no rows."""
    if not rows:
        return ""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "/") for cell in line) + " |" for line in lines)


def percent(flags):
    """Write how many are true, and of how many."""
    flags = list(flags)
    return f"{sum(flags)} of {len(flags)} ({100 * sum(flags) / len(flags):.1f} %)" if flags else NONE_TRIED
