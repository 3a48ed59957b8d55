"""Steps of the shapes of effects: none too far or to where nothing is said, and no work for what does not move."""

from types import SimpleNamespace

import numpy as np

from cpfls_cli.gap.balance import refine
from cpfls_cli.gap.balance.balance_system import System, system
from tests.builders.gap_flights import candidate, fly, weak


class Ridge:
    """Squares that fall by next to nothing along steps a thousandth of what the linear system asks for."""

    flights = ()
    vehicle = None
    shapes = (SimpleNamespace(bounds=lambda _vehicle: (-1e9, 1e9)),)
    rotor_wrench = None

    def __init__(self, value, squares, tried):
        self.shape_values, self.squares, self.tried = np.array([value]), squares, tried

    def following(self, _linear):
        return np.array([np.nan])

    def with_shapes(self, values):
        self.tried.append(float(values[0]))
        assert len(self.tried) < 100
        step = abs(values[0] - self.shape_values[0])
        return Ridge(values[0], self.squares - 0.02 if step < 1 else 2e4, self.tried)

    def residual_at(self, _linear):
        return np.array([[np.sqrt(self.squares)]])


def test_a_step_that_has_to_be_a_thousandth_is_none(monkeypatch):
    asked = SimpleNamespace(solve=lambda: np.array([1000.0]), root=(np.eye(1), np.array([30.0])))
    monkeypatch.setattr(refine, "_exact", lambda hypothesis, _weight: hypothesis)
    monkeypatch.setattr(refine, "system", lambda _flights: SimpleNamespace(rotor_wrench=None))
    monkeypatch.setattr(refine, "torque_loss_ratio", lambda _before, _after: 1.0)
    monkeypatch.setattr(refine, "fit_within_bounds", lambda *_: (np.zeros(0), np.zeros(0, dtype=bool)))
    monkeypatch.setattr(refine, "shape_columns", lambda *_: np.ones((1, 1, 1)))
    monkeypatch.setattr(refine, "equations", lambda *_: SimpleNamespace(around=lambda *_: asked))
    start = Ridge(0.0, 1e4, [])
    assert refine.refitted(start, np.ones((1, 1))) is start
    assert start.tried[0] == 1000.0


def test_a_load_whose_mass_goes_as_it_is_fitted_keeps_its_hook(monkeypatch):
    said = iter([[np.nan, np.nan, 0.1]])
    monkeypatch.setattr(System, "following", lambda *_: np.array(next(said, [np.nan] * 3)))
    flight = weak(fly(1, gyro=0.02, rotor=2.0))
    start = system([flight], [candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.0)])
    length, _, depth = refine.refitted(start, np.full(6, 1e-4)).shape_values
    assert depth == 0.1
    assert length != 0.52


def test_columns_are_evaluated_again_only_where_their_shape_or_the_signals_change():
    load = candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.0)
    start = system([weak(fly(1))], [candidate("drag_factor_error", error=0.1), candidate("linear_damping"), load])
    error, length, *others = start.shape_values
    damping, pull = (start.columns(each) for each in start.free[1:])
    longer = start.with_shapes(np.array([error, 1.2 * length, *others]))
    assert longer.columns(longer.free[1]) is damping
    assert not np.array_equal(longer.columns(longer.free[2]), pull)
    for moved in (longer, start.with_shapes(np.array([2 * error, length, *others]))):
        alone = system(moved.flights, moved.chosen)
        assert np.array_equal(moved.base, alone.base)
        assert np.array_equal(moved.residual, alone.residual)
