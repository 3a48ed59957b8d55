from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import LogContents
from cpfls_cli.look.columns import LookedLog, on_clock
from cpfls_cli.look.flight import Samples
from cpfls_cli.look.hover import hover_of
from cpfls_cli.look.reading import read_flight
from tests.builders import looked_logs as logs
from tests.builders.topic_logs import topic
from tests.builders.unknown_logs import FLIP, GRAVITY, flat_log, flight, named

OWN = flight(seconds=20.0)


def read(contents):
    return read_flight("log", contents.topics, contents.units, contents.parameters, contents.system)


def on(found, values, time=OWN.time):
    """What was made, on the clock of what is read."""
    return np.column_stack([np.interp(found.time, time, own) for own in values.T])


def turning(found):
    """Correlate angular acceleration with the command, axis by axis, slow parts of both."""
    kernel = np.hanning(round(0.2 * found.rate_hz))
    rate, acts = (
        np.column_stack([np.convolve(own, kernel / kernel.sum(), "valid") for own in values.T])
        for values in (found.body_rate, found.command)
    )
    change = np.gradient(rate, axis=0)
    return [np.corrcoef(change[:, axis], acts[:, axis])[0, 1] for axis in range(3)]


@pytest.mark.parametrize("autopilot", logs.WRITERS)
def test_one_flight_is_the_same_in_every_log(autopilot):
    found = read(logs.WRITERS[autopilot](OWN))
    assert (found.autopilot, found.rate_hz) == (autopilot, pytest.approx(200.0, rel=1e-3))
    # Of a sample every 0.01 s: exact where there is one.
    np.testing.assert_allclose(found.body_rate[::2], on(found, OWN.rate @ FLIP)[::2], atol=1e-6)
    np.testing.assert_allclose(found.gyroscope.values, OWN.rate @ FLIP, atol=1e-6)
    np.testing.assert_allclose(found.specific_force, on(found, OWN.specific_force @ FLIP), atol=1e-6)
    assert np.median(found.specific_force[:, 2]) == pytest.approx(-GRAVITY, rel=0.05)
    # Without a word on the commands they are shares of speed.
    made = logs.command(OWN, autopilot) if autopilot else None
    if made is not None:
        np.testing.assert_allclose(found.command[::2], on(found, made)[::2], atol=2e-3)
    assert min(turning(found)) > 0.9
    assert found.rotors_source == "logged"
    assert found.command_source.startswith("logged rotors")
    assert found.usable.mean() > 0.99
    assert sorted(found.spins) == [-1, -1, 1, 1]
    forward, right = np.sign(found.places).T
    assert {(x, y, s) for x, y, s in zip(forward, right, found.spins, strict=True)} == {
        (x, -y, s) for x, y, s in ((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1))
    }


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot", ""])
def test_attitude_height_and_battery(autopilot):
    found = read(logs.WRITERS[autopilot](OWN))
    known = np.isfinite(found.attitude).all(axis=1)
    assert known.mean() > 0.9
    roll, pitch, _ = on(found, OWN.angles).T
    np.testing.assert_allclose(found.attitude[known, 0], roll[known], atol=0.02)
    np.testing.assert_allclose(found.attitude[known, 1], -pitch[known], atol=0.02)
    # Heading east is a quarter turn from north, clockwise.
    yaw = np.pi / 2 - on(found, OWN.angles)[known, 2]
    np.testing.assert_allclose(np.exp(1j * found.attitude[known, 2]), np.exp(1j * yaw), atol=0.04)
    height = on(found, OWN.position)[:, 2] - OWN.position[0, 2]
    assert np.nanmax(np.abs(found.height - height)) < 0.1
    known = np.isfinite(found.climb_rate)
    assert np.corrcoef(found.climb_rate[known], on(found, OWN.velocity)[known, 2])[0, 1] > 0.98
    if autopilot:
        assert np.nanmedian(found.voltage) == pytest.approx(15.9, abs=0.01)
        assert np.nanmedian(found.current) == 9.0


def test_slow_motors_leave_the_output_of_the_rate_loop():
    found = read(logs.px4(OWN, motors=10, outputs=2))
    assert found.command_source.startswith("output of the rate loop, vehicle_torque_setpoint")
    assert found.rate_hz == pytest.approx(100.0, rel=1e-3)
    np.testing.assert_allclose(found.command[2:-2:2], on(found, logs.command(OWN, "px4"))[2:-2:2], atol=5e-3)
    assert found.rotors.rate_hz == pytest.approx(10.0)


def test_stamps_of_samples_come_before_those_of_messages():
    contents = logs.px4(OWN, motors=0)
    late = {name: dict(fields) for name, fields in contents.topics.items()}
    own = late["vehicle_torque_setpoint"]
    own["timestamp_sample"], own["timestamp"] = own["timestamp"], own["timestamp"] + 0.013
    contents.topics.update(late)
    found = read(contents)
    np.testing.assert_allclose(found.command[::2], on(found, logs.command(OWN, "px4"))[::2], atol=2e-3)


def test_rotors_are_not_needed():
    asked = {"vehicle_rates_setpoint": topic(OWN, 2, named(OWN.rate @ FLIP, "roll", "pitch", "yaw"))}
    found = read(logs.px4(OWN, motors=0, outputs=0, more=asked))
    assert found.rotors.values.shape == (0, 0)
    assert found.rotors_source == found.command_source == ""
    assert np.isnan(found.command).all()
    assert found.usable.mean() > 0.95
    np.testing.assert_allclose(found.rate_setpoint[4:-4], on(found, OWN.rate @ FLIP)[4:-4], atol=0.2)


def test_propellers_that_turn_the_other_way():
    found = read(logs.betaflight(OWN, reversed_spins=True))
    # Rear right, front right, rear left, front left: the usual ones are -1, 1, 1, -1.
    assert found.spins.tolist() == [1, -1, -1, 1]
    np.testing.assert_allclose(found.command[::2], on(found, logs.command(OWN, "betaflight"))[::2], atol=2e-3)


def test_setpoint_of_betaflight_3_follows_from_its_error():
    gains, asked = np.array([45.0, 47.0, 45.0]), np.degrees(OWN.rate) + 20 * np.sin(OWN.time)[:, None]
    throttle = 1200 + 700 * (0.5 + 0.5 * np.sin(0.7 * OWN.time))
    # Roll and pitch weaken with the throttle beyond a breakpoint, yaw does not.
    weaker = 1 - 0.4 * np.clip((throttle - 1500) / 500, 0, 1)
    weaker = np.column_stack([weaker, weaker, np.ones_like(weaker)])
    error = 0.032029 * gains * weaker * (asked - np.degrees(OWN.rate))
    more = named(error, *(f"axisP[{k}]" for k in range(3))) | {"rcCommand[3]": throttle}
    contents = logs.betaflight(OWN, version="3.1.3", more=more)
    contents.parameters.update({"tpa_rate": 40.0, "tpa_breakpoint": 1500.0})
    found = read(contents)
    np.testing.assert_allclose(found.rate_setpoint[::2], on(found, np.radians(asked) @ FLIP)[::2], atol=1e-4)


@pytest.mark.parametrize("names", [("R", "P", "Y"), ("Rll", "Pit", "Yaw")])
def test_rates_in_hundredths_of_old_logs(names):
    own = {name: 100 * np.degrees(value) for name, value in named(OWN.rate @ FLIP, *names).items()}
    own |= {f"{name}Des": value for name, value in own.items()}
    found = read(logs.ardupilot(OWN, more={"RATE": topic(OWN, 1, own)}))
    np.testing.assert_allclose(found.rate_setpoint[::2], on(found, OWN.rate @ FLIP)[::2], atol=1e-6)


def test_gyroscope_before_filters():
    raw = np.degrees(OWN.rate) + 2 * np.sin(40 * OWN.time)[:, None]
    found = read(logs.betaflight(OWN, more=named(raw, *(f"gyroUnfilt[{k}]" for k in range(3)))))
    np.testing.assert_allclose(found.gyroscope_unfiltered.values, np.radians(raw) @ FLIP)
    debug = named(raw, *(f"debug[{k}]" for k in range(3)))
    contents = logs.betaflight(OWN, more=debug)
    assert read(contents).gyroscope_unfiltered is None
    contents.parameters["debug_mode"] = 6.0
    np.testing.assert_allclose(read(contents).gyroscope_unfiltered.values, np.radians(raw) @ FLIP)
    # Another quantity in the same columns is no gyroscope.
    contents.topics[""].update({name: 3 * value for name, value in debug.items()})
    assert read(contents).gyroscope_unfiltered is None


def test_packets_of_a_gyroscope_are_laid_out_in_time():
    fast = np.repeat(OWN.time, 4) + np.tile([-0.0075, -0.005, -0.0025, 0.0], len(OWN.time))
    values = np.column_stack([np.interp(fast, OWN.time, axis) for axis in (OWN.rate @ FLIP).T])
    packed = np.round(values / 1e-3).reshape(-1, 4, 3)
    fields = {"dt": 2500 + 0 * OWN.time, "scale": 1e-3 + 0 * OWN.time, "samples": 4 + 0 * OWN.time}
    fields |= {f"{axis}[{k}]": packed[:, k, index] for index, axis in enumerate("xyz") for k in range(4)}
    found = read(logs.px4(OWN, more={"sensor_gyro_fifo": topic(OWN, 1, fields)}))
    assert found.gyroscope_unfiltered.rate_hz == pytest.approx(400.0, rel=1e-3)
    np.testing.assert_allclose(found.gyroscope_unfiltered.time, fast, atol=1e-9)
    np.testing.assert_allclose(found.gyroscope_unfiltered.values, values, atol=6e-4)


def test_a_gap_is_not_used():
    contents = logs.betaflight(OWN)
    kept = (OWN.time < 8.0) | (OWN.time >= 8.4)
    contents.topics[""].update({name: value[kept] for name, value in contents.topics[""].items()})
    found = read(contents)
    np.testing.assert_allclose(found.gaps_s, [[7.99, 8.4]], atol=1e-6)
    assert not found.usable[(found.time > 7.99) & (found.time < 8.4)].any()
    assert found.usable[(found.time > 8.42) & (found.time < 9.0)].all()
    assert found.flown[(found.time > 7.99) & (found.time < 8.4)].all()


def test_what_is_faster_than_the_clock_is_not_folded():
    time = np.arange(4000) / 1000
    fast = Samples(time, np.sin(2 * np.pi * 3 * time)[:, None] + np.sin(2 * np.pi * 197 * time)[:, None])
    clock = np.arange(0.0, 3.9, 0.01)
    found = on_clock(fast, clock, 1)[:, 0]
    # 197 Hz would be 3 Hz at 100 samples a second.
    np.testing.assert_allclose(found[50:-50], np.sin(2 * np.pi * 3 * clock)[50:-50], atol=0.01)


def test_sticks_are_positive_as_the_rate():
    rate = OWN.rate @ FLIP / 4
    # PX4's pitch stick is positive forward, which lowers the nose; Betaflight's columns are in the gyroscope's axes.
    sticks = topic(OWN, 2, named(rate * [1, -1, 1], "roll", "pitch", "yaw") | {"throttle": 0 * OWN.time})
    pulses = topic(OWN, 2, named(1500 + 500 * rate, "C1", "C2", "C4") | {"C3": 1400 + 0 * OWN.time})
    flat = named(500 * rate @ FLIP, *(f"rcCommand[{k}]" for k in range(3)))
    for contents in (
        logs.px4(OWN, more={"manual_control_setpoint": sticks}),
        logs.ardupilot(OWN, more={"RCIN": pulses}),
        logs.betaflight(OWN, more=flat),
    ):
        found = read(contents)
        known = np.isfinite(found.stick).all(axis=1)
        assert known.mean() > 0.95
        for axis in range(3):
            assert np.corrcoef(found.stick[known, axis], found.body_rate[known, axis])[0, 1] > 0.9


def test_motion_a_log_without_a_gyroscope_and_heights_alone_are_not_enough():
    with pytest.raises(InputError, match=r"neither rotors nor anything that was asked.*SDLOG_PROFILE"):
        read(logs.px4(OWN, motors=0, outputs=0))
    contents = logs.px4(OWN)
    for name in ("sensor_combined", "vehicle_angular_velocity"):
        del contents.topics[name]
    with pytest.raises(InputError, match=r"^a log without a gyroscope.*SDLOG_PROFILE"):
        read(contents)
    contents = logs.ardupilot(OWN)
    for name in set(contents.topics) - {"BAT"}:
        del contents.topics[name]
    climbs = 5 - 5 * np.cos(0.5 * OWN.time)
    contents.topics["CTUN"] = {"timestamp": OWN.time, "Alt": climbs, "BAlt": climbs}
    with pytest.raises(InputError, match=r"^a log without a gyroscope \(it holds .*voltage.*\): .*LOG_BITMASK"):
        read(contents)


def test_columns_that_are_called_rates_and_are_none_are_named():
    dots = ("roll_dot", "pitch_dot", "yaw_dot")
    angles = np.unwrap(OWN.angles, axis=0)
    for rates, why in (
        (np.gradient(angles, OWN.time, axis=0), "are derivatives of angles, or wrong: as rates of .* the attitude"),
        (0 * angles, "never change"),
        (np.nan * angles, "hold no samples"),
    ):
        contents = logs.WRITERS[""](OWN)
        fields = contents.topics[""]
        for name in [name for name in fields if name.startswith(("gyro", "q"))]:
            del fields[name]
        fields |= named(OWN.angles, "roll", "pitch", "yaw") | named(rates, *dots)
        with pytest.raises(InputError, match=rf"without a gyroscope \(.*; roll_dot, pitch_dot and yaw_dot {why}\)"):
            read(contents)


def test_of_derivatives_without_angles_it_is_said_what_a_gyroscope_is_best_called():
    contents = logs.WRITERS[""](OWN)
    fields = contents.topics[""]
    for name in [name for name in fields if name.startswith(("gyro", "q", "roll", "pitch", "yaw"))]:
        del fields[name]
    fields |= named(OWN.rate, "phi_dot_cal", "theta_dot_cal", "psi_dot_cal")
    with pytest.raises(InputError, match=r"psi_dot_cal may be derivatives of angles; .* best called gyro_x"):
        read(contents)


def _frozen(rates):
    return np.where((OWN.time > 8.0)[:, None] & (OWN.time < 12.0)[:, None], rates[800], rates)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda rates: rates,
        lambda rates: rates + np.array([0.3, 0.0, 0.0]),
        lambda rates: rates * np.array([1.0, -1.0, 1.0]) + np.array([0.0, 0.2, 0.0]),
        lambda rates: rates[:, [1, 0, 2]],
        _frozen,
    ],
)
def test_rates_of_the_body_that_are_called_derivatives_may_be_wrong(wrong):
    """An offset, a sign, swapped columns or a silent source make no rate of the body a derivative of angles."""
    contents = logs.WRITERS[""](OWN)
    fields = contents.topics[""]
    for name in [name for name in fields if name.startswith(("gyro", "q"))]:
        del fields[name]
    fields |= named(OWN.angles, "roll", "pitch", "yaw") | named(wrong(OWN.rate), "roll_dot", "pitch_dot", "yaw_dot")
    assert set(read(contents).gyroscope.source.split(", ")) == {"roll_dot", "pitch_dot", "yaw_dot"}


def test_a_first_row_without_a_stamp_is_left_out():
    contents = logs.WRITERS[""](OWN)
    (clock,) = (name for name in contents.topics[""] if name in ("t", "time"))
    contents.topics[""][clock] = np.where(np.arange(len(OWN.time)) < 3, np.nan, contents.topics[""][clock])
    found = read(contents)
    assert found.time[0] == 0.0
    assert found.time[-1] == pytest.approx(OWN.time[-1] - OWN.time[3], abs=0.02)


def test_surfaces_of_an_airplane_are_no_rotors():
    asked = {"throttle": 0.5 + 0 * OWN.time, "aileron": OWN.angles[:, 0], "elevator": OWN.angles[:, 1]}
    with pytest.raises(InputError, match=r"acceleration.*; aileron and elevator are no rotors\): log body rates"):
        read(flat_log(OWN, rate=None, attitude=None, speed=asked))


def test_thrust_that_stays_at_nothing_is_no_flight():
    still = dict.fromkeys(("AOut", "RDes", "PDes", "YDes"), 0 * OWN.time)
    asked = named(np.degrees(OWN.rate @ FLIP), "R", "P", "Y")
    contents = logs.ardupilot(OWN, motors=0, more={"RATE": topic(OWN, 1, still | asked)})
    contents.topics["ATT"] |= {f"Des{name}": contents.topics["ATT"][name] for name in ("Roll", "Pitch", "Yaw")}
    with pytest.raises(InputError, match="stays at 0"):
        read(contents)


def test_a_cut_of_a_log_without_a_word_on_its_writer():
    """Outputs of its rate loop are known by their names."""
    output = named(logs.command(OWN, "ardupilot"), "ROut", "POut", "YOut")
    found = read(replace(logs.ardupilot(OWN, motors=10, more={"RATE": topic(OWN, 2, output)}), system=""))
    assert found.command_source == "output of the rate loop, RATE.ROut, POut, YOut"


def test_variables_of_an_event_on_the_card_of_a_crazyflie():
    """Neither followed nor compared, setpoints and outputs are known by what stands after the name of the event."""
    asked, acts = np.random.default_rng(4).standard_normal(OWN.rate.shape), logs.command(OWN, "ardupilot")
    columns = (
        named(np.degrees(OWN.rate), "gyro.x", "gyro.y", "gyro.z")
        | named(np.degrees(asked), "controller.rollRate", "controller.pitchRate", "controller.yawRate")
        | named(65536 * acts, "controller.cmd_roll", "controller.cmd_pitch", "controller.cmd_yaw")
    )
    found = read(LogContents({"fixedFrequency": topic(OWN, 1, columns)}, {}, {}, "Crazyflie uSD"))
    assert found.command_source.startswith("output of the rate loop, fixedFrequency.controller.cmd_roll")
    np.testing.assert_allclose(found.command[2:-2:2], on(found, acts)[2:-2:2], atol=5e-3)
    np.testing.assert_allclose(found.rate_setpoint[2:-2:2], on(found, asked * [1, 1, -1])[2:-2:2], atol=5e-3)


def test_output_in_counts_of_old_copters():
    acts = 4500 * logs.command(OWN, "ardupilot")
    output = topic(OWN, 2, named(acts, "ROut", "POut", "YOut") | {"AOut": 0.4 + 0.01 * np.sin(OWN.time)})
    found = read(logs.ardupilot(OWN, motors=10, more={"RATE": output}))
    assert found.command_source.startswith("output of the rate loop, RATE.ROut")
    np.testing.assert_allclose(found.command[2:-2:2], on(found, acts / 4500)[2:-2:2], atol=5e-3)


@pytest.mark.parametrize(("names", "source"), [("rpm{}", "speeds of rotors"), ("omcmd{}", "logged rotors")])
def test_speeds_of_rotors_act_by_their_squares(names, source):
    columns = dict(logs.plain(OWN).topics[""])
    speeds = [columns.pop(f"motor_cmd_{number}") * logs.FULL for number in range(1, 5)]
    factor = 30 / np.pi if "rpm" in names else 1.0
    columns |= {names.format(number): factor * own for number, own in enumerate(speeds, start=1)}
    found = read(logs.LogContents({"": columns}))
    assert found.command_source.startswith(source)
    # Shares of the largest speed, whatever that is.
    made = on(found, logs.command(OWN, ""))
    largest = np.quantile(np.array(speeds).max(axis=0), 0.999) / logs.FULL
    np.testing.assert_allclose(found.command, made / largest**2, atol=0.02)
    assert 0.3 < np.nanmedian(found.collective) < 1.0
    # So no throttle that hovers is known.
    assert found.relative
    assert hover_of(found).throttle is None
    assert not read(logs.plain(OWN)).relative


def test_a_torque_that_is_asked_for_acts():
    columns = dict(logs.plain(OWN).topics[""])
    columns = {name: own for name, own in columns.items() if not name.startswith("motor_cmd")}
    torque = logs.command(OWN, "") * [0.1, 0.1, 0.02] @ FLIP
    found = read(logs.LogContents({"": columns | named(torque, "torque_x", "torque_y", "torque_z")}))
    assert "shares of the largest" in found.command_source
    assert min(turning(found)) > 0.9
    assert np.abs(found.command).max() == pytest.approx(1.0)


def test_a_current_that_carries_no_vehicle_is_not_measured():
    battery = {"voltage_v": 16.0 - 0.01 * OWN.time, "voltage_filtered_v": 16.0 - 0.01 * OWN.time}
    for current, measured in ((0.1, False), (8.0, True)):
        own = battery | {"current_a": current + 0.02 * np.sin(OWN.time)}
        found = read(logs.px4(OWN, more={"battery_status": topic(OWN, 50, own)}))
        assert np.isfinite(found.current).any() == measured
        assert np.isfinite(found.voltage).any()


def test_cubic_keeps_what_lines_weaken():
    time, clock = np.arange(0, 4, 0.02), np.arange(1, 3, 0.005)
    slow = Samples(time, np.sin(2 * np.pi * 8 * time)[:, None])
    actual = np.sin(2 * np.pi * 8 * clock)
    lines, cubic = (on_clock(slow, clock, 1, cubic=each)[:, 0] for each in (False, True))
    assert np.std(cubic - actual) < 0.02 < 0.06 < np.std(lines - actual)


@pytest.mark.parametrize(("other", "factors"), [("speed", []), ("gyroADC[0]", [0.01])])
def test_a_plain_word_has_the_unit_of_a_kind_of_log_among_its_own_names_alone(other, factors):
    time = 0.01 * np.arange(500)
    fields = {"t": time, "baroAlt": 3 + np.sin(time), other: np.cos(time)}
    heights = [own.values[:, 0] for own in LookedLog({"": fields}, {}, "").found("height")]
    assert [own.tolist() for own in heights] == [(factor * fields["baroAlt"]).tolist() for factor in factors]


def test_samples_that_come_at_two_rates_leave_no_pause():
    """Every second stretch has a third of the rows: slower, and never silent."""
    contents = logs.WRITERS[""](OWN)
    kept = (OWN.time % 4.0 < 2.5) | (np.arange(len(OWN.time)) % 4 == 0)
    contents.topics[""] = {name: values[kept] for name, values in contents.topics[""].items()}
    gaps = read(contents).gaps_s
    assert len(gaps) > 100
    assert np.diff(gaps, axis=1).max() < 0.05
