"""Settings of a periodic fuzzy system that is fitted by itself."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
from typing import Annotated, TypeGuard

from annotated_types import Ge, Lt
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.fuzzy.consequents import Consequents, Products
from cpfls_cli.settings import Settings

SMALLEST_TOLERANCE = 3e-7
"""The sums of products behind a fit square the singular values: below this share of the largest they are rounding."""


@dataclass(frozen=True, kw_only=True)
class PeriodicSettings(Settings):
    """Structure and regularisation of a fitted periodic system."""

    membership_functions: Annotated[
        int | tuple[int, ...] | None,
        Doc("functions of each input, or one number per input; null: what the samples carry, up to 7 (one input: 21)"),
    ] = None
    consequents: Annotated[Consequents, Doc("what each rule adds up: sines and cosines, or the paper's seesaw")] = (
        "harmonic"
    )
    harmonic_order: Annotated[int, Ge(1), Doc("highest harmonic of each rule (consequents: harmonic)")] = 1
    products: Annotated[Products, Doc("whether the features of two inputs are joined or multiplied")] = "tensor"
    ridge_weight: Annotated[float, Ge(0), Doc("weight of the squared coefficients, per sample")] = 0.0
    rank_tolerance: Annotated[
        float, Ge(SMALLEST_TOLERANCE), Lt(1), Doc("singular values below this share of the largest count as zero")
    ] = 1e-6

    def __post_init__(self) -> None:
        """Refuse what no system can have: these settings are written in Python, where no config is checked."""
        # A list is what one writes first; nothing but this sets a field of a frozen instance.
        object.__setattr__(self, "membership_functions", _counts(self.membership_functions))
        if self.consequents not in ("harmonic", "seesaw"):
            raise SettingError("consequents", f"consequents = {self.consequents!r}: give 'harmonic' or 'seesaw'")
        if self.products not in ("additive", "tensor"):
            raise SettingError("products", f"products = {self.products!r}: give 'additive' or 'tensor'")
        if not _is_count(self.harmonic_order):
            message = f"harmonic_order = {self.harmonic_order!r}: give a whole number of 1 or more"
            raise SettingError("harmonic_order", message)
        if not (isinstance(self.ridge_weight, Real) and 0 <= self.ridge_weight < float("inf")):
            raise SettingError("ridge_weight", f"ridge_weight = {self.ridge_weight!r}: give a number of 0 or more")
        if not (isinstance(self.rank_tolerance, Real) and SMALLEST_TOLERANCE <= self.rank_tolerance < 1):
            message = f"rank_tolerance = {self.rank_tolerance!r}: give a number from {SMALLEST_TOLERANCE:g} to below 1"
            raise SettingError("rank_tolerance", message)


def _is_count(value: object) -> TypeGuard[Integral]:
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 1


def _counts(functions: object) -> int | tuple[int, ...] | None:
    if functions is None:
        return None
    several = isinstance(functions, list | tuple)
    given = list(functions) if isinstance(functions, list | tuple) else [functions]
    counts = [int(count) for count in given if _is_count(count)]
    if len(counts) < max(len(given), 1):
        message = f"membership_functions = {functions!r}: give whole numbers of 1 or more, one or one for each input"
        raise SettingError("membership_functions", message)
    return tuple(counts) if several else counts[0]
