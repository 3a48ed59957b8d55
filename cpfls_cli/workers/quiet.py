"""Keep Dask's own log off the user's terminal."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

# Those that Dask gives a level or a handler of their own; all others take theirs from these.
_NOISY = ("distributed", "distributed.client", "tornado", "tornado.application", "asyncio")


@contextmanager
def quiet() -> Iterator[None]:
    """Silence Dask's log; what matters of it comes as an error."""
    loggers = [logging.getLogger(name) for name in _NOISY]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
