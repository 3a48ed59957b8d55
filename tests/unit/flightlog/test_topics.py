"""Topics with clocks of their own, put on the clock of one: what is interpolated, what is held, what is absent."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.settings import ColumnMap, ImportSettings, SignalMap
from cpfls_cli.flightlog.topics import interpolate, on_one_clock, stamped_rates, topic_and_field

GYRO = 0.004 * np.arange(500)
SLOW = 0.001 + 0.02 * np.arange(100)


def between_samples(time):
    """Where a stamp lies between the first and the last of the slow topic; none falls on one of them."""
    return np.searchsorted(SLOW, time) % len(SLOW) > 0


def signals(**columns):
    units = {"quaternion": "1", "attitude": "deg", "body_torque": "N m", "body_rate": "rad/s", "voltage": "V"}
    return {name: SignalMap(columns=tuple(own), unit=units[name]) for name, own in columns.items()}


def put(topics, gap_s=0.1, time_column="gyro.timestamp", **columns):
    settings = ImportSettings(time_column=time_column, torque_source=None, gap_s=gap_s, signals=signals(**columns))
    columns, _, warnings = on_one_clock(topics, {}, settings)
    return columns, warnings


def gyro(**fields):
    return {"timestamp": GYRO, "x": np.sin(GYRO), "y": np.cos(GYRO), "z": 0 * GYRO} | fields


RATE = ("gyro.x", "gyro.y", "gyro.z")


@pytest.mark.parametrize(
    ("column", "parts"),
    [
        ("vehicle_attitude.q[0]", ("vehicle_attitude", "q[0]")),
        ("vehicle_attitude[0].q[0]", ("vehicle_attitude", "q[0]")),
        ("sensor_gyro[2].x", ("sensor_gyro[2]", "x")),
        ("esc_status.esc[1].esc_rpm", ("esc_status", "esc[1].esc_rpm")),
        ("t", ("t", "")),
    ],
)
def test_names_of_columns(column, parts):
    assert topic_and_field(column) == parts


def test_own_topic_is_taken_as_it_is():
    columns, warnings = put({"gyro": gyro()}, body_rate=RATE)
    np.testing.assert_array_equal(columns["gyro.x"], np.sin(GYRO))
    np.testing.assert_array_equal(columns["gyro.timestamp"], GYRO)
    assert warnings == ()


@pytest.mark.parametrize("drift", [-5e-4, 0.0, 5e-4])
def test_commands_of_a_hundred_times_a_second_stay_whatever_the_clock_and_its_rounding(drift):
    level = np.arange(190.0)
    stamps = np.round((1 + drift) * (0.001 + 0.01 * level) + 1e-3 * (level % 2), 6)
    topics = {"gyro": gyro(), "fast": {"timestamp": stamps} | dict.fromkeys("abc", level)}
    columns, _ = put(topics, body_rate=RATE, body_torque=("fast.a", "fast.b", "fast.c"))
    found = columns["fast.a"]
    assert set(found[np.isfinite(found)]) <= set(level)


def test_states_and_commands_that_are_logged_rarely_are_linear_and_fast_commands_stay():
    level = np.arange(250.0)
    # 50 times a second, and 125 times.
    slow = {"timestamp": SLOW} | dict.fromkeys("abc", level[:100])
    fast = {"timestamp": 0.001 + 0.008 * level} | dict.fromkeys("abc", level)
    topics = {"gyro": gyro(), "slow": slow, "fast": fast}
    names = ("slow.a", "slow.b", "slow.c")
    rare = put(topics, body_rate=RATE, body_torque=names)[0]["slow.a"]
    often = put(topics, body_rate=RATE, body_torque=("fast.a", "fast.b", "fast.c"))[0]["fast.a"]
    state = put(topics, attitude=names)[0]["slow.a"]
    inside = between_samples(GYRO)
    np.testing.assert_array_equal(often[inside], np.floor((GYRO[inside] - SLOW[0]) / 0.008 + 1e-9))
    for values in (rare, state):
        np.testing.assert_allclose(values[inside], (GYRO[inside] - SLOW[0]) / 0.02, atol=1e-9)
        assert np.isnan(values[~inside]).all()


def test_angles_and_quaternions_do_not_pass_through_their_jumps():
    yaw = 100 * SLOW
    half = np.deg2rad(yaw) / 2
    flips = np.where(np.arange(100) % 3, 1.0, -1.0)
    topics = {
        "gyro": gyro(),
        "angles": {"timestamp": SLOW, "r": 0 * SLOW, "p": 0 * SLOW, "y": (yaw + 180) % 360 - 180},
        "turn": {"timestamp": SLOW, "w": flips * np.cos(half), "z": flips * np.sin(half), "0": 0 * SLOW, "1": 0 * SLOW},
    }
    inside = between_samples(GYRO)
    angles = put(topics, attitude=("angles.r", "angles.p", "angles.y"))[0]["angles.y"]
    np.testing.assert_allclose(angles[inside], 100 * GYRO[inside], atol=1e-9)
    columns = put(topics, quaternion=("turn.w", "turn.0", "turn.1", "turn.z"))[0]
    turned = 2 * np.rad2deg(np.unwrap(np.arctan2(columns["turn.z"], columns["turn.w"])[inside]))
    np.testing.assert_allclose(turned - turned[0], 100 * (GYRO[inside] - GYRO[inside][0]), atol=0.05)


def test_instances_are_kept_apart():
    topics = {
        "gyro": gyro(),
        "bat": {"timestamp": SLOW, "v": 0 * SLOW + 12},
        "bat[1]": {"timestamp": SLOW, "v": 0 * SLOW + 7},
    }
    assert np.nanmax(put(topics, body_rate=RATE, voltage=("bat[1].v",))[0]["bat[1].v"]) == 7
    assert np.nanmax(put(topics, body_rate=RATE, voltage=("bat[0].v",))[0]["bat[0].v"]) == 12


def test_another_stamp_is_used_by_the_topics_that_have_it():
    late = {"timestamp": GYRO + 5.0, "timestamp_sample": GYRO}
    topics = {"gyro": gyro() | late, "slow": {"timestamp": SLOW + 5.0, "timestamp_sample": SLOW, "v": SLOW}}
    sampled = put(topics, time_column="gyro.timestamp_sample", body_rate=RATE, voltage=("slow.v",))[0]
    inside = np.isfinite(sampled["slow.v"])
    np.testing.assert_allclose(sampled["slow.v"][inside], GYRO[inside], atol=1e-12)
    assert inside.sum() > 480


def test_what_is_not_there_is_only_named():
    columns, _ = put({"gyro": gyro()}, body_rate=("gyro.x", "gyro.y", "other.z"))
    assert "other.z" not in columns
    assert columns["gyro.z"].size == 0


def test_the_clock_is_named_or_that_of_the_fastest_mapped_topic():
    slow = {"timestamp": SLOW, "a": SLOW, "b": SLOW, "c": SLOW, "d": SLOW}
    topics = {"slow": slow, "gyro": gyro(), "other": {"timestamp": np.linspace(0, 2, 9000)}}
    mapped = signals(quaternion=("slow.a", "slow.b", "slow.c", "slow.d"), body_rate=RATE)
    settings = ImportSettings(time_column=None, time_unit="ms", torque_source=None, signals=mapped)
    columns, chosen, _ = on_one_clock(topics, {}, settings)
    assert chosen.time_column == "gyro.timestamp"
    np.testing.assert_allclose(columns["gyro.timestamp"], 1e3 * GYRO)
    with pytest.raises(
        InputError,
        match=r"'t': in this log every topic has its own stamps; name those of the fastest mapped one, such as "
        r"gyro\.timestamp, or null for them; the log has the topics gyro, other, slow;",
    ):
        on_one_clock(topics, {}, replace(settings, time_column="t"))
    with pytest.raises(
        InputError, match=r"import\.signals: the log has none of the mapped topics; the log has the topics other;"
    ):
        on_one_clock({"other": topics["other"]}, {}, settings)


def test_a_flat_log_is_on_one_clock_and_must_be_said_which_column_it_is():
    flat = {"": {"t": np.array([1.0, 2.0]), "v": np.array([3.0, 4.0])}}
    settings = ImportSettings(time_unit="ms", torque_source=None, signals=signals(voltage=("v",), body_rate=RATE))
    assert on_one_clock(flat, {}, settings)[0]["t"].tolist() == [1.0, 2.0]
    assert on_one_clock(flat, {"t": "s"}, settings)[0]["t"].tolist() == [1e3, 2e3]
    with pytest.raises(InputError, match=r"name the column of its stamps; the log has the columns t, v; `cpfls"):
        on_one_clock(flat, {}, replace(settings, time_column=None))


def test_rows_that_come_evenly_need_no_stamps():
    flat = {"": {"v": np.array([3.0, 4.0, 5.0])}}
    settings = ImportSettings(
        time_column="row / 50", torque_source=None, signals=signals(voltage=("v",), body_rate=RATE)
    )
    assert on_one_clock(flat, {}, settings)[0]["row / 50"].tolist() == [0.0, 0.02, 0.04]
    assert on_one_clock(flat, {}, replace(settings, time_unit="ms"))[0]["row / 50"].tolist() == [0.0, 20.0, 40.0]
    assert on_one_clock(flat, {}, replace(settings, time_column="row/50"))[0]["row/50"].tolist() == [0.0, 0.02, 0.04]
    assert "row / 0" not in on_one_clock(flat, {}, replace(settings, time_column="row / 0"))[0]


def test_the_first_map_is_taken_whose_columns_are_all_there():
    old = ColumnMap(columns=("old.x", "old.y", "old.z"), unit="deg/s", scale=2.0)
    older = ColumnMap(columns=("older[0].x", "older.y", "older.z"), unit="rpm")
    mapped = {"body_rate": SignalMap(columns=RATE, unit="rad/s", required=False, otherwise=(old, older))}
    settings = ImportSettings(time_column=None, torque_source=None, signals=mapped)
    partly = {field: values for field, values in gyro().items() if field != "z"}

    def chosen(**topics):
        return on_one_clock(topics, {}, settings)[1].signals["body_rate"]

    first = SignalMap(columns=RATE, unit="rad/s", required=False)
    assert chosen(gyro=gyro(), old=gyro(), older=gyro()) == first
    assert chosen(gyro=partly, old=gyro(), older=gyro()) == replace(first, columns=old.columns, unit="deg/s", scale=2.0)
    assert chosen(gyro=partly, older=gyro()) == replace(first, columns=older.columns, unit="rpm")
    assert chosen(gyro=partly) == mapped["body_rate"]


def test_it_is_said_which_columns_stand_in():
    old = ColumnMap(columns=("old.x", "old.y", "old.z"), unit="deg/s")
    mapped = {"body_rate": SignalMap(columns=RATE, unit="rad/s", otherwise=(old,))}
    settings = ImportSettings(time_column=None, torque_source=None, signals=mapped)
    assert on_one_clock({"gyro": gyro(), "old": gyro()}, {}, settings)[2] == ()
    answer = "body_rate is taken from old.x, old.y, old.z: the log lacks some of gyro.x and its kind"
    assert on_one_clock({"old": gyro()}, {}, settings)[2] == (answer,)
    flat = {"": {"t": GYRO} | dict.fromkeys(old.columns, GYRO)}
    assert on_one_clock(flat, {}, replace(settings, time_column="t"))[2] == (answer,)


def test_signals_that_a_log_may_lack_are_left_out_where_they_say_nothing():
    slow = {"timestamp": np.arange(3.0), "v": np.array([1.0, 2.0, 3.0])}
    dead = {"timestamp": GYRO} | dict.fromkeys("abcd", np.where(GYRO > 1, 0.0, np.nan))
    alive = dead | {"d": GYRO}
    mapped = signals(body_rate=RATE) | {
        "voltage": SignalMap(columns=("bat[0].v",), unit="V", required=False),
        "rotor_speed": SignalMap(columns=("esc.a", "esc.b", "esc.c", "esc.d"), unit="rpm", required=False),
    }
    settings = ImportSettings(time_column=None, torque_source=None, signals=mapped)
    columns, _, warnings = on_one_clock({"gyro": gyro(), "bat": slow, "esc": dead}, {}, settings)
    assert not {"bat.v", "bat[0].v", "esc.a", "esc.d"} & columns.keys()
    assert warnings == (
        "signal voltage is left out: topic bat has a sample only every 1 s (median), longer than import.gap_s = 0.1",
        "signal rotor_speed is left out: its columns are 0 or absent throughout",
    )
    # One that moves is a vehicle with motors that stand.
    assert on_one_clock({"gyro": gyro(), "esc": alive}, {}, settings)[2] == ()


def test_maps_that_stand_in_for_each_other_have_one_number_of_columns_and_one_kind_of_unit():
    def command(unit, *columns):
        mapped = SignalMap(columns=("a", "b"), unit="1", otherwise=(ColumnMap(columns=columns, unit=unit),))
        return ImportSettings(torque_source=None, signals={"rotor_command": mapped})

    assert command("1", "c", "d").mapped_columns == ("t", "a", "b", "c", "d")
    with pytest.raises(SettingError, match="needs 2 columns, got 1") as caught:
        command("1", "c")
    assert caught.value.key == "signals.rotor_command.otherwise.0.columns"
    with pytest.raises(SettingError, match=r"'us' is not a unit of it; use one of 1$"):
        command("us", "c", "d")


def test_topic_that_is_too_slow_is_named():
    slow = {"timestamp": np.arange(10.0), "v": np.arange(10.0)}
    with pytest.raises(InputError, match=r"topic slow has a sample only every 1 s \(median\).* import.gap_s = 0.1"):
        put({"gyro": gyro(), "slow": slow}, body_rate=RATE, voltage=("slow.v",))


def test_clock_that_is_too_slow_is_warned_of():
    topics = {"gyro": gyro(), "slow": {"timestamp": SLOW, "v": SLOW}}
    _, warnings = put(topics, time_column="slow.timestamp", body_rate=RATE, voltage=("slow.v",))
    assert len(warnings) == 1
    assert warnings[0].startswith("topic gyro (250 Hz) is downsampled to the clock of slow (50 Hz)")


@pytest.mark.parametrize("between", [interpolate, partial(interpolate, hold=True)])
def test_pauses_are_absent_and_absent_values_are_passed_over(between):
    time = np.array([0.0, 0.1, 0.2, 0.9, 1.0, 1.1])
    values = np.array([1.0, np.nan, 3.0, 4.0, 5.0, 5.0])
    result = between(time, values, np.array([-0.05, 0.0, 0.1, 0.2, 0.3, 0.9, 0.95, 1.1, 1.2]), 0.2)
    np.testing.assert_array_equal(np.isnan(result), [True, False, False, False, True, False, False, False, True])
    assert result[2] == (2.0 if between is interpolate else 1.0)
    assert result[6] == pytest.approx(4.5 if between is interpolate else 4.0, abs=1e-9)


@pytest.mark.parametrize("between", [interpolate, partial(interpolate, hold=True)])
def test_stamps_that_go_back_or_repeat_are_passed_over_and_nothing_gives_nothing(between):
    time = np.array([0.0, 0.1, 0.1, 0.05, 0.2])
    values = np.array([0.0, 1.0, 9.0, 9.0, 2.0])
    np.testing.assert_allclose(between(time, values, np.array([0.1, 0.2]), 1.0), [1.0, 2.0])
    assert np.isnan(between(time, np.full(5, np.nan), time, 1.0)).all()


def test_how_often_a_signal_was_logged_is_counted_by_the_stamps_of_its_topic():
    kept = np.array([0.0, 0.3, 0.6, 1.2, 1.5, 1.8, 2.4, 3.0])
    topics = {"gyro": gyro(), "battery": {"timestamp": kept, "v": kept}}
    settings = ImportSettings(
        time_column=None, torque_source=None, signals=signals(body_rate=RATE, voltage=["battery.v"])
    )
    assert stamped_rates(topics, settings) == pytest.approx({"body_rate": 250, "voltage": 7 / 3})
    assert stamped_rates({"": {"gyro.x": GYRO}}, settings) == {}


def test_a_pause_makes_no_topic_slow():
    flown = np.arange(0.0, 20.0, 0.1)
    kept = np.concatenate([flown, 648.0 + flown])
    settings = ImportSettings(time_column=None, torque_source=None, signals=signals(voltage=["battery.v"]))
    assert stamped_rates({"battery": {"timestamp": kept, "v": kept}}, settings) == pytest.approx({"voltage": 10})


def test_stamps_of_a_topic_that_scatter_become_regular_and_its_signals_with_them():
    time = 0.01 * np.arange(2000)
    late = np.random.default_rng(0).exponential(1e-3, len(time))
    motion = {name: np.sin(rate * time) for name, rate in zip("xyz", (3.0, 7.0, 11.0), strict=True)}
    clean = {"timestamp": 0.004 * np.arange(5000), "q": np.ones(5000)}
    columns, warnings = put({"gyro": {"timestamp": time + late} | motion, "other": clean}, body_rate=RATE)
    assert warnings[0].startswith("stamps of topic gyro scatter by 1 ms about a regular clock of 100 Hz, along which")
    assert np.diff(columns["gyro.timestamp"]).std() < 0.1 * np.diff(late).std()
    np.testing.assert_array_equal(columns["gyro.x"], motion["x"])
