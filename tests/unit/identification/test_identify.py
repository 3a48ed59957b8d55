"""The whole identification, small."""

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.search import SearchRun
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings, RidgeSettings
from cpfls_cli.regressor.regressor import Motion
from tests.builders.flights import random_flight, rigid_torque

SMALL = {"population": 10, "generations": 2, "local_search": LocalSearchSettings(evaluations=2)}
SEARCHED = {**SMALL, "consequents": "seesaw", "products": "additive", "membership_functions": 3}


def nearly_rigid_flight(samples=100, noise=0.02, seed=22, limit=np.pi):
    return random_flight(rigid_torque(), seed, samples, noise=noise, limit=limit)


def identified(settings, data=None, progress=None, seed=1):
    data = nearly_rigid_flight() if data is None else data
    held_out = {"held out": nearly_rigid_flight(seed=23)}
    return identify(
        data,
        data,
        held_out,
        IdentificationSettings(**settings),
        np.random.default_rng(seed),
        SearchRun(progress=progress or (lambda _: None)),
    )


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_result_hangs_together(base):
    calls = []
    found = identified({**SEARCHED, "base": base}, progress=calls.append)
    assert np.isfinite(found.front.objectives).all()
    assert np.isfinite(found.history.best).all()
    assert np.all(np.diff(found.history.best, axis=0) <= 0)
    assert len(calls) == found.history.evaluations[-1]
    done = [step.generation + step.share for step in calls]
    assert np.all(np.diff(done) > 0)
    assert {step.generations for step in calls} == {2}
    for step in calls:
        if step.generation > 0:
            np.testing.assert_array_equal(step.best, found.history.best[step.generation - 1])
    chosen = found.front.objectives[found.front.chosen]
    assert chosen[0] == pytest.approx(found.fit.mean_squared_error, rel=1e-9)
    training = found.scores["training"]
    assert chosen[1] == pytest.approx(training["model"].max_error.max(), rel=1e-9)
    assert set(found.scores) == {"training", "held out"}
    assert {"model", "rigid-body", "constant-inertia", "torque-zero"} <= set(training)
    assert dict(found.samples) == {"training": 100, "held out": 100}
    error = nearly_rigid_flight().torque - found.model.torque(nearly_rigid_flight().motion)
    np.testing.assert_allclose(training["model"].mse, np.mean(error**2, axis=0), rtol=1e-10)
    assert (found.ridge is None) == (base == "none")


def test_a_structure_without_genes_needs_no_search():
    found = identified({**SMALL, "base": "none", "membership_functions": 1}, nearly_rigid_flight(noise=0.0))
    assert found.front.chromosomes.shape == (1, 0)
    assert found.history.evaluations.tolist() == [1]
    assert found.model.coefficients.shape == (61,)
    assert found.scores["training"]["model"].max_error.max() < 1e-12
    assert 0 <= found.fit.mean_squared_error < 1e-24


def test_rigid_data_leave_the_model_no_worse_than_the_rigid_body():
    found = identified({**SMALL, "base": "rigid-body"}, nearly_rigid_flight(noise=0.05))
    assert found.fit.ridge_weight == np.inf
    held_out = found.scores["held out"]
    np.testing.assert_allclose(held_out["model"].mse, held_out["rigid-body"].mse, rtol=1e-9)
    assert any("switched the fuzzy part off" in finding for finding in found.findings)


def test_model_learned_from_a_selection_is_judged_on_all_of_training():
    data, selected = nearly_rigid_flight(), np.arange(0, 100, 2)
    settings = IdentificationSettings(**{**SMALL, "base": "rigid-body"})
    found = identify(data, data[selected], {}, settings, np.random.default_rng(0))
    assert dict(found.samples) == {"training": 100}
    inertia = np.linalg.norm(found.fit.rigid_body - [0.6, 0.7, 1.2, 0, 0, 0])
    assert inertia < 0.05


def test_objectives_are_judged_on_all_of_training():
    """Few samples are met exactly by 25 coefficients; what the front counts is the error beside them too."""
    data, selected = nearly_rigid_flight(noise=0.05), np.arange(0, 100, 8)
    settings = IdentificationSettings(**{**SEARCHED, "base": "none"})
    found = identify(data, data[selected], {}, settings, np.random.default_rng(0))
    error = data.torque - found.model.torque(data.motion)
    expected = [np.mean(error**2), np.abs(error).max(), found.fit.conditioning]
    np.testing.assert_allclose(found.front.objectives[found.front.chosen], expected, rtol=1e-9)
    assert np.mean(error[selected] ** 2) < 0.5 * np.mean(error**2)


def test_search_that_starts_with_the_uniform_partitions_is_never_worse():
    settings = {**SEARCHED, "base": "none", "choice": "mse", "start": "with-uniform"}
    training = identified(settings).scores["training"]
    assert training["model"].mse.sum() <= training["uniform-partitions"].mse.sum()
    assert "uniform-partitions" not in identified({**SMALL, "membership_functions": 1}).scores["training"]


@pytest.mark.parametrize(("samples", "message"), [(9, "too few for that many blocks"), (12, "cover all samples")])
def test_too_few_samples(samples, message):
    """12 samples of 0.01 s lie wholly within 0.1 s of every block of theirs."""
    with pytest.raises(SettingError, match=message):
        identified(SMALL, nearly_rigid_flight(samples))


def test_ridge_weights_must_ascend():
    with pytest.raises(SettingError) as caught:
        RidgeSettings(smallest=1.0, largest=0.5)
    assert caught.value.key == "largest"


def test_nothing_is_identified_from_a_torque_of_zero():
    # It would be a body without inertia, of which no score, band or verdict makes sense.
    data = nearly_rigid_flight()
    still = TorqueData(data.time, data.motion, np.zeros_like(data.torque))
    for base in ("rigid-body", "none"):
        with pytest.raises(ComputationError, match="the torque is zero at all samples"):
            identified({**SMALL, "base": base}, still)


def test_a_vehicle_that_never_turns_cannot_be_identified():
    zero = np.zeros((40, 3))
    still = TorqueData(0.01 * np.arange(40), Motion(zero, zero, zero), np.ones((40, 3)))
    for settings in ({**SMALL, "base": "rigid-body"}, {**SEARCHED, "base": "none"}):
        with pytest.raises(ComputationError, match="no chromosome gave a finite model"):
            identified(settings, still)


def test_rules_without_excitation_and_rank_are_reported():
    small_angles = nearly_rigid_flight(limit=0.2)
    found = identified({**SEARCHED, "base": "none", "membership_functions": 5}, small_angles)
    assert any(finding.startswith("rank ") for finding in found.findings)
    assert any("rules not excited" in finding and "D22 rule" in finding for finding in found.findings)
