"""Settings of a periodic fuzzy system that is fitted by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

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
        functions = self.membership_functions
        for count in functions if isinstance(functions, tuple) else (functions,):
            if count is not None and count < 1:
                raise SettingError("membership_functions", f"membership_functions = {functions}: give 1 or more")
        if self.consequents not in ("harmonic", "seesaw"):
            raise SettingError("consequents", f"consequents = {self.consequents!r}: give 'harmonic' or 'seesaw'")
        if self.products not in ("additive", "tensor"):
            raise SettingError("products", f"products = {self.products!r}: give 'additive' or 'tensor'")
        if self.harmonic_order < 1:
            raise SettingError("harmonic_order", f"harmonic_order = {self.harmonic_order}: give 1 or more")
        if not 0 <= self.ridge_weight < float("inf"):
            raise SettingError("ridge_weight", f"ridge_weight = {self.ridge_weight}: give a number of 0 or more")
        if not SMALLEST_TOLERANCE <= self.rank_tolerance < 1:
            message = f"rank_tolerance = {self.rank_tolerance}: give a number from {SMALLEST_TOLERANCE:g} to below 1"
            raise SettingError("rank_tolerance", message)
