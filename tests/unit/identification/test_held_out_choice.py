"""The choice among the members of a front on a flight that is kept for it."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics.rigid_body import newton_euler_torque
from cpfls_cli.errors import SettingError
from cpfls_cli.identification import IdentificationSettings, TorqueData, identify
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.regressor import Motion

SETTINGS = IdentificationSettings(
    population=10,
    generations=2,
    local_search=LocalSearchSettings(evaluations=2),
    consequents="seesaw",
    products="additive",
    membership_functions=3,
    base="none",
)


def flight(seed, samples=120, noise=0.3):
    rng = np.random.default_rng(seed)
    motion = Motion(rng.uniform(-np.pi, np.pi, (samples, 3)), *rng.standard_normal((2, samples, 3)))
    torque = newton_euler_torque(*vars(motion).values(), np.diag([0.6, 0.7, 1.2]))
    return TorqueData(0.01 * np.arange(samples), motion, torque + noise * rng.standard_normal(torque.shape))


def found(base="none", kept=None, choice="held-out", **parts):
    settings = replace(SETTINGS, base=base, choice=choice)
    training = flight(1)
    return identify(training, training, parts, settings, np.random.default_rng(3), kept=kept)


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_errors_are_those_of_the_members_on_the_kept_flight(base):
    """The chosen member is judged as if its flight had been given to judge, axes scaled as the solver scales them."""
    kept = flight(5)
    result = found(base, kept, judged=kept)
    front = result.front
    assert front.held_out.shape == (len(front.objectives),)
    assert front.held_out[front.chosen] == front.held_out.min()
    error = np.mean(result.scores["judged"]["model"].mse * result.fit.row_scale**2)
    assert front.held_out[front.chosen] == pytest.approx(error, rel=1e-9)


def test_the_choice_differs_between_flights_and_from_that_on_the_training_part():
    """All come from the same search, so that only the flight that is chosen on can make the difference."""
    fronts = [found(kept=flight(seed)).front for seed in range(5, 15)] + [found(choice="mse").front]
    for front in fronts:
        np.testing.assert_array_equal(front.chromosomes, fronts[0].chromosomes)
    assert len({front.chosen for front in fronts}) > 1
    assert fronts[-1].held_out is None


@pytest.mark.parametrize(("choice", "kept"), [("held-out", None), ("mse", flight(5))])
def test_a_choice_that_its_flights_do_not_fit_is_refused_before_the_search(choice, kept):
    with pytest.raises(SettingError) as caught:
        found(choice=choice, kept=kept)
    assert caught.value.key == "choice"


def test_a_structure_without_genes_has_one_member_to_choose():
    training = flight(1)
    settings = replace(SETTINGS, consequents="harmonic", products="tensor", membership_functions=1, choice="held-out")
    result = identify(training, training, {}, settings, np.random.default_rng(3), kept=flight(5))
    assert result.front.held_out.shape == (1,)
