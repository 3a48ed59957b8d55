"""Loops compiled at the first call on a machine, and kept where a folder can be written."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache, partial, update_wrapper
from threading import RLock
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

_ALWAYS = {"nogil": True, "error_model": "numpy"}
_AT_ONE_TIME = RLock()


class _Loop:
    """A function that numba compiles; loading numba takes half a second, and waits for the first call of any."""

    def __init__(self, function: Callable[..., Any], compiler: Callable[..., Any]) -> None:
        self._function, self._compiler = function, compiler
        self._compiled: Callable[..., Any] | None = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.ready()(*arguments)

    def ready(self) -> Callable[..., Any]:
        """Give what numba makes of it, once what it may call is known to numba too."""
        if self._compiled is None:
            with _AT_ONE_TIME:
                self._make_ready()
        assert self._compiled is not None
        return self._compiled

    def _make_ready(self) -> None:
        """Replace all of a module at once: numba knows what a loop calls by the names of its module."""
        if self._compiled is not None:
            return
        names = self._function.__globals__
        loops = {name: own for name, own in names.items() if isinstance(own, _Loop)}
        here = {own for own in loops.values() if own._function.__globals__ is names} | {self}
        made = {own: own._compiler(own._function) if own in here else own.ready() for own in {*loops.values(), self}}
        names.update({name: made[own] for name, own in loops.items()})
        for own, made_ready in made.items():
            own._compiled = made_ready


@cache
def _numba() -> Any:
    """Load numba, and take note when it compiles something that no folder keeps."""
    import numba
    from numba.core import event

    class Compiling(event.Listener):
        def on_start(self, event: object) -> None:  # noqa: ARG002
            _say_compiling()

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Compiling())  # type: ignore[no-untyped-call]
    return numba


@cache
def _say_compiling() -> None:
    """Tell once in a process why nothing happens for a while."""
    logging.getLogger("cpfls_cli").info("compiling for this processor, which takes up to half a minute and is kept")


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
    return cast(Function, _Loop(function, partial(_kept, options=_ALWAYS | {"no_cfunc_wrapper": True} | options)))


def _kept(function: Callable[..., Any], options: dict[str, Any]) -> Callable[..., Any]:
    njit: Callable[..., Any] = _numba().njit
    try:
        return cast(Callable[..., Any], njit(cache=True, **options)(function))
    except RuntimeError:
        return cast(Callable[..., Any], njit(**options)(function))


def part(function: Function, **options: Any) -> Function:
    """Compile into what calls it, and only there: ways for Python to call each part took a fifth of the compiling."""
    wrappers = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}

    def compiler(own: Callable[..., Any]) -> Any:
        return _numba().njit(**_ALWAYS, **wrappers, **options)(own)

    return cast(Function, _Loop(function, compiler))
