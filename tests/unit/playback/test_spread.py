"""Vehicles drawn from estimates: how far they lie apart, what goes together, and what no vehicle has."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.evaluation import ParameterPoint
from cpfls_cli.playback.model import ModelEffect, commanded_anew
from cpfls_cli.playback.parameters import FoundNumber, FreeNumbers
from cpfls_cli.playback.spread import POSITIVE, drawn, model_at
from tests.builders.playback_flights import STATED, pushed, truth
from tests.builders.spread_vehicles import found_record, inertia_and_mass
from tests.builders.vehicle_models import thrust_curve, wrench_somewhere

COUNT = 400


def flat(model):
    """Make the body one that is far from a flat plate, of which no draw is impossible."""
    moments = np.array(model.vehicle.inertia_kg_m2) * [1.0, 1.0, 0.7]
    return replace(model, vehicle=replace(model.vehicle, inertia_kg_m2=tuple(moments.tolist())))


def spread_of(record, count=COUNT, seed=1):
    return drawn(record.model, record, count, np.random.default_rng(seed))


def test_numbers_lie_in_their_intervals_as_often_as_they_should_and_go_together():
    spread = spread_of(found_record(flat(truth())), 2000)
    assert not spread.rejected
    assert spread.tried == 2000
    values = dict(zip(spread.names, spread.values.T, strict=True))
    known = {number.name: number for number in found_record(flat(truth())).numbers}
    for name, own in values.items():
        assert 0.93 < np.mean((known[name].low <= own) & (own <= known[name].high)) < 0.97
    assert np.corrcoef(np.log(values["inertia.Izz"]), np.log(values["drag_factor"]))[0, 1] == pytest.approx(
        0.9, abs=0.03
    )
    assert np.corrcoef(values["inertia.Izz"], values["thrust_factor"])[0, 1] == pytest.approx(0.0, abs=0.08)


def test_models_have_the_numbers_that_were_drawn():
    model = replace(pushed(), effects=(*pushed().effects, thrust_curve(0.1)))
    spread = spread_of(found_record(model), 3)
    for row, own in zip(spread.values, spread.models, strict=True):
        values = dict(zip(spread.names, row.tolist(), strict=True))
        assert own.vehicle.inertia_kg_m2[:3] == (values["inertia.Ixx"], values["inertia.Iyy"], values["inertia.Izz"])
        assert own.vehicle.rotors[0].thrust_factor_n_s2 == pytest.approx(values["thrust_factor"])
        assert own.vehicle.rotors[3].drag_factor_n_m_s2 == pytest.approx(values["drag_factor"])
        assert own.response.lag_s == values["lag.time_constant_s"]
        assert own.effects[0].coefficients[0] == values["linear_damping.d_x"]
        assert own.thrust_curve[0].coefficients[0] == values["thrust_slope.linear"]


def test_vehicles_for_new_commands_are_as_much_later_as_the_one_that_they_are_drawn_about():
    """Half of the 20 ms for which a log holds a command, which is in the model and in no number."""
    model = truth()
    model = replace(model, commanded=True, held_s=0.02, response=replace(model.response, delay_s=0.012))
    record, anew = found_record(model), commanded_anew(model)
    fitted, drawn_anew = (drawn(each, record, 50, np.random.default_rng(1)).models for each in (model, anew))
    for one, other in zip(fitted, drawn_anew, strict=True):
        assert other.response.delay_s == pytest.approx(one.response.delay_s + 0.01)


def test_the_model_of_a_fit_is_made_again_from_what_people_know_of_its_numbers():
    blocks = ("inertia", "thrust_factor", "drag_factor", "thrust_slope", "lag", "slow_actuation", "linear_damping")
    free = FreeNumbers(STATED, blocks)
    steps = np.random.default_rng(0).uniform(0.05, 0.2, (2, len(free.numbers)))
    scales = np.array([number.scale for number in free.numbers])
    starts = np.array([number.start for number in free.numbers])
    first, second = (ParameterPoint(free, starts + step * scales) for step in steps)
    numbers = [
        FoundNumber(name, each.unit, each.value, each.value, each.value, np.nan, True, False)
        for name, each in first.physical.items()
    ]
    made = model_at(first.model, numbers, np.array([each.value for each in second.physical.values()]))
    given, wanted = wrench_somewhere(made), wrench_somewhere(second.model)
    assert np.abs(given - wanted).max() < 1e-12 * np.abs(wanted).max()
    assert np.allclose(made.body.inertia, second.model.body.inertia, rtol=1e-12)
    assert made.response == second.model.response
    positive = {name for name, each in first.physical.items() if each.positive}
    assert positive == {name for name in first.physical if name in POSITIVE}


def test_only_bodies_that_can_be_are_drawn_and_others_are_counted():
    spread = spread_of(found_record())
    assert spread.tried == COUNT + sum(spread.rejected.values())
    (reason,) = spread.rejected
    assert reason == "a principal moment of inertia above the sum of the others"
    for own in spread.models:
        smallest, middle, largest = np.linalg.eigvalsh(symmetric(own.vehicle.inertia_kg_m2))
        assert smallest > 0
        assert largest <= (smallest + middle) * (1 + 1e-9)


def test_a_flat_body_that_is_off_by_noise_is_drawn_around_the_nearest_body():
    moments = np.array([0.005, 0.0037, 0.00895])
    model = replace(truth(), vehicle=replace(truth().vehicle, inertia_kg_m2=tuple(moments.tolist())))
    spread = spread_of(found_record(model, relative=0.02))
    centre = dict(zip(spread.names, spread.centre.tolist(), strict=True))
    third = (0.00895 - 0.0087) / 3
    near = [centre[f"inertia.{name}"] for name in ("Ixx", "Iyy", "Izz")]
    assert near == pytest.approx((moments + third * np.array([1, 1, -1])).tolist())
    assert spread.tried < 3 * COUNT
    assert centre["drag_factor"] == model.vehicle.rotors[0].drag_factor_n_m_s2


def test_an_estimate_that_is_no_vehicle_is_refused():
    moments = np.array(truth().vehicle.inertia_kg_m2) * [1.0, 1.0, 3.0]
    model = replace(truth(), vehicle=replace(truth().vehicle, inertia_kg_m2=tuple(moments.tolist())))
    why = r"of 1000 vehicles drawn only 0 are possible; of 1000 no vehicle has a princ.* state what the flights do not"
    with pytest.raises(ComputationError, match=why):
        spread_of(found_record(model))


def test_what_leaves_few_draws_or_no_interval_is_said():
    # Of two draws both are often impossible here, which says nothing against the estimate.
    for seed in range(8):
        assert len(spread_of(found_record(loop=([0.5, 0.5, 0.3], [2, 2, 4]), relative=0.3), 2, seed).models) == 2
    with pytest.raises(InputError, match="too short to show how sure its numbers are"):
        spread_of(found_record(blocks=1))
    far = ModelEffect("com_offset", {}, np.array([0.4, 0.0]))
    with pytest.raises(ComputationError, match="no vehicle has such a com_offset"):
        spread_of(found_record(replace(flat(truth()), effects=(far,))))


def test_what_the_loop_leaves_open_is_between_its_bounds():
    bounds = np.array([[0.9, 1.0, 0.8], [1.0, 1.25, 1.0]])
    record = found_record(flat(truth()), loop=bounds, relative=0.4)
    numbers = (each._replace(low=each.value * 0.8, high=each.value * 1.25) for each in record.numbers)
    narrow = replace(record, numbers=tuple(numbers))
    spread = spread_of(narrow)
    begun = {number.name: number.value for number in narrow.numbers}
    shares = {name: own / begun[name] for name, own in zip(spread.names, spread.values.T, strict=True)}
    # Yaw torque and inertia are known by their ratio: what the loop did is in the moment of inertia alone.
    assert np.median(shares["drag_factor"]) == pytest.approx(1.0, abs=0.02)
    assert np.median(shares["inertia.Izz"]) < 0.99
    assert np.median(shares["inertia.Iyy"]) > 1.05
    assert np.median(shares["inertia.Ixx"]) < 0.99


def test_gusts_are_drawn_as_accelerations():
    record = found_record(flat(truth()))
    spread = spread_of(record)
    nominal = record.model
    bodies = np.array([inertia_and_mass(own.vehicle) for own in spread.models])
    shares = np.array([own.gusts.size for own in spread.models]) / nominal.gusts.size
    accelerations = shares * inertia_and_mass(nominal.vehicle) / bodies
    assert np.mean((accelerations >= 0.8) & (accelerations <= 1.3)) == pytest.approx(0.95, abs=0.02)
    assert np.corrcoef(shares[:, 0], bodies[:, 0])[0, 1] > 0.1
    memories = np.array([own.gusts.memory for own in spread.models]) / nominal.gusts.memory
    assert np.mean((memories >= 0.7) & (memories <= 1.4)) == pytest.approx(0.95, abs=0.02)


def test_what_the_model_lacks_goes_with_the_vehicles_and_the_white_part_with_their_bodies():
    record = found_record(flat(truth()), lack=[0.3, 0.2])
    spread = spread_of(record, 3)
    assert spread.lack.part == ("rotors", "linear_damping")
    assert spread.lack.share[:3].tolist() == [[0.3, 0.2]] * 3
    assert np.isnan(spread.lack.rest[3:]).all()
    first = spread.models[0]
    bodies = inertia_and_mass(first.vehicle) / inertia_and_mass(record.model.vehicle)
    assert first.gusts.white == pytest.approx(record.disturbance.white * bodies)
    assert spread_of(found_record(), 3).lack is None


def test_a_part_that_is_not_in_the_model_stays_out_of_it():
    model = replace(flat(truth()), effects=(ModelEffect("linear_damping", {}, np.array([0.01, 0.0, 0.01])),))
    spread = spread_of(found_record(model), 3)
    assert "linear_damping.d_y" not in spread.names
    assert all(own.effects[0].coefficients[1] == 0.0 for own in spread.models)


def test_draws_are_the_same_with_the_same_seed():
    first, second = (spread_of(found_record(), 5, seed=3) for _ in range(2))
    assert np.array_equal(first.values, second.values)
    assert not np.array_equal(first.values, spread_of(found_record(), 5, seed=4).values)
