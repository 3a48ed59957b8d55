"""A vehicle as pure functions of state, rotor speeds and parameters, in CasADi and in JAX, and flown in both."""

from __future__ import annotations

from collections.abc import Sequence

from cpfls_cli.export.holding import Held
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import python_source


def casadi_text(sheet: Sheet, _held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for CasADi; parameters as those of the other targets."""
    return python_source(sheet, file, "casadi", remarks)


def jax_text(sheet: Sheet, _held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for JAX; parameters as those of the other targets."""
    return python_source(sheet, file, "jax", remarks)
