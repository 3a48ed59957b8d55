"""Balances of torque and force: their slopes are difference quotients, and their residual is that of the vehicle."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.balances import Balances, PastBalances
from cpfls_cli.playback.evaluation import VehicleAt
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.parameters import LEARNED, FreeNumbers, Rules, blocks_of
from tests.builders.playback_flights import STATED, flown, truth

FREE = FreeNumbers(STATED, blocks_of(STATED), Rules(1, 0))
NAMED = replace(FREE, chosen=tuple(block for block in FREE.chosen if block not in LEARNED))


@pytest.fixture(scope="module")
def flights():
    """Two runs of a path with other noise, and a flight that was asked where to be."""
    run, other = flown(truth(), ("multisine", "steps"), duration_s=12.0, seed=5)
    rng = np.random.default_rng(0)
    again = replace(run, speed=run.speed + rng.normal(0.0, 3.0, run.speed.shape))
    asked = {"position": other.motion.position + 0.1 * rng.standard_normal((len(other), 3))}
    return [run, again, replace(other, setpoints=asked, stretches=(slice(0, 500), slice(500, len(other))))]


def somewhere(seed=0, free=FREE):
    """Numbers near the stated ones, none of them where its derivative could vanish."""
    start, scale, low, high = np.array([(each.start, each.scale, each.low, each.high) for each in free.numbers]).T
    return np.clip(start + 0.05 * scale * np.random.default_rng(seed).standard_normal(len(start)), low, high)


def balances_of(flights, kind=Balances):
    given = instruments(flights)
    return kind(given.flown, given)


def squares(sums):
    """The residual's own products, ZtX, XtX and ZtZ, shape (3, block, band, axis)."""
    return np.stack([own[..., 0, 0] for own in sums[:3]])


def test_slopes_are_difference_quotients_for_every_number(flights):
    balances, values, step = balances_of(flights), somewhere(free=NAMED), 1e-4
    here = balances.sums(NAMED, values)
    for place, number in enumerate(NAMED.numbers):
        moved = step * number.scale * np.eye(len(values))[place]
        ahead, behind = (squares(balances.sums(NAMED, each)) for each in (values + moved, values - moved))
        # A product's slope has that of either factor.
        slopes = np.stack([own[..., 0, 1 + place] + own[..., 1 + place, 0] for own in here[:3]])
        own = np.stack([each[..., 1 + place, 1 + place] for each in here[:3]])
        # Some averages over a band are rounding: that of what stays the same.
        size = np.sqrt(np.abs(squares(here) * own)).max(axis=(1, 3), keepdims=True) + 1e-9 * np.abs(squares(here)).max()
        off = np.abs((ahead - behind) / (2 * step) - slopes)
        assert (off <= 1e-5 * size).all(), number.name


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_what_follows_from_an_evaluation_is_what_another_gives(flights, kind):
    """Of other numbers, and of fewer: a vehicle is evaluated again only where its rotors respond otherwise."""
    balances = balances_of(flights, kind)
    balances.sums(FREE, somewhere(1))
    fewer = replace(FREE, chosen=("inertia", "drag_factor", "rotor_mismatch", "linear_damping"))
    values = somewhere(2)
    for name, place in FREE.index.items():
        if name.split(".")[0] in ("lag", "delay", "slow_actuation"):
            values[place] = somewhere(1)[place]
    for free, own in ((FREE, values), (fewer, np.array([values[FREE.index[name]] for name in fewer.index]))):
        found, fresh = balances.sums(free, own), balances_of(flights, kind).sums(free, own)
        for one, other in zip(found, fresh, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_a_stretch_shorter_than_a_window_adds_nothing(flights, kind):
    *others, last = flights
    long = slice(0, 500), slice(520, len(last))
    without, added = (replace(last, stretches=each) for each in (long, (long[0], slice(505, 515), long[1])))
    of_each = (balances_of([*others, each], kind).sums(NAMED, somewhere(free=NAMED)) for each in (without, added))
    for one, other in zip(*of_each, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_flights_of_which_one_has_no_velocity_are_balanced_in_rotation(flights, kind):
    none = [replace(each, has_velocity=False) for each in flights]
    mixed = (balances_of(each, kind) for each in ([none[0], *flights[1:]], none))
    for one, other in zip(*(each.sums(NAMED, somewhere(free=NAMED)) for each in mixed), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


def test_the_residual_is_what_the_model_leaves_of_the_motion(flights):
    """By the model of the numbers, flight by flight and window by window."""
    balances, values = balances_of(flights[2:]), somewhere(3)
    sums = balances.sums(FREE, values)
    at, (flight,) = VehicleAt(FREE, values), balances.flights
    motion, model, stretches = flight.motion, at.model, flight.stretches
    terms = np.concatenate(
        [model.response.terms_at_samples(flight.speed[part], motion.period, flight.hold) for part in stretches]
    )
    air = np.einsum("tji,tj->ti", motion.rotation, motion.velocity)
    wrench = model.wrench(air, motion.rate, terms)
    momentum = motion.rate @ at.inertia
    torque = np.cross(motion.rate, momentum) - wrench[:, :3]
    force = np.array([0.0, 0.0, STATED.gravity_m_s2 * STATED.mass_kg]) - np.einsum(
        "tij,tj->ti", motion.rotation, wrench[:, 3:]
    )
    bands = len(balances.bands_hz)
    for number, band in enumerate(balances.bands):
        changing, acting = (momentum, torque) if number < bands else (STATED.mass_kg * motion.velocity, force)
        residual = band.balance(acting, changing, stretches)
        assert sums.xtx[:, number, :, 0, 0].sum(axis=0) == pytest.approx((residual**2).sum(axis=0), rel=1e-9)


def test_effects_of_motion_and_rotors_are_the_blocks_that_are_tried():
    of_air = {"inflow", "parasitic_drag", "rotor_drag", "translational_lift"}
    of_motion = {"flapping_moment", "linear_damping", "quadratic_damping", "rolling_moment", "rotor_plane_damping"}
    of_rotors = {"rotor_acceleration", "rotor_gyroscopic", "rotor_mismatch", "com_offset", "torque_bias"}
    assert set(blocks_of(STATED)) & set(CATALOGUE) == of_air | of_motion | of_rotors
