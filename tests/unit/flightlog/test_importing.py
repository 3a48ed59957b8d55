from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flightlog.importing import apply_rotor_lag, import_log, read_signals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap

RATE = {"body_rate": SignalMap(columns=("p", "q", "r"), unit="rad/s")}


def settings(**changes):
    return ImportSettings(**({"signals": RATE, "torque_source": None} | changes))


def log(samples=201, period=0.01, **broken):
    """Columns of a log; of some the rows that are broken, and what they hold."""
    time = period * np.arange(samples)
    columns = {"t": time.copy(), "p": np.sin(time), "q": np.cos(2 * time), "r": 0.3 * time}
    for name, (rows, value) in broken.items():
        columns[name][rows] = value
    return columns


def without(columns, rows):
    return {name: np.delete(values, rows) for name, values in columns.items()}


def test_a_clean_log_comes_back_as_it_is():
    signals = read_signals(log(), settings())
    np.testing.assert_allclose(signals.body_rate[:, 0], np.sin(signals.time), atol=1e-12)
    assert signals.samples_read == signals.samples == 201
    assert signals.log_rate_hz == pytest.approx(100)
    assert not any(signals.dropped.values())


def test_time_stamps_in_microseconds_from_any_start_give_time_from_zero():
    columns = log()
    columns["t"] = 1e6 * columns["t"] + 5e12
    signals = read_signals(columns, settings(time_unit="us"))
    assert signals.time[0] == 0
    assert signals.time[-1] == pytest.approx(2.0)


def test_missing_columns_are_all_named_with_key_and_nearest_name():
    columns = log()
    columns["gyro.q"] = columns.pop("q")
    columns["stamp"] = columns.pop("t")
    mapped = {"body_rate": SignalMap(columns=("p", "gyro_q", "r"), unit="rad/s")}
    with pytest.raises(InputError) as caught:
        read_signals(columns, settings(signals=mapped, time_column="stmp"))
    assert "import.time_column: the log has no column 'stmp' (nearest: stamp)" in str(caught.value)
    assert "import.signals.body_rate.columns: the log has no column 'gyro_q' (nearest: gyro.q)" in str(caught.value)


def test_of_repeated_time_stamps_the_first_counts():
    columns = {name: np.insert(values, 100, values[100]) for name, values in log().items()}
    columns["p"][101] = 99.0
    signals = read_signals(columns, settings())
    assert signals.dropped["repeated_time"] == 1
    assert signals.body_rate[:, 0].max() <= 1


def test_samples_that_go_backward_are_dropped():
    signals = read_signals(log(t=(slice(50, 53), 0.1), p=(slice(50, 53), 99.0)), settings())
    assert signals.dropped["backward_time"] == 3
    np.testing.assert_allclose(signals.body_rate[:, 0], np.sin(signals.time), atol=1e-4)


def test_a_time_stamp_that_is_not_a_number_drops_its_row():
    assert read_signals(log(t=(50, np.nan)), settings()).dropped["time_not_finite"] == 1


def test_columns_with_fewer_than_two_values_are_all_named():
    columns = log() | {"p": np.full(201, np.nan), "r": np.append(0.0, np.full(200, np.nan))}
    with pytest.raises(InputError) as caught:
        read_signals(columns, settings())
    assert str(caught.value).splitlines() == [
        "import.signals.body_rate.columns: 'p' has fewer than two values (0) in the 201 rows that are read",
        "import.signals.body_rate.columns: 'r' has fewer than two values (1) in the 201 rows that are read; map another"
        " column, or leave the signal out of import.signals",
    ]


def test_a_short_gap_is_interpolated_and_counted():
    signals = read_signals(without(log(), slice(100, 105)), settings())
    assert signals.gaps == 1
    assert signals.longest_gap_s == pytest.approx(0.06)
    np.testing.assert_allclose(signals.body_rate[:, 0], np.sin(signals.time), atol=1e-3)


def test_a_gap_of_exactly_the_allowed_length_passes():
    assert read_signals(without(log(), slice(100, 105)), settings(gap_s=0.06)).gaps == 1


def test_a_long_gap_stops_and_says_where():
    with pytest.raises(InputError, match=r"gap of 0\.31 s at 0\.990 s"):
        read_signals(without(log(), slice(100, 130)), settings())


def test_or_the_longest_part_is_kept():
    signals = read_signals(without(log(), slice(120, 150)), settings(gap_rule="longest-part"))
    assert signals.dropped["gap"] == 51
    assert signals.time[-1] == pytest.approx(1.19)
    assert any("gap" in sentence for sentence in signals.warnings)


LOOP = pytest.mark.parametrize("quaternion", [None, "wxyz", "xyzw"])


def looped(quaternion):
    """A log of 2 s with a loop after 0.7 s, whose attitude is stated as angles or as a quaternion."""
    pitch = np.where(np.abs(np.arange(201) - 70) < 5, np.pi / 2, 0.1)
    turned = {"w": np.cos(pitch / 2), "x": np.zeros(201), "y": np.sin(pitch / 2), "z": np.zeros(201)}
    angles = {"x": np.zeros(201), "y": pitch, "z": np.zeros(201)}
    name, columns, unit = ("quaternion", tuple(quaternion), "1") if quaternion else ("attitude", (*"xyz",), "rad")
    mapped = {"signals": RATE | {name: SignalMap(columns=columns, unit=unit)}, "quaternion_order": quaternion or "wxyz"}
    return log() | (turned if quaternion else angles), mapped


@LOOP
def test_a_pitch_of_a_quarter_turn_stops_and_says_how_to_go_on(quaternion):
    columns, mapped = looped(quaternion)
    with pytest.raises(ComputationError, match=r"of \+-90 degrees at 0\.660 s.*gap_rule to longest-part"):
        import_log(columns, settings(**mapped))


@LOOP
def test_or_the_longest_part_without_one_is_kept(quaternion):
    columns, mapped = looped(quaternion)
    read = import_log(columns, settings(gap_rule="longest-part", **mapped))
    assert read.span_s == pytest.approx((0.85, 2.0))
    assert any("within a degree of +-90 degrees at 0.660 s" in warning for warning in read.warnings)
    np.testing.assert_allclose(read.attitude[:, 1], 0.1, atol=1e-9)


def test_absent_values_are_interpolated_and_counted_by_column():
    signals = read_signals(log(q=([40, 41, 42], np.nan), r=(7, np.inf)), settings())
    assert signals.missing == {"q": 3, "r": 1}
    np.testing.assert_allclose(signals.body_rate[:, 1], np.cos(2 * signals.time), atol=2e-3)


def test_absent_values_for_longer_than_the_gap_are_a_gap():
    with pytest.raises(InputError, match=r"gap of 0\.21 s"):
        read_signals(log(q=(slice(40, 60), np.nan)), settings())


def test_a_column_that_begins_late_and_ends_early_sets_the_span():
    signals = read_signals(log(r=(np.r_[0:20, -5:0], np.nan)), settings())
    assert signals.dropped["incomplete_ends"] == 25
    assert signals.span_s == pytest.approx((0.2, 1.95))
    np.testing.assert_allclose(signals.body_rate[:, 2], 0.3 * (signals.time + 0.2), atol=1e-12)


def test_a_sensor_of_a_lower_rate_is_interpolated():
    signals = read_signals(log(r=(np.arange(201) % 4 != 0, np.nan)), settings())
    np.testing.assert_allclose(signals.body_rate[:, 2], 0.3 * log()["t"], atol=1e-12)


def test_spikes_are_found_counted_and_interpolated():
    columns = log()
    columns["p"] = columns["p"] + 1e-3 * np.random.default_rng(1).standard_normal(201)
    columns["p"][[60, 150]] += [5.0, -4.0]
    signals = read_signals(columns, settings(spike_deviations=8.0))
    assert signals.spikes == {"p": 2}
    np.testing.assert_allclose(signals.body_rate[:, 0], np.sin(signals.time), atol=6e-3)


def test_a_spike_in_a_signal_without_noise_is_found_and_nothing_else():
    columns = log()
    columns["r"][80] += 1.0
    assert read_signals(columns, settings(spike_deviations=6.0)).spikes == {"r": 1}


def test_jumps_of_a_rotor_command_are_no_spikes():
    columns = log() | {"u": np.where(np.arange(201) == 90, 1.0, 0.2)}
    mapped = RATE | {"rotor_command": SignalMap(columns=("u",), unit="1")}
    signals = read_signals(columns, settings(signals=mapped, spike_deviations=6.0))
    assert signals.spikes == {}
    assert signals.rotor_command[90, 0] == pytest.approx(1)


def test_without_a_threshold_spikes_are_counted_and_warned_of_and_stay():
    columns = log()
    columns["p"][[60, 61, 150]] += 5.0
    signals = read_signals(columns, settings())
    assert (signals.spikes, signals.suspected_spikes) == ({}, {"p": 3})
    (warning,) = signals.warnings
    assert warning.startswith("3 suspected spikes in column p, used as logged: set import.spike_deviations")
    np.testing.assert_allclose(signals.body_rate[:, 0], columns["p"], atol=1e-12)


def test_values_outside_the_part_that_is_kept_are_not_counted():
    columns = without(log(), slice(120, 150))
    columns["q"][[60, 140]] = np.nan
    columns["p"][[30, 155]] += 5.0
    signals = read_signals(columns, settings(gap_rule="longest-part"))
    assert (signals.missing, signals.suspected_spikes) == ({"q": 1}, {"p": 1})


def test_saturated_values_are_counted_and_left_alone():
    columns = log()
    columns["q"] = np.clip(columns["q"], -0.5, 0.5)
    signals = read_signals(columns, settings())
    assert signals.saturated == {"q": int((np.abs(columns["q"]) == 0.5).sum())}
    assert any(sentence.startswith("column q stays at its extreme") for sentence in signals.warnings)
    np.testing.assert_allclose(signals.body_rate[:, 1], columns["q"], atol=1e-12)


def test_a_constant_column_is_not_called_saturated():
    columns = log()
    columns["q"] = np.zeros(201)
    assert read_signals(columns, settings()).saturated == {}


def test_the_crop_counts_from_the_first_time_stamp():
    columns = log()
    columns["t"] = columns["t"] + 100
    signals = read_signals(columns, settings(crop_s=(0.5, 1.5)))
    assert signals.dropped["crop"] == 100
    np.testing.assert_allclose(signals.body_rate[:, 0], np.sin(signals.time + 0.5), atol=1e-12)


def test_scale_offset_and_sign_apply_before_the_unit():
    mapped = {"body_rate": SignalMap(columns=("p", "q", "r"), unit="deg/s", sign=(1, -1, 1), scale=2.0, offset=3.0)}
    signals = read_signals(log(), settings(signals=mapped))
    np.testing.assert_allclose(signals.body_rate[:, 1], -np.deg2rad(2 * log()["q"] + 3), atol=1e-12)


def test_yaw_logged_between_minus_and_plus_180_degrees_turns_on():
    columns = log()
    yaw = 400 * columns["t"]
    columns |= {"roll": 0 * yaw, "pitch": 0 * yaw, "yaw": (yaw + 180) % 360 - 180}
    mapped = {"attitude": SignalMap(columns=("roll", "pitch", "yaw"), unit="deg")}
    signals = read_signals(without(columns, slice(45, 48)), settings(signals=mapped))
    np.testing.assert_allclose(signals.attitude[:, 2], np.deg2rad(400 * signals.time), atol=1e-9)


def attitude(columns, **angles):
    """Add an attitude that moves a little where it is not given: one that stands still is warned of as dead."""
    names = ("roll", "pitch", "yaw")
    little = dict.fromkeys(names, 0.001 * columns["q"])
    return columns | little | angles, {"attitude": SignalMap(columns=names, unit="rad")}


def test_degrees_taken_for_radians_stop_at_the_pitch():
    columns, mapped = attitude(log(), pitch=20 * log()["p"])
    with pytest.raises(InputError, match=r"attitude reaches 20 rad of pitch.* is import.signals.attitude.unit deg\?"):
        read_signals(columns, settings(signals=mapped))


def test_a_nose_straight_up_is_no_degrees():
    columns, mapped = attitude(log(), pitch=np.pi / 2 + 0.01 + 1e-3 * log()["p"])
    assert read_signals(columns, settings(signals=mapped)).warnings == ()


@pytest.mark.parametrize("rule", ["stop", "longest-part"])
@pytest.mark.parametrize("wrong", [None, 170])
def test_a_vertical_nose_does_not_pass_because_of_a_wrong_value_elsewhere(rule, wrong):
    """Nor where it is always up, which leaves nothing to be a gap."""
    roll, pitch = np.zeros(201), np.full(201, np.pi / 2)
    if wrong is not None:
        pitch[20:], pitch[wrong], roll[140:] = 0.1, 5.0, np.nan
    columns, mapped = attitude(log(), roll=roll, pitch=pitch)
    with pytest.raises(ComputationError, match=r"pitch comes within a degree"):
        import_log(columns, settings(signals=mapped, gap_rule=rule))


def test_a_spike_of_the_pitch_that_is_interpolated_is_no_degrees():
    pitch = 0.1 * log()["p"]
    pitch[80] = 40.0
    columns, mapped = attitude(log(), pitch=pitch)
    read_signals(columns, settings(signals=mapped, spike_deviations=8.0))
    with pytest.raises(InputError, match="spike_deviations"):
        read_signals(columns, settings(signals=mapped))


@pytest.mark.parametrize("angle", ["roll", "yaw"])
def test_roll_and_yaw_beyond_a_full_turn_are_doubted_where_no_gyroscope_can_tell(angle):
    columns, mapped = attitude(log(), **{angle: 30 * log()["p"]})
    (warning,) = read_signals(columns, settings(signals=mapped)).warnings
    assert warning.startswith(f"attitude reaches 30 rad of {angle}: is import.signals.attitude.unit deg?")
    assert read_signals(columns, settings(signals=mapped | RATE)).warnings == ()


@pytest.mark.parametrize(("name", "signal"), [("quaternion", "1"), ("rotor_speed", "rad/s"), ("rotor_command", "1")])
def test_a_quaternion_near_one_and_rotors_at_rest_are_not_saturated(name, signal):
    value = np.where(np.arange(201) < 100, 0.0, 400 * log()["p"])
    columns = log() | {f"u{i}": value for i in range(4)}
    if name == "quaternion":
        columns |= {"u0": np.minimum(1.0, 1.2 - 0.2 * log()["t"]), "u1": 0 * value, "u2": 0 * value, "u3": 0.1 * value}
    mapped = RATE | {name: SignalMap(columns=("u0", "u1", "u2", "u3"), unit=signal)}
    assert read_signals(columns, settings(signals=mapped)).saturated == {}


def test_rotors_at_their_largest_speed_are_saturated():
    columns = log() | {"u": np.minimum(np.where(np.arange(201) < 50, 0.0, 900 * log()["t"]), 1000.0)}
    mapped = RATE | {"rotor_speed": SignalMap(columns=("u",), unit="rad/s")}
    saturated = read_signals(columns, settings(signals=mapped)).saturated
    assert saturated == {"u": int((columns["u"] == 1000).sum())}
    assert saturated["u"] > 80


@pytest.mark.parametrize(("limit", "found"), [(2000.0, set()), (700.0, {"u"})])
def test_an_update_that_rows_repeat_is_at_no_limit_until_several_are(limit, found):
    """Rows of 100 Hz repeat each update of 4 Hz 25 times: its largest alone would look like a limit."""
    columns = log(2001)
    updates = 800 + 200 * np.sin(0.2 * np.arange(81))
    columns["u"] = np.minimum(updates, limit)[np.floor(4 * columns["t"] + 1e-9).astype(int)]
    mapped = RATE | {"rotor_speed": SignalMap(columns=("u",), unit="rad/s")}
    assert set(read_signals(columns, settings(signals=mapped)).saturated) == found


@pytest.mark.parametrize("rule", ["stop", "longest-part"])
def test_a_step_longer_than_the_gap_asks_for_the_unit_of_time(rule):
    """A log at 100 Hz whose stamps are milliseconds, taken for seconds."""
    with pytest.raises(InputError) as caught:
        read_signals(log() | {"t": 1e3 * log()["t"]}, settings(gap_rule=rule))
    assert str(caught.value) == (
        "the median step is 10 s, longer than import.gap_s = 0.1: check import.time_unit = s, or raise import.gap_s"
    )


@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (1 / 320, False), (1e-3, True)])
def test_a_clock_that_no_sensor_has_asks_for_the_unit_of_time(factor, said):
    report = read_signals(log() | {"t": factor * log()["t"]}, settings())
    asked = [each for each in report.warnings if "is import.time_unit = s right" in each]
    assert asked == (["1e+05 rows a second, which no sensor of a vehicle gives: is import.time_unit = s right"] * said)


def test_a_slow_column_in_a_fast_log_is_distinguished_from_a_wrong_clock():
    with pytest.raises(InputError, match=r"a mapped column has a value only every 0\.2 s"):
        read_signals(log(r=(np.arange(201) % 20 != 0, np.nan)), settings())


def test_a_signal_whose_rows_repeat_updates_is_known():
    columns = log(800)
    held = {name: np.repeat(columns[name][::4], 4) for name in "pqr"}
    signals = read_signals(columns | held, settings())
    assert signals.repeated == ("body_rate",)
    assert signals.updated_hz["body_rate"] == pytest.approx(25, rel=0.01)
    assert read_signals(columns, settings()).repeated == ()


TAU, PERIOD = 0.07, 0.004


def stepped(command=True):
    time = PERIOD * np.arange(200)
    steps = np.where(time[:, None] < 0.2 - 1e-9, 0.5, 0.8) * np.ones(4)
    return replace(read_signals(log(), settings()), time=time, rotor_command=steps if command else None)


def test_rotors_follow_a_step_as_an_exponential():
    speed = apply_rotor_lag(stepped(), TAU).rotor_command[:, 2]
    after = stepped().time - 0.2
    expected = np.where(after < 0, 0.5, 0.8 - 0.3 * np.exp(-np.maximum(after, 0) / TAU))
    assert speed == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("own", "lag"), [(stepped(), 0.0), (stepped(command=False), TAU)])
def test_no_lag_of_rotors_or_no_command_changes_nothing(own, lag):
    assert apply_rotor_lag(own, lag) is own
