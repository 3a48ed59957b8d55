"""Test signals on a trajectory, and its repeats."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import chirp

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.excited import added_motion, lines_of, multisine, sweep
from cpfls_cli.trajectory.planning import plan, repeated
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings, WaypointSettings

GRAVITY = 9.81
SIGNALS = ("multisine", "sweep-linear", "sweep-logarithmic")
NAMES = ("position", "velocity", "acceleration", "jerk", "snap", "crackle", "pop")


def hovering(duration=40.0, sample_time=0.01, **asked):
    excite = ExciteSettings(**{"axes": ("roll", "pitch", "yaw", "vertical"), **asked})
    return TrajectorySettings(path="hover", duration_s=duration, sample_time_s=sample_time, excite=excite)


def excited(settings):
    path = plan(settings, GRAVITY)
    return added_motion(settings.excite, path, GRAVITY).onto(path, GRAVITY)


def curves(flown):
    """What each axis is excited by: two tilts, a yaw and a vertical acceleration."""
    return {
        "roll": flown.attitude[:, 0],
        "pitch": flown.attitude[:, 1],
        "yaw": flown.yaw,
        "vertical": flown.acceleration[:, 2],
    }


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("band", [(0.5, 5.0), (1.0, 3.0)])
def test_the_power_of_every_axis_lies_in_the_band(signal, band):
    flown = excited(hovering(signal=signal, band_hz=band))
    frequency = np.fft.rfftfreq(len(flown.time), flown.time[1])
    # Fades spread a line by their own width.
    inside = (frequency >= band[0] - 0.25) & (frequency <= band[1] + 0.25)
    for values in curves(flown).values():
        power = np.abs(np.fft.rfft(values)) ** 2
        assert power[inside].sum() > 0.99 * power.sum()


def test_a_multisine_has_equal_rates_at_the_frequencies_of_its_axis_and_none_elsewhere():
    settings, duration = hovering().excite, 40.0
    everywhere = []
    for number in range(4):
        lines = lines_of(settings, number, duration)
        time = duration / 4000 * np.arange(4000)
        spectrum = np.abs(np.fft.rfft(multisine(lines, duration, time)[1])) / 2000
        np.testing.assert_allclose(spectrum[lines], spectrum[lines[0]], rtol=1e-9)
        assert np.delete(spectrum, lines).max() < 1e-9 * spectrum[lines[0]]
        everywhere += lines.tolist()
    assert sorted(everywhere) == list(range(20, 201))


def test_phases_keep_the_peak_low():
    """Far below phases that are drawn at random, of which the median has 3.2 and the best of 200 has 2.5."""
    lines, duration = lines_of(hovering(axes=("roll",)).excite, 0, 40.0), 40.0
    time = duration / 8192 * np.arange(8192)
    values = multisine(lines, duration, time)[0]
    crest = np.abs(values).max() / values.std()
    assert crest < 1.6
    assert np.abs(values).max() == pytest.approx(1.0, rel=1e-3)
    phases = np.random.default_rng(1).uniform(0, 2 * np.pi, (200, len(lines)))
    # The sums of cosines of these phases, divided by their lines, at the same times.
    spectra = np.zeros((200, 4097), dtype=complex)
    spectra[:, lines] = 4096 * np.exp(1j * phases) / lines
    drawn = np.fft.irfft(spectra)
    first = np.cos(2 * np.pi / duration * np.multiply.outer(time, lines) + phases[0]) / lines
    np.testing.assert_allclose(drawn[0], first.sum(axis=1), rtol=0, atol=1e-9)
    assert crest < 0.7 * min(np.abs(each).max() / each.std() for each in drawn)


@pytest.mark.parametrize(("signal", "method"), [("sweep-linear", "linear"), ("sweep-logarithmic", "logarithmic")])
def test_a_sweep_is_that_of_scipy_with_equal_rates(signal, method):
    settings, time = ExciteSettings(axes=("roll",), signal=signal, band_hz=(0.4, 6.0)), np.linspace(0, 20, 2001)
    share = time / 20
    frequency = 0.4 + 5.6 * share if method == "linear" else 0.4 * 15.0**share
    expected = chirp(time, 0.4, 20.0, 6.0, method=method, phi=-90) * 0.4 / frequency
    np.testing.assert_allclose(sweep(settings, 20.0, time)[0], expected, atol=1e-9)


@pytest.mark.parametrize("signal", SIGNALS)
def test_derivatives_fit_each_other(signal):
    flown = excited(hovering(duration=20.0, sample_time=0.002, signal=signal, axes=("pitch", "yaw")))
    pairs = [(getattr(flown, low), getattr(flown, high)) for low, high in pairwise(NAMES[:-1])]
    pairs += [(flown.yaw, flown.yaw_rate), (flown.yaw_rate, flown.yaw_acceleration)]
    pairs += [(flown.attitude, flown.attitude_rate), (flown.attitude_rate, flown.attitude_acceleration)]
    for values, derivative in pairs:
        slope = CubicSpline(flown.time, values)(flown.time, 1)[5:-5]
        assert np.abs(slope - derivative[5:-5]).max() < 5e-4 * np.abs(derivative).max()
    # The pop of a fade has kinks.
    slope = CubicSpline(flown.time, flown.crackle)(flown.time, 1)[5:-5]
    assert np.abs(slope - flown.pop[5:-5]).max() < 0.02 * np.abs(flown.pop).max()


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize(("axis", "column"), [("roll", 0), ("pitch", 1), ("yaw", 2)])
def test_it_begins_and_ends_at_rest_and_is_as_large_as_asked_for(signal, axis, column):
    flown = excited(hovering(signal=signal, size_rad=0.2, axes=(axis,)))
    for name in (*NAMES[:6], "attitude", "attitude_rate", "attitude_acceleration"):
        np.testing.assert_allclose(getattr(flown, name)[[0, -1]], 0, atol=1e-9)
    largest = np.abs(flown.attitude).max(axis=0)
    assert largest[column] == pytest.approx(0.2, rel=1e-9)
    assert np.delete(largest, column).max() < 1e-9


def test_axes_of_a_multisine_are_hardly_correlated_and_sweeps_take_turns():
    """Without the fades they are not at all."""
    assert np.abs(np.corrcoef(np.array(list(curves(excited(hovering())).values()))) - np.eye(4)).max() < 0.2
    swept = np.array(list(curves(excited(hovering(signal="sweep-linear"))).values()))
    moving = np.abs(swept) > 1e-3 * np.abs(swept).max(axis=1, keepdims=True)
    for number in range(4):
        assert not moving[number, : 1000 * number].any()
        assert not moving[number, 1000 * (number + 1) + 1 :].any()


@pytest.mark.parametrize(("axis", "still"), [("roll", 1), ("pitch", 0)])
def test_an_axis_is_excited_alone_at_any_yaw(axis, still):
    points = tuple(WaypointSettings(position_m=at, yaw_rad=1.2) for at in ((0, 0, 0), (0, 0, 5)))
    settings = TrajectorySettings(
        path="waypoints", waypoints=points, duration_s=20.0, period_s=1.0, excite=ExciteSettings(axes=(axis,))
    )
    flown = excited(settings)
    assert np.abs(flown.attitude[:, 1 - still]).max() > 0.05
    assert np.abs(flown.attitude[:, still]).max() < 1e-9


def test_it_is_added_to_the_path_and_nothing_else():
    settings = TrajectorySettings(duration_s=54.86, excite=ExciteSettings(axes=("vertical",)))
    path = plan(settings, GRAVITY)
    flown = added_motion(settings.excite, path, GRAVITY).onto(path, GRAVITY)
    np.testing.assert_array_equal(flown.position[:, :2], path.position[:, :2])
    assert 0.3 < np.abs(flown.acceleration[:, 2] - path.acceleration[:, 2]).max() < 1.0
    assert path.yaw[-1] == 0.0


@pytest.mark.parametrize(
    ("settings", "key", "words"),
    [
        (TrajectorySettings(yaw_turn_rad=1.0, excite=ExciteSettings(axes=("roll",))), "yaw_turn_rad", "change places"),
        (hovering(duration=4.0, band_hz=(0.5, 1.0)), "excite.band_hz", "fly 40 s or longer"),
        (hovering(duration=20.0, signal="sweep-linear"), "excite.band_hz", "takes 8 s or more for each axis"),
    ],
)
def test_a_path_that_a_signal_does_not_fit_is_refused(settings, key, words):
    path = plan(settings, GRAVITY)
    with pytest.raises(SettingError, match=words) as caught:
        added_motion(settings.excite, path, GRAVITY)
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"excite": ExciteSettings(axes=("roll", "roll"))}, "excite.axes", "twice"),
        ({"excite": ExciteSettings(band_hz=(2.0, 1.0))}, "excite.band_hz", "must rise"),
        ({"excite": ExciteSettings(axes=("roll",), band_hz=(1.0, 20.0))}, "sample_time_s", "0.005 or less"),
        ({"excite": ExciteSettings(axes=("roll",)), "path": "next-flight"}, "excite.axes", "chooses its motion"),
        ({"excite": ExciteSettings(axes=("roll",)), "path": "full-rotation"}, "excite.axes", "chooses its motion"),
        ({"repeat": 2, "path": "full-rotation"}, "repeat", "never rests"),
        ({"repeat": 2, "yaw_profile": "uniform"}, "yaw_profile", "begins and ends at rest"),
        ({"path": "hover", "duration_s": None}, "duration_s", "needs a duration"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(changes, key, words):
    with pytest.raises(SettingError, match=words) as caught:
        TrajectorySettings(**changes)
    assert caught.value.key == key


POINTS = tuple(
    WaypointSettings(position_m=at, yaw_rad=yaw) for at, yaw in (((0, 0, 1), 0.5), ((9, 0, 1), 1.0), ((9, 5, 4), 3.0))
)
PATHS = {
    "ends elsewhere": {"sample_time_s": 0.02},
    "there and back": {"legs": 2, "duration_s": 40.0, "sample_time_s": 0.02},
    "half a turn": {"legs": 2, "duration_s": 40.0, "yaw_turn_rad": 3.5, "sample_time_s": 0.02},
    "between two samples": {"legs": 1, "duration_s": 20.013, "sample_time_s": 0.02},
    "as long as it takes": {"legs": 1, "duration_s": None, "sample_time_s": 0.02},
    "points with a yaw": {"path": "waypoints", "waypoints": POINTS, "duration_s": 40.0, "sample_time_s": 0.02},
    "excited": {"path": "hover", "duration_s": 10.0, "excite": ExciteSettings(axes=("roll", "yaw"))},
}


def flown(count=3, **changes):
    settings = TrajectorySettings(repeat=count, repeat_pause_s=2.5, **changes)
    run = plan(settings, GRAVITY)
    if settings.excite.axes:
        run = added_motion(settings.excite, run, GRAVITY).onto(run, GRAVITY)
    return run, repeated(run, settings, GRAVITY)


@pytest.fixture(params=PATHS.values(), ids=PATHS, scope="module")
def pair(request):
    return flown(**request.param)


def runs_of(mission, values):
    step = mission.time[1]
    firsts = [round(begin / step) for begin, _ in mission.runs]
    samples = round((mission.runs[0][1] - mission.runs[0][0]) / step) + 1
    return np.array([values[first : first + samples] for first in firsts])


def test_runs_are_equal_and_that_of_the_path(pair):
    run, mission = pair
    assert len(mission.runs) == 3
    signals = {name: values for name, values in vars(run).items() if isinstance(values, np.ndarray)}
    assert len(signals) == 15
    for name, values in signals.items():
        difference = runs_of(mission, getattr(mission, name)) - values
        if name == "time":
            difference -= np.array(mission.runs)[:, :1]
        if name == "yaw":
            difference = np.angle(np.exp(1j * difference))
        if name == "attitude":
            difference[..., 2] = np.angle(np.exp(1j * difference[..., 2]))
        np.testing.assert_allclose(difference, 0, atol=1e-9, err_msg=name)


def test_each_run_begins_and_ends_at_rest_after_a_pause(pair):
    _, mission = pair
    for name in ("velocity", "acceleration", "jerk", "snap", "attitude_rate", "attitude_acceleration"):
        np.testing.assert_allclose(runs_of(mission, getattr(mission, name))[:, [0, -1]], 0, atol=1e-9)
    for (_, end), (begin, _) in pairwise(mission.runs):
        assert begin - end >= 2.5 - 1e-9
        resting = (mission.time > begin - 2.4) & (mission.time < begin)
        assert resting.any()
        assert np.abs(mission.velocity[resting]).max() < 1e-9
        assert np.abs(mission.attitude_rate[resting]).max() < 1e-9
    assert mission.duration == pytest.approx(mission.runs[-1][1], abs=mission.time[1])


def test_the_whole_mission_is_one_smooth_motion(pair):
    _, mission = pair
    np.testing.assert_allclose(np.diff(mission.time), mission.time[1])
    names = ("position", "velocity", "acceleration", "jerk")
    pairs = [(getattr(mission, low), getattr(mission, high)) for low, high in pairwise(names)]
    pairs += [(mission.attitude, mission.attitude_rate), (mission.yaw, mission.yaw_rate)]
    for values, derivative in pairs:
        slope = CubicSpline(mission.time, values)(mission.time, 1)
        assert np.abs(slope - derivative).max() < 2e-3 * max(np.abs(derivative).max(), 1e-6)


def test_moves_of_all_runs_and_the_ways_back_are_listed():
    run, mission = flown(**PATHS["ends elsewhere"])
    assert len(mission.legs) == 3 * len(run.legs) + 2
    begins = [leg.begin for leg in mission.legs]
    assert begins == sorted(begins)
    ends = np.array([leg.start + leg.vector for leg in mission.legs])
    np.testing.assert_allclose(ends[3], mission.position[0], atol=1e-9)
    np.testing.assert_allclose([leg.start for leg in mission.legs[1:]], ends[:-1], atol=1e-9)


def test_one_run_is_the_path_itself_and_more_samples_than_memory_holds_are_refused():
    run, mission = flown(count=1, legs=1)
    assert mission is run
    with pytest.raises(SettingError, match="more than") as caught:
        flown(count=1000, sample_time_s=0.002)
    assert caught.value.key == "sample_time_s"
