"""Loops compiled at the first call on a machine, and kept where a folder can be written."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])

_ALWAYS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class _Compiling(event.Listener):
    """Told when something is compiled that no folder keeps."""

    def on_start(self, event: object) -> None:  # noqa: ARG002
        _say_compiling()

    def on_end(self, event: object) -> None:
        pass


@cache
def _say_compiling() -> None:
    """Tell once in a process why nothing happens for a while."""
    logging.getLogger("cpfls_cli").info("compiling for this processor, which takes up to half a minute and is kept")


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call]


def compiled(function: Function, **options: Any) -> Function:
    """Compile at the first call on a machine; other threads run meanwhile, and dividing by zero gives infinity.

    Parameters
    ----------
    function : callable
    **options
        Of `numba.njit`.

    Returns
    -------
    callable
        Compiled anew in each process where no folder can be written that would keep it.
    """
    options |= _ALWAYS
    try:
        return cast(Function, numba.njit(cache=True, **options)(function))
    except RuntimeError:
        return cast(Function, numba.njit(**options)(function))


def part(function: Function, **options: Any) -> Function:
    """Compile into what calls it, and only there: ways for Python to call each part took a fifth of the compiling."""
    options |= _ALWAYS | {"no_cpython_wrapper": True}
    return cast(Function, numba.njit(**options)(function))
