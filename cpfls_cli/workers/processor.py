"""The processor, as far as the code depends on it that is compiled for it."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class Processor:
    """What a compiler makes code for.

    Attributes
    ----------
    name : str
        Architecture and model.
    instructions : frozenset of str
        Extensions of the instruction set that may be used.
    """

    name: str
    instructions: frozenset[str]


def processor() -> Processor:
    """Describe the processor of this machine."""
    # The compiler behind numba; slow to load, and needed only where workers are elsewhere.
    compiler = import_module("llvmlite.binding")
    usable = (name for name, there in compiler.get_host_cpu_features().items() if there)
    return Processor(f"{platform.machine()} {compiler.get_host_cpu_name()}", frozenset(usable))
