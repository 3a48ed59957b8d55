"""Verdicts on vehicles whose nature is known, and on evidence that is changed by hand."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.validation.bands import physical_sense
from cpfls_cli.validation.evidence import Comparison, Evidence, compare_torque
from cpfls_cli.validation.replay import replay_steps
from cpfls_cli.validation.residuals import examine_residuals
from cpfls_cli.validation.verdict import good_axes, verdict
from tests.builders.flights import bent_torque, rigid_torque, rotating_motion

INERTIA = symmetric([0.6, 0.8, 1.2])
rigid, bent = rigid_torque(INERTIA), bent_torque(INERTIA, 0.3)
UNSEARCHED = {"population": 2, "generations": 0, "local_search": LocalSearchSettings(enabled=False)}
PAPER = {"consequents": "seesaw", "products": "additive", "membership_functions": 5, "base": "none"}


def mirrored(m):
    return rigid(m) * [1, -1, 1]


def rotating_flight(torque_of, noise, seed):
    time, m = rotating_motion(seed, samples=1200, duration=24.0)
    torque = torque_of(m)
    drawn = np.random.default_rng(seed + 1).standard_normal(torque.shape)
    return TorqueData(time, m, torque + noise * torque.std(axis=0) * drawn)


@cache
def evidence(torque_of, noise=0.0, structure=(), *, held_out=True, seeds=(3, 53)):
    """All evidence on a model of a flight, judged on another."""
    training, other = (rotating_flight(torque_of, noise, seed) for seed in seeds)
    parts = {"other": other} if held_out else {}
    settings = IdentificationSettings(**dict(structure), **UNSEARCHED)
    found = identify(training, training, parts, settings, np.random.default_rng(1))
    part, data = ("other", other) if held_out else ("training", training)
    rigid_body = found.baselines[0]
    steps = replay_steps(part, data, {"model": found.model, "rigid-body": rigid_body.parameters}, 10, 100)
    return Evidence(
        identification=found,
        torque={name: compare_torque(own, found.model.torque, rigid_body.torque) for name, own in parts.items()},
        steps=steps,
        replayed={part: steps},
        residuals=examine_residuals(part, data, found.model.torque, 20),
        physics=physical_sense(found.model),
        r2_min=0.8,
    )


def said(judged, words):
    """Give what the reason with these words speaks for."""
    own = [speaks for text, speaks in judged.reasons if words in text]
    assert len(own) == 1, (words, judged.reasons)
    return own[0]


def with_r2(evidence, model, rigid_body):
    """The same evidence with other held-out R2 of body torque."""
    found = evidence.identification
    other = dict(found.scores["other"])
    for name, r2 in (("model", model), ("rigid-body", rigid_body)):
        other[name] = replace(other[name], r2_body=np.array(r2, dtype=float))
    return replace(evidence, identification=replace(found, scores={**found.scores, "other": other}))


def with_still_yaw(evidence):
    found = evidence.identification
    axes = replace(found.axes, acceleration=np.array([3.0, 3.0, 0.5]))
    return replace(evidence, identification=replace(found, axes=axes))


@pytest.fixture(scope="module")
def better():
    """A model that wins over the rigid body."""
    return evidence(bent, 0.05)


@pytest.mark.parametrize("structure", [(("base", "none"),), ()], ids=["base none", "default"])
def test_of_an_exact_rigid_vehicle_the_rigid_body_is_the_model(structure):
    judged = verdict(evidence(rigid, 0.0, structure))
    assert judged.label == "not-better-than-rigid-body"
    assert said(judged, "it is itself good for control") == 0
    assert said(judged, "squared error of held-out torque: the same") == -1
    assert said(judged, "matched to rounding") == 1


def test_noisy_rotations_of_a_rigid_vehicle_switch_the_fuzzy_part_off():
    judged = verdict(evidence(rigid, 0.05))
    assert judged.label == "not-better-than-rigid-body"
    assert said(judged, "switched the fuzzy part off") == -1
    assert said(judged, "white noise") == 1


def test_the_paper_s_coefficients_on_noisy_rotations_are_no_body():
    judged = verdict(evidence(rigid, 0.05, tuple(PAPER.items())))
    assert judged.label == "do-not-use"
    assert "D(q) is not positive definite" in judged.reasons[0][0]
    assert "the rigid body is good for control" in judged.reasons[0][0]


def test_inertia_that_depends_on_attitude_is_worth_a_model(better):
    judged = verdict(better)
    assert (judged.label, judged.region) == ("good-for-control", "every roll and pitch")
    assert said(judged, "squared error of held-out torque") == 1
    assert said(judged, "squared error of the replayed body rate") == 1
    assert said(judged, "is positive definite in all") == 1
    assert {speaks for _, speaks in judged.reasons} <= {-1, 0, 1}


def test_without_held_out_data_no_model_is_good():
    judged = verdict(evidence(bent, 0.05, held_out=False))
    assert judged.label == "not-better-than-rigid-body"
    assert "nothing was held out" in judged.reasons[0][0]
    assert said(judged, "only on its own training data") == -1
    assert said(judged, "replayed body rate (training)") == 0


def test_signs_that_are_wrong_give_no_body():
    judged = verdict(evidence(mirrored, 0.05))
    assert (judged.label, judged.reasons[0][1]) == ("do-not-use", -1)


def test_more_rules_are_good_inside_the_region_alone(better):
    """The same numbers with coefficients that the flight leaves open."""
    excitation = better.identification.excitation
    open_ones = replace(excitation, determined=0.7 * excitation.determined)
    judged = verdict(replace(better, identification=replace(better.identification, excitation=open_ones)))
    assert judged.label == "good-inside-region"
    assert judged.region.startswith("roll ")
    assert said(judged, "70 % of what the rules could express") == -1


@pytest.mark.parametrize(("r2", "label"), [(0.81, "good-for-control"), (0.79, "do-not-use")])
def test_r2_asked_for(better, r2, label):
    judged = verdict(with_r2(better, [0.9, r2, 0.9], [0.5, 0.5, 0.5]))
    assert judged.label == label
    assert (said(judged, "R2 of body torque, held out") == 1) == (label == "good-for-control")


def with_replayed(evidence, **changes):
    return replace(evidence, replayed={"other": replace(evidence.replayed["other"], **changes)})


def with_yaw_rate(evidence, share):
    """The same evidence with errors of the model's yaw rate that are a share of those if nothing moved."""
    errors = evidence.replayed["other"].window_error.copy()
    errors[0, :, 2] = share * errors[2, :, 2]
    return with_replayed(evidence, window_error=errors)


def test_an_axis_that_hardly_moves_is_judged_by_its_rate_replayed(better):
    judged = verdict(with_yaw_rate(with_still_yaw(with_r2(better, [0.9, 0.9, -5.0], [0.5, 0.5, 0.1])), 1e-3))
    assert judged.label == "good-inside-region"
    assert "nothing confirms it about yaw" in judged.reasons[0][0]
    assert "-5" not in judged.reasons[0][0]
    assert said(judged, "yaw barely moves") == 0


@pytest.mark.parametrize("share", [1.0, 1.2, np.nan])
def test_a_rate_that_is_no_better_than_nothing_moves_refuses_an_axis(better, share):
    worse = with_yaw_rate(with_still_yaw(with_r2(better, [0.9, 0.9, 0.1], [0.5, 0.5, 0.1])), share)
    assert verdict(worse).label != "good-for-control"
    assert verdict(worse).label != "good-inside-region"
    assert said(verdict(worse), "yaw barely moves") == -1
    np.testing.assert_array_equal(good_axes(worse, "model"), [True, True, False])


def compared(*, lower=False, higher=False):
    return Comparison(1.0, 1.0, 0.9 if lower else 1.1, lower, higher, 20)


@pytest.mark.parametrize(
    ("torque", "steps", "label"),
    [
        (compared(lower=True), "lower", "good-for-control"),
        (compared(lower=True), "same", "good-for-control"),
        (compared(), "lower", "good-for-control"),
        (compared(), "same", "not-better-than-rigid-body"),
        (compared(lower=True), "higher", "not-better-than-rigid-body"),
        (compared(higher=True), "lower", "not-better-than-rigid-body"),
    ],
)
def test_better_is_lower_beyond_chance_in_one_and_higher_in_none(better, torque, steps, label):
    errors = better.steps.window_error.copy()
    errors[0] = {"lower": 0.5, "same": 1.0, "higher": 2.0}[steps] * errors[1]
    assert verdict(with_replayed(replace(better, torque={"other": torque}), window_error=errors)).label == label


def not_better(evidence):
    return replace(evidence, torque={"other": compared(higher=True)})


def test_a_rigid_body_that_is_not_good_either_is_not_recommended(better):
    evidence = not_better(with_r2(better, [0.7, 0.9, 0.9], [0.7, 0.9, 0.9]))
    judged = verdict(evidence)
    assert judged.label == "not-better-than-rigid-body"
    assert "and neither is good enough for control about roll" in judged.reasons[0][0]
    alone = verdict(not_better(with_r2(better, [0.9, 0.9, 0.9], [0.7, 0.9, 0.9])))
    assert "the latter is not good enough for control about roll" in alone.reasons[0][0]
    assert not any("use the rigid body" in text for one in (judged, alone) for text, _ in one.reasons)
    useless = verdict(with_r2(evidence, [-0.1, 0.9, 0.9], [-0.1, 0.9, 0.9]))
    assert useless.label == "do-not-use"
    assert "than a constant does" in useless.reasons[0][0]


def test_a_rigid_body_that_is_none_is_not_recommended(better):
    unphysical = replace(better.identification, rigid_body=np.array([0.6, -0.1, 1.2, 0.0, 0.0, 0.0]))
    judged = verdict(not_better(replace(better, identification=unphysical)))
    assert judged.label == "do-not-use"
    assert "use the rigid body" not in judged.reasons[0][0]
    assert "is not positive definite" in judged.reasons[0][0]


def with_lost(evidence, windows):
    """The model loses the first windows; in the others it errs half as much as the rigid body."""
    steps = evidence.replayed["other"]
    errors, lost = steps.window_error.copy(), steps.lost.copy()
    errors[0], lost[0] = 0.5 * errors[1], windows
    errors[0, :windows] = np.nan
    return with_replayed(evidence, window_error=errors, lost=lost)


@pytest.mark.parametrize(
    ("lost", "torque", "label"),
    [
        (90, compared(), "not-better-than-rigid-body"),
        (90, compared(lower=True), "not-better-than-rigid-body"),
        (100, compared(), "not-better-than-rigid-body"),
        (6, compared(lower=True), "do-not-use"),
    ],
)
def test_windows_that_the_model_loses_count_against_it(better, lost, torque, label):
    judged = verdict(with_lost(replace(better, torque={"other": torque}), lost))
    assert judged.label == label
    assert said(judged, f"{lost} of 100 replayed windows do not run to the end: ") == -1


def test_windows_that_both_lose_prove_nothing(better):
    errors = np.full_like(better.steps.window_error, np.nan)
    lost = np.full_like(better.steps.lost, 100)
    gone = with_replayed(replace(better, torque={"other": compared()}), window_error=errors, lost=lost)
    assert verdict(gone).label == "not-better-than-rigid-body"
    assert verdict(replace(gone, torque={"other": compared(lower=True)})).label == "do-not-use"


def test_a_rule_of_all_attitudes_has_to_be_a_body_at_all_of_them(better):
    """Training went all round in roll and in pitch and yet left most attitudes out."""
    judged = verdict(replace(better, physics=replace(better.physics, indefinite_anywhere=2000)))
    assert judged.label == "good-inside-region"
    assert judged.region != "every roll and pitch"
    assert said(judged, "not positive definite in 2000 of 4896 cells of roll and pitch") == -1


@pytest.mark.parametrize(("definite", "label"), [(0.98, "good-for-control"), (0.97, "do-not-use")])
def test_most_draws_have_to_be_a_body_wherever_training_was(better, definite, label):
    judged = verdict(replace(better, definite=definite))
    assert judged.label == label
    speaks = 1 if definite > 0.975 else -1
    assert said(judged, "D(q) is positive definite in all cells away from vertical pitch") == speaks
    if label == "do-not-use":
        assert "only 97 % of the bootstrap draws" in judged.reasons[0][0]


def test_one_cell_without_a_body_is_enough_to_refuse(better):
    physics = replace(better.physics, indefinite=1, worst_attitude=np.radians([30.0, -10.0]))
    judged = verdict(replace(better, physics=physics))
    assert judged.label == "do-not-use"
    assert "worst at roll and pitch of 30 and -10 degrees" in judged.reasons[0][0]


def test_what_does_not_decide_is_said(better):
    stopped = replace(better.identification, stop_reason="time-limit")
    lost = better.steps.lost + np.array([[3], [0], [0]])
    evidence = replace(with_replayed(better, lost=lost), identification=stopped, band=np.array([0.2, 1.4, 0.3]))
    judged = verdict(evidence)
    assert judged.label == "good-for-control"
    assert said(judged, "the search stopped before its end (time-limit") == -1
    assert said(judged, "widest 95 % band of a moment of inertia is 140 %") == -1
    assert said(judged, "3 of 100 replayed windows do not run to the end") == -1
    assert said(verdict(replace(better, band=np.array([0.2, 0.4, 0.3]))), "widest 95 % band") == 1


@pytest.mark.parametrize(("freed", "widest"), [(True, "20 %"), (False, "0.5 %")])
def test_the_band_of_a_moment_is_no_narrower_than_instruments_know_it(better, freed, widest):
    known = SimpleNamespace(half=np.array([0.1, 0.05, np.inf]), identified=np.array([True, True, False]))
    found = replace(better.identification, freed=known if freed else None)
    judged = verdict(replace(better, band=np.full(3, 0.005), identification=found))
    assert said(judged, f"widest 95 % band of a moment of inertia is {widest}") == 1


def test_coloured_errors_are_said_and_speak_neither_way(better):
    residuals = replace(better.residuals, ljung_box=np.array([0.5, 1e-9, 0.4]))
    assert said(verdict(replace(better, residuals=residuals)), "torque errors about pitch are not white") == 0


def test_a_constant_torque_is_named_and_no_longer_called_white_noise(better):
    chance = {"ljung_box": np.array([0.5, 0.3, 0.4]), "mean_p": np.array([0.5, 1e-20, 0.2])}
    residuals = replace(better.residuals, mean=np.array([1e-4, -0.125, 0.0]), **chance)
    judged = verdict(replace(better, residuals=residuals))
    assert said(judged, "a constant torque remains: -0.125 N m about pitch (other, p below 1e-16)") == 0
    assert not any("white" in reason for reason, _ in judged.reasons)
    unbiased = replace(residuals, mean_p=np.full(3, 0.3))
    assert said(verdict(replace(better, residuals=unbiased)), "white noise, as far as") == 1
    coloured = replace(residuals, ljung_box=np.array([1e-9, 0.5, 0.5]))
    assert said(verdict(replace(better, residuals=coloured)), "about roll are not white") == 0
