"""The columns of a periodic system of one or two angles: everything but its coefficients."""

from __future__ import annotations

from dataclasses import dataclass

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.basis import Antecedent, Basis, antecedent, basis
from cpfls_cli.fuzzy.consequents import Consequents, Features, Products, feature_count, features, row_products
from cpfls_cli.fuzzy.inputs import InputRange, map_input, wrap

# The map of the full circle takes no range from the data.
_NO_RANGE = InputRange(0.0, 1.0)


@dataclass(frozen=True)
class PeriodicStructure:
    """Partitions and consequents of a periodic system, ``f(q) = columns(q) @ coefficients``.

    Attributes
    ----------
    breakpoints : tuple of array, shape (functions,)
        One partition per input, of the angle modulo 2 pi over 2 pi; the first and the last function are one.
    consequents, harmonic_order, products
        See `feature_count`.
    """

    breakpoints: tuple[Array, ...]
    consequents: Consequents
    harmonic_order: int
    products: Products

    @property
    def inputs(self) -> int:
        """Number of input angles."""
        return len(self.breakpoints)

    @property
    def coefficients(self) -> int:
        """Number of coefficients: rules times features of a rule."""
        count = feature_count(self.inputs, self.consequents, self.harmonic_order, self.products)
        for partition in self.breakpoints:
            count *= max(len(partition) - 1, 1)
        return count

    def columns(self, angles: Array) -> Array:
        """Evaluate the columns alone.

        Parameters
        ----------
        angles : array, shape (samples, inputs), rad

        Returns
        -------
        array, shape (samples, coefficients)
        """
        rules, consequent = self._parts(angles)
        firing = rules[0].value
        for rule in rules[1:]:
            firing = row_products(firing, rule.value)
        return row_products(firing, consequent.value)

    def basis(self, angles: Array) -> Basis:
        """Evaluate the columns and their derivatives.

        Parameters
        ----------
        angles : array, shape (samples, inputs), rad
        """
        return basis(*self._parts(angles))

    def _parts(self, angles: Array) -> tuple[list[Antecedent], Features]:
        single = [wrap(angle) for angle in angles.T]
        mapped = [map_input(angle, "full-circle", True, _NO_RANGE) for angle in single]
        rules = [
            antecedent(one, partition, circular=True) for one, partition in zip(mapped, self.breakpoints, strict=True)
        ]
        return rules, features(single, mapped, self.consequents, self.harmonic_order, self.products)
