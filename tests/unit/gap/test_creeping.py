"""A fit whose linear system holds for no step stands where it is, instead of creeping along."""

from types import SimpleNamespace

import numpy as np

from cpfls_cli.gap.balance import refine


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


class Silent(Ridge):
    """Coefficients that say where a second shape is at first, and nothing of it afterwards, as a load of no mass."""

    shapes = 2 * Ridge.shapes

    def __init__(self, values, squares, tried, said=0.1):
        super().__init__(0.0, squares, tried)
        self.shape_values, self.said = np.array(values), said

    def following(self, _linear):
        said, self.said = self.said, np.nan
        return np.array([np.nan, said])

    def with_shapes(self, values):
        self.tried.append(values.tolist())
        return Silent(values, self.squares - 1.0 if len(self.tried) == 2 else self.squares, self.tried, np.nan)


def settle(start, monkeypatch, shapes=1):
    asked = SimpleNamespace(solve=lambda: np.array([1000.0]), root=(np.eye(1), np.array([30.0])))
    monkeypatch.setattr(refine, "_exact", lambda hypothesis, _weight: hypothesis)
    monkeypatch.setattr(refine, "system", lambda _flights: SimpleNamespace(rotor_wrench=None))
    monkeypatch.setattr(refine, "torque_loss_ratio", lambda _before, _after: 1.0)
    monkeypatch.setattr(refine, "fit_within_bounds", lambda *_: (np.zeros(0), np.zeros(0, dtype=bool)))
    monkeypatch.setattr(refine, "shape_columns", lambda *_: np.ones((1, 1, shapes)))
    monkeypatch.setattr(refine, "equations", lambda *_: SimpleNamespace(around=lambda *_: asked))
    return refine.refitted(start, np.ones((1, 1)))


def test_a_step_that_has_to_be_a_thousandth_is_none(monkeypatch):
    start = Ridge(0.0, 1e4, [])
    assert settle(start, monkeypatch) is start
    assert start.tried[0] == 1000.0


def test_a_shape_that_coefficients_say_nothing_of_any_more_stays(monkeypatch):
    tried = []
    settle(Silent([0.0, 0.0], 1e4, tried), monkeypatch, shapes=2)
    assert tried[0] == [0.0, 0.1]
    assert len(tried) > 2
    assert all(second == 0.1 for _, second in tried)
