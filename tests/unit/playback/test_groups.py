"""Several configurations of a vehicle: shared numbers, numbers of their own, and what differs."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.playback.evaluation import Group, JointNumbers
from cpfls_cli.playback.fit import fit, uncertainty, windows_of
from cpfls_cli.playback.parameters import FreeNumbers, Rules
from cpfls_cli.playback.vehicle import Difference, differences
from tests.builders.playback_flights import (
    ADDED_AT,
    ADDED_KG,
    KINDS,
    MIDDLING,
    STATED,
    TRUE_BLOCKS,
    flown,
    loaded,
    truth,
)

NO_REMAINDER = Rules(0, 0)
JOINT = JointNumbers(
    FreeNumbers(STATED, TRUE_BLOCKS, NO_REMAINDER), (Group("payload", ("mass", "com_offset", "inertia")),)
)


@pytest.fixture(scope="module")
def flights():
    with_weight = flown(loaded(), KINDS, noise=MIDDLING, seed=51, hold="linear")
    return [
        *flown(truth(), KINDS, noise=MIDDLING, seed=1, hold="linear"),
        *(replace(flight, group="payload") for flight in with_weight),
    ]


@pytest.fixture(scope="module")
def found(flights):
    windows = windows_of(flights, 0.5, 0.6)
    fitted = fit(JOINT, windows, {}, 60, 3e-5)
    return fitted, uncertainty(fitted, windows)


def test_shared_numbers_stand_once_and_own_ones_next_to_them():
    names = [number.name for number in JOINT.numbers]
    assert len(set(names)) == len(names)
    assert names[: len(JOINT.base.numbers)] == [number.name for number in JOINT.base.numbers]
    own = {name.removeprefix("payload: ").split(".")[0] for name in names[len(JOINT.base.numbers) :]}
    assert own == {"mass", "com_offset", "inertia"}


def test_added_mass_and_its_place_are_found(found):
    by_name: dict[str, Difference] = {each.name: each for each in differences(*found)}
    mass = by_name["payload: added mass"]
    assert mass.low < ADDED_KG < mass.high
    assert mass.value == pytest.approx(ADDED_KG, rel=0.06)
    for axis, place in zip("xy", ADDED_AT, strict=True):
        where = by_name[f"payload: place of the added mass, {axis}"]
        assert where.value == pytest.approx(place, abs=0.003)
        assert where.low < place < where.high


def test_model_of_each_configuration_has_its_mass(found):
    fitted, _ = found
    assert fitted.model.vehicle.mass_kg == STATED.mass_kg
    loaded = JOINT.at(fitted.values, "payload").model
    assert loaded.vehicle.mass_kg == pytest.approx(STATED.mass_kg + ADDED_KG, rel=0.003)
    offset = next(each for each in loaded.effects if each.name == "com_offset")
    assert offset.coefficients == pytest.approx(ADDED_KG * ADDED_AT / (STATED.mass_kg + ADDED_KG), rel=0.03)


def test_effects_stay_what_they_are_where_the_inertia_differs():
    """Damping and flapping are torques of the air: a body that gains 2 % does not gain 2 % of them."""
    others = [replace(flight, group="payload") for flight in flown(loaded(), KINDS, seed=51, hold="linear")]
    windows = windows_of([*flown(truth(), KINDS, seed=1, hold="linear"), *others], 0.5, 0.6)
    found = fit(JOINT, windows, {}, 60, 3e-5)
    for group, flew in (("", truth()), ("payload", loaded())):
        model = JOINT.at(found.values, group).model
        assert model.vehicle.inertia_kg_m2[:3] == pytest.approx(flew.vehicle.inertia_kg_m2, rel=0.001)
        known = {effect.name: effect.coefficients for effect in flew.effects}
        for effect in model.effects:
            assert effect.coefficients == pytest.approx(known[effect.name], rel=0.002)


@pytest.mark.parametrize("blocks", [TRUE_BLOCKS, TRUE_BLOCKS[1:]], ids=["inertia of all", "of the group alone"])
def test_gradient_by_a_number_of_a_group_is_that_of_its_flights(flights, blocks):
    """Against difference quotients, for all numbers, shared ones and those of the group."""
    from cpfls_cli.playback.fit import WindowSet, WindowSums

    windows = windows_of([flights[0], flights[-1]], 0.2, 2.0)
    free = replace(JOINT, base=FreeNumbers(STATED, blocks, NO_REMAINDER))
    windows, values = WindowSet(tuple(windows)), free.starts + 0.1 * free.scales
    both = np.ones(2, dtype=bool)
    gradient = WindowSums(free, windows, values).mean(both).gradient
    for place, scale in enumerate(free.scales):
        step = np.zeros(len(values))
        step[place] = 1e-6 * scale
        ahead, behind = (WindowSums(free, windows, values + sign * step).mean(both).objective for sign in (1, -1))
        assert gradient[place] == pytest.approx((ahead - behind) / 2e-6, rel=2e-4, abs=2e-7)
