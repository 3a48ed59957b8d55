"""What of a gap comes again, against torques that are written down here: one of the path, and one of each run."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.signals import RecordedFlight, Signals
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.extended import plain
from cpfls_cli.gap.residual.repeated import RepeatedRuns
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.balances import band_windows
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import common_windows

VEHICLE = VehicleSettings()
INERTIA = np.array([0.6, 0.6, 1.2])
SIZE, OWN, NOISE = 0.3, 0.2, 0.002
TIME = np.arange(0.0, 40.0, 0.01)


def sines(seed, size, band_hz=(0.1, 1.2)):
    """Sums of sines about each axis and their derivatives, shape (time, 3) each."""
    rng = np.random.default_rng(seed)
    turns, phase = 2 * np.pi * rng.uniform(*band_hz, (6, 3)), rng.uniform(0, 6, (6, 3))
    angle = turns * TIME[:, None, None] + phase
    return size * np.sin(angle).sum(axis=1), size * (turns * np.cos(angle)).sum(axis=1)


def missing(path):
    """What the model lacks: of the path, about roll alone, shape (time, 3)."""
    return sines(100 + path, SIZE)[0] * [1.0, 0.0, 0.0]


def run(path, draw, lacks=1.0):
    """Rates of a path with noise; the stated torque lacks what comes again, and what is this run's own."""
    rate, slope = sines(path, 0.3)
    torque = INERTIA * slope + np.cross(rate, INERTIA * rate)
    own = sines(1000 + 10 * path + draw, OWN)[0]
    noisy = rate + np.random.default_rng([path, draw]).normal(0, NOISE, rate.shape)
    stated = torque - lacks * missing(path) - own
    signals = Signals(time=TIME, body_rate=noisy, vehicle=VEHICLE, stated_torque=stated)
    return replace(signals, name=f"path {path}, run {draw}")


def split(recordings, unseen=0):
    windows = common_windows(recordings, GapSettings())
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    model = plain(None)
    repeated = RepeatedRuns.of(recordings, unseen)
    return repeated and repeated.split(model.system(flights), model.linear)


@pytest.fixture(scope="module")
def of_two_paths():
    return split([run(path, draw) for path in (0, 1) for draw in range(3)])


def test_what_the_path_brings_is_repeatable_and_the_rest_is_not(of_two_paths):
    """Six sines of 0.3 N m are 0.27 (N m)^2, six of 0.2 are 0.12; about pitch and yaw nothing comes again."""
    found = of_two_paths
    assert (found.runs, found.paths, len(found.flights)) == (6, 2, 6)
    roll, others = found.repeatable[0, 0], found.repeatable[1:3, 0]
    assert roll == pytest.approx(0.27, rel=0.2)
    assert np.abs(others).max() < 0.05
    assert (found.total[:3, 0] - found.repeatable[:3, 0]) == pytest.approx(np.full(3, 0.12), abs=0.05)
    assert found.share[0, 0] > 6 * found.share_error[0, 0]
    assert np.isnan(found.total[3:]).all()


def test_a_gap_that_is_too_small_to_be_of_use_is_not_repeatable(of_two_paths):
    """As it is, and as shares of a thousandth of its size would be: simulated flights without noise have such."""
    assert of_two_paths.sure[0, 0]
    small = replace(of_two_paths, total=1e-6 * of_two_paths.total, repeatable=1e-6 * of_two_paths.repeatable)
    assert not small.sure.any()
    assert small.largest is None


@pytest.mark.parametrize("band", [0, 3, 4, 5])
def test_each_band_holds_what_its_windows_see(of_two_paths, band):
    """The same windows laid over what is missing itself."""
    ends = [(0.15, None), None, None, (0.6, 1.6), (1.2, 3.2), (3.2, None)][band]
    laid = [band_windows(0.01, *ends).average(missing(path)[:, 0]) for path in (0, 1)]
    truth = np.mean(np.concatenate(laid) ** 2)
    error = of_two_paths.share_error[0, band] * of_two_paths.total[0, band]
    assert of_two_paths.repeatable[0, band] == pytest.approx(truth, abs=max(3 * error, 0.1 * truth))


def test_the_noise_of_the_gyroscope_is_distinguished():
    """Runs without anything else: what does not come again is what white noise leaves of it."""
    runs = [run(0, draw) for draw in range(2)]
    pairs = zip(runs, [sines(1000 + draw, OWN)[0] + missing(0) for draw in range(2)], strict=True)
    found = split([replace(each, stated_torque=each.stated_torque + own) for each, own in pairs])
    assert found.noise[:3, 0] == pytest.approx(found.total[:3, 0], rel=0.2)
    slope = band_windows(0.01, 0.15, None).slope
    assert found.noise[:3, 0] == pytest.approx((INERTIA * NOISE) ** 2 * (slope**2).sum(), rel=0.1)


def test_what_is_explained_is_the_share_of_the_motion():
    """A torque that is a tenth too small lacks a tenth of what the motion takes, in every band with motion."""
    rate, slope = sines(0, 0.3)
    lacks = 0.1 * (INERTIA * slope + np.cross(rate, INERTIA * rate))
    runs = [run(0, draw, lacks=0.0) for draw in range(4)]
    found = split([replace(r, stated_torque=r.stated_torque - lacks) for r in runs])
    known = found.explained_error[:3] < 0.05
    assert known.sum() >= 6
    assert found.explained[:3][known] == pytest.approx(0.9, abs=0.1)


def test_pairs_of_one_path_with_a_flight_that_no_fit_has_seen_are_split():
    assert split([run(0, 0), run(1, 0)]) is None
    assert split([run(0, 0), run(0, 0)]) is None
    runs = [run(0, draw) for draw in range(3)]
    assert RepeatedRuns.of(runs).pairs == ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
    assert RepeatedRuns.of(runs, 1).pairs == ((0, 2), (1, 2), (2, 0), (2, 1))
    assert len(RepeatedRuns.of([*runs, run(1, 0)], 1).pairs) == 6


def test_runs_within_one_flight_are_found_by_what_was_asked_for_and_kept_with_the_flight():
    """A mission of `--repeat` is one log; the artifact of a comparison keeps the setpoint for `diagnose`."""
    part = slice(0, 1300)
    signals = [run(0, draw) for draw in range(3)]
    rate, torque = (
        np.concatenate([getattr(each, name)[part] for each in signals]) for name in ("body_rate", "stated_torque")
    )
    asked = np.tile(sines(5, 1.0)[0][part], (3, 1))
    time = 0.01 * np.arange(len(rate))
    whole = Signals(time=time, body_rate=rate, vehicle=VEHICLE, stated_torque=torque, setpoints={"position": asked})
    flight = replace(whole, name="mission")
    assert len(RepeatedRuns.of([flight]).pairs) == 6
    kept = RecordedFlight.of(flight, "given").flight(VEHICLE, 0.0)
    assert RepeatedRuns.of([kept]).pairs == RepeatedRuns.of([flight]).pairs
    assert RepeatedRuns.of([replace(flight, setpoints={})]) is None
