"""A path for autopilots: CSV as it is flown, a plan as QGroundControl reads it, parameters as ground stations do."""

import json
from dataclasses import replace
from math import cos, degrees, pi, radians, tan

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.export.mission import Home, qgc_plan, system_id_lines, waypoint_lines
from cpfls_cli.flights.path import Excited, PlannedPath
from cpfls_cli.gap.next_flight.room import harmonic_trajectory, random_path
from cpfls_cli.simulation.inverse import flyability, room_left
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import plan, repeated
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings, WaypointSettings
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = VehicleSettings()
GRAVITY = VEHICLE.gravity_m_s2
HOME = Home(47.3977, 8.5456, 20.0)
POINTS = tuple(
    WaypointSettings(position_m=at, yaw_rad=yaw)
    for at, yaw in (((0, 0, 0), 0.0), ((30, 0, 0), pi / 2), ((30, 40, 5), pi))
)
SQUARE = TrajectorySettings(
    path="waypoints", waypoints=POINTS, duration_s=None, pause_s=3.0, sample_time_s=0.05, repeat=3, repeat_pause_s=6.0
)


def path_of(planned, settings, **more):
    return PlannedPath.of(planned, flyability(vars(planned), VEHICLE, settings.tilt_max_rad), settings, **more)


def excited(settings):
    path = plan(settings, GRAVITY)
    room = room_left(path, added_motion(settings.excite, path, GRAVITY), settings, VEHICLE)
    flown, without = (repeated(each, settings, GRAVITY) for each in (room.added.onto(path, GRAVITY), path))
    return path_of(flown, settings, excited=Excited.of(settings.excite, flown, without, room))


@pytest.fixture(scope="module")
def square():
    return path_of(repeated(plan(SQUARE, GRAVITY), SQUARE, GRAVITY), SQUARE)


@pytest.fixture(scope="module")
def shaken():
    asked = ExciteSettings(axes=("roll", "vertical"), band_hz=(0.5, 2.0), size_rad=0.05)
    return excited(TrajectorySettings(path="hover", duration_s=20.0, repeat=2, excite=asked))


def table(text):
    head, *rows = text.splitlines()
    values = np.array([[float(value) for value in row.split(",")] for row in rows])
    return dict(zip(head.split(","), values.T, strict=True))


def test_the_csv_is_the_path_ten_times_a_second(square):
    columns = table(waypoint_lines(square))
    assert list(columns) == ["time_s", "x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"]
    np.testing.assert_allclose(np.diff(columns["time_s"]), 0.1, atol=1e-6)
    np.testing.assert_allclose(columns["y_m"], square.position[::2, 1], atol=1e-6)


def test_the_csv_of_an_excitation_has_what_is_added_and_resolves_it(shaken):
    columns = table(waypoint_lines(shaken))
    assert np.diff(columns["time_s"]).max() <= 1 / (20 * 2.0) + 1e-6
    step = round(columns["time_s"][1] / shaken.time[1])
    np.testing.assert_allclose(columns["roll_added_rad"], shaken.attitude[::step, 0], atol=1e-6)
    np.testing.assert_allclose(columns["az_added_m_s2"], columns["az_m_s2"], atol=1e-6)
    np.testing.assert_allclose(columns["roll_rad"], columns["roll_added_rad"], atol=1e-6)
    assert np.abs(columns["az_m_s2"]).max() == pytest.approx(GRAVITY * tan(0.05), rel=0.02)
    assert not columns["pitch_added_rad"].any()


def on_earth(latitude, longitude):
    """Metres east and north of home, on a sphere of the earth's size: right to 0.4 %."""
    metre = 6371e3 * pi / 180
    return (longitude - HOME.longitude) * metre * cos(radians(HOME.latitude)), (latitude - HOME.latitude) * metre


def test_the_plan_has_what_qgroundcontrol_asks_for(square):
    """Keys and kinds that its PlanMasterController, MissionController and SimpleMissionItem refuse to miss."""
    document = json.loads(qgc_plan(square, HOME))
    assert (document["fileType"], document["version"]) == ("Plan", 1)
    assert document["groundStation"] == "QGroundControl"
    assert document["geoFence"] == {"circles": [], "polygons": [], "version": 2}
    assert document["rallyPoints"] == {"points": [], "version": 2}
    mission = document["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 12, 2)
    assert mission["plannedHomePosition"][:2] == [HOME.latitude, HOME.longitude]
    for number, item in enumerate(mission["items"], start=1):
        assert (item["doJumpId"], item["type"]) == (number, "SimpleItem")
        assert item["autoContinue"] is True
        assert isinstance(item["command"], int)
        assert len(item["params"]) == 7
        placed = item["command"] in (16, 22)
        assert item["frame"] == (3 if placed else 2)
        assert placed == ("Altitude" in item)
        assert not placed or item["AltitudeMode"] == 1


def test_the_plan_flies_the_runs_from_point_to_point(square):
    items = json.loads(qgc_plan(square, HOME))["mission"]["items"]
    assert [items[0]["command"], items[1]["command"], items[-1]["command"]] == [22, 178, 20]
    assert items[1]["params"][1] == pytest.approx(np.linalg.norm(square.velocity, axis=1).max(), abs=1e-3)
    points = items[2:-1]
    # Three runs of three points: the way back ends where the next begins.
    corners = [point.position_m for point in POINTS]
    assert len(points) == 9
    for item, (x, y, z) in zip(points, corners * 3, strict=True):
        hold, _, _, _, latitude, longitude, height = item["params"]
        east, north = on_earth(latitude, longitude)
        assert (east, north) == pytest.approx((x, y), rel=5e-3, abs=0.02)
        assert height == item["Altitude"] == pytest.approx(HOME.height + z)
        assert hold >= 1.0
    assert points[1]["params"][0] == pytest.approx(3.0, abs=1e-3)
    assert points[3]["params"][0] >= 6.0
    # East is 90 degrees of the compass; yaw counts from it the other way round.
    assert [item["params"][3] for item in points[:3]] == pytest.approx([90.0, 0.0, 270.0], abs=1e-3)
    runs = [[item["params"] for item in points[3 * run : 3 * run + 3]] for run in (1, 2)]
    np.testing.assert_allclose(np.array(runs[0])[:2, 4:], np.array(runs[1])[:2, 4:], atol=1e-9)


def test_a_plan_that_no_mission_flies_is_refused(square, shaken):
    with pytest.raises(InputError, match="holds no excitation"):
        qgc_plan(shaken, HOME)
    below = replace(square, position=square.position - [0, 0, 4.0])
    with pytest.raises(InputError, match=r"0\.5 m above take-off is too low: the path descends to -3\.5 m"):
        qgc_plan(below, Home(0.0, 0.0, 0.5))
    curve = harmonic_trajectory(random_path(10.0, 1.0, 5, np.random.default_rng(1)).scaled(0.1), 0.02, GRAVITY)
    with pytest.raises(InputError, match="this path is a curve"):
        qgc_plan(path_of(curve, SQUARE), HOME)


def parameters(text):
    """Read a parameter file as ground stations do: comments, then a name and a number, a comma or space between."""
    pairs = [line.replace(",", " ").split() for line in text.splitlines() if line and not line.startswith("#")]
    assert all(len(pair) == 2 for pair in pairs)
    assert all(len(name) <= 16 and name.isupper() for name, _ in pairs)
    return {name: float(value) for name, value in pairs}


# Of ArduPilot's documentation: least, most.
RANGES = {
    "SID_AXIS": (0, 19), "SID_F_START_HZ": (0.01, 100), "SID_F_STOP_HZ": (0.01, 100), "SID_T_FADE_IN": (0, 20),
    "SID_T_REC": (0, 255), "SID_T_FADE_OUT": (0, 5),
}  # fmt: skip


def chirp_of(given, time):
    """ArduPilot's waveform: it holds the lowest frequency for two periods, then sweeps to the end of the record."""
    start, stop, record = given["SID_F_START_HZ"], given["SID_F_STOP_HZ"], given["SID_T_REC"]
    held = 2 / start
    ratio = np.log(stop / start)
    share = (time - held) / (record - held)
    swept = 2 * pi * start * (record - held) / ratio * (np.exp(ratio * share) - 1)
    phase = np.where(time <= held, 2 * pi * start * (time - held), swept)
    rise = np.clip(time / given["SID_T_FADE_IN"], 0, 1)
    fall = np.clip((record - time) / given["SID_T_FADE_OUT"], 0, 1)
    return given["SID_MAGNITUDE"] * np.sin(phase) * (0.5 - 0.5 * np.cos(pi * rise)) * (0.5 - 0.5 * np.cos(pi * fall))


def test_parameters_keep_to_the_ranges_of_ardupilot_and_sweep_the_band(shaken):
    given = parameters(system_id_lines(shaken.excited, "roll", 20.0, 0.3))
    assert set(given) == {*RANGES, "SID_MAGNITUDE"}
    for name, (least, most) in RANGES.items():
        assert least <= given[name] <= most
    assert (given["SID_AXIS"], given["SID_T_REC"]) == (7, 20.0)
    # A rate in deg/s which at the lowest frequency turns by the size.
    time = np.arange(0, 20.0, 0.0025)
    rate = chirp_of(given, time)
    angle = np.cumsum(rate) * 0.0025
    assert np.abs(angle - angle.mean()).max() == pytest.approx(degrees(shaken.excited.size_rad[0]), rel=0.15)
    power = np.abs(np.fft.rfft(rate)) ** 2
    frequency = np.fft.rfftfreq(len(time), 0.0025)
    assert power[(frequency > 0.3) & (frequency < 2.2)].sum() > 0.98 * power.sum()


def test_thrust_is_a_share_of_the_largest(shaken):
    given = parameters(system_id_lines(shaken.excited, "vertical", 20.0, 0.3))
    assert given["SID_AXIS"] == 13
    assert given["SID_MAGNITUDE"] == pytest.approx(0.3 * tan(shaken.excited.size_rad[1]), rel=1e-5)


@pytest.mark.parametrize(
    ("run", "words"), [(300.0, "SID_T_REC allows 255 at most"), (3.0, "holds 0.5 Hz for 4 s before it sweeps")]
)
def test_what_ardupilot_does_not_take_is_refused(shaken, run, words):
    with pytest.raises(InputError, match=words):
        system_id_lines(shaken.excited, "roll", run, 0.3)
