"""The vehicle as weights of terms is the vehicle; what is no such sum is left out."""

import numpy as np
import pytest

from cpfls_cli.export.numbers import NoPolynomialError, Polynomial, motion_terms, weights_of
from cpfls_cli.export.points import parts_along, reference_points
from tests.builders.vehicle_models import HEXA, QUAD, whole


@pytest.mark.parametrize("vehicle", [QUAD, HEXA], ids=["four rotors", "six rotors"])
def test_weights_are_those_of_the_parts(vehicle):
    model = whole(vehicle)
    points = reference_points(model, np.random.default_rng(2), 40)
    weights = weights_of(model.parts, vehicle)
    parts = parts_along(model, points.air, points.rate, points.rotor)
    assert [*parts] == [*weights, "remainder"]
    terms = motion_terms(points.air, points.rate)
    for name, own in weights.items():
        found = np.einsum("rtu,nt,nu->nr", own, terms, points.rotor)
        assert np.abs((found - parts[name]) / points.scale).max() < 1e-12


@pytest.mark.parametrize("work", [lambda x: 1 / x, lambda x: x > 0, lambda x: x**0.5, lambda x: x / x])
def test_what_no_polynomial_is_is_refused(work):
    with pytest.raises(NoPolynomialError):
        work(Polynomial({("u",): 2.0}))
