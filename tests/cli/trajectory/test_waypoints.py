"""Waypoints, and vehicles that are held."""

import json
import re

import h5py
import numpy as np
import pytest

from tests.builders.studies import VEHICLE, put_file

LIMITED = ("--set", "trajectory.limits={velocity_m_s: 4, acceleration_m_s2: 3, jerk_m_s3: 6, pop_m_s6: 300}")
FREE = ("--set", "trajectory.duration_s=null")


@pytest.fixture
def config(tmp_path):
    return put_file(tmp_path / "study.yaml", "trajectory: {sample_time_s: 0.05, yaw_turn_rad: 1.0}\n" + VEHICLE)


@pytest.fixture
def points(tmp_path):
    return put_file(tmp_path / "points.csv", "x_m,y_m,z_m,yaw_rad,pause_s\n1,2,3,0,9\n11,2,3,1.5,2\n11,12,8,-0.5,1\n")


def position(path):
    with h5py.File(path) as file:
        return file["time"][:], file["position"][:], file["yaw"][:]


def test_every_waypoint_is_reached_at_rest(cpfls, tmp_path, config, points):
    first, second = cpfls.summary(
        "trajectory", config, "--waypoints", points, "-o", tmp_path / "t.h5", *LIMITED, *FREE
    )["legs"]
    time, place, yaw = position(tmp_path / "t.h5")
    np.testing.assert_allclose(place[0], [1, 2, 3])
    # The pause of the first point comes before the first leg, that of the last one after the last leg.
    assert first["begin_s"] == pytest.approx(9.0)
    assert second["begin_s"] == pytest.approx(9.0 + first["duration_s"] + 2.0)
    assert time[-1] == pytest.approx(second["begin_s"] + second["duration_s"] + 1.0, abs=0.051)
    resting = (time > 9.0 + first["duration_s"]) & (time < second["begin_s"])
    np.testing.assert_allclose(place[resting], [[11, 2, 3]] * resting.sum(), atol=1e-12)
    np.testing.assert_allclose(yaw[resting], 1.5, atol=1e-12)
    np.testing.assert_allclose([*place[-1], yaw[-1]], [11, 12, 8, -0.5], atol=1e-12)


def test_limits_hold_and_are_named(cpfls, tmp_path, config, points):
    result = cpfls.done("trajectory", config, "--waypoints", points, "-o", tmp_path / "t.h5", "-v", *LIMITED, *FREE)
    assert re.search(r"^1 +9 +[\d.]+ +10 +.*pop", result.stdout, re.MULTILINE)
    with h5py.File(tmp_path / "t.h5") as file:
        assert "pop" in [each.decode() for each in file["legs/limited_by/values"]]
        for name, limit in (("velocity", 4), ("acceleration", 3), ("jerk", 6), ("pop", 300)):
            assert np.linalg.norm(file[name][:], axis=1).max() <= limit * (1 + 1e-12)


def test_config_and_file_give_the_same_path(cpfls, tmp_path, config, points):
    rows = [line.split(",") for line in points.read_text().splitlines()[1:]]
    stated = ", ".join(f"{{position_m: [{x}, {y}, {z}], yaw_rad: {a}, pause_s: {p}}}" for x, y, z, a, p in rows)
    from_file = cpfls("trajectory", config, "--waypoints", points, "-o", tmp_path / "f.h5", *FREE)
    from_config = cpfls(
        *("trajectory", config, "-o", tmp_path / "c.h5", *FREE, "--set", "trajectory.path=waypoints"),
        *("--set", f"trajectory.waypoints=[{stated}]"),
    )
    assert (from_file.exit_code, from_config.exit_code) == (0, 0), from_config.output
    for mine, other in zip(position(tmp_path / "f.h5"), position(tmp_path / "c.h5"), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_each_axis_goes_where_it_is_to_go_forwards_or_backwards(cpfls, tmp_path, config):
    places = np.array([[5, 1, 1], [-2, 1, 4], [-2, 30, 4], [7, -20, 3]], dtype=float)
    path = tmp_path / "zigzag.csv"
    path.write_text("x_m,y_m,z_m\n" + "\n".join(",".join(map(str, place)) for place in places) + "\n")
    asked = ("--set", "trajectory.coordination=each-axis", "--set", "trajectory.displacement_measure=per-axis")
    uneven = (
        "--set",
        "trajectory.limits={velocity_m_s: [4, 3, 2], acceleration_m_s2: 3, snap_m_s4: 20, pop_m_s6: 300}",
    )
    result = cpfls.done(
        *("trajectory", config, "--waypoints", path, "-o", tmp_path / "t.h5", *uneven, *FREE, *asked, "--json"),
        *("--set", "trajectory.pause_s=1"),
    )
    time, place, _ = position(tmp_path / "t.h5")
    for leg, end in zip(json.loads(result.stdout)["legs"], places[1:], strict=True):
        resting = (time > leg["begin_s"] + leg["duration_s"]) & (time < leg["begin_s"] + leg["duration_s"] + 0.9)
        np.testing.assert_allclose(place[resting], np.tile(end, (resting.sum(), 1)), atol=1e-12)
        assert resting.any() or end is places[-1]
    np.testing.assert_allclose(place[-1], places[-1], atol=1e-12)
    with h5py.File(tmp_path / "t.h5") as file:
        assert (np.abs(file["velocity"][:]).max(axis=0) <= np.array([4, 3, 2]) * (1 + 1e-12)).all()
        steps = np.abs(np.diff(place, axis=0)).max(axis=0)
    assert (steps <= np.array([4, 3, 2]) * 0.05 * (1 + 1e-9)).all()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x_m,y_m\n0,0\n1,1\n", "column 'z_m' is missing; waypoints need x_m, y_m, z_m"),
        ("x_m,y_m,z_m,yaw_deg\n0,0,0,0\n1,1,1,1\n", "column 'yaw_deg' is not known; did you mean yaw_rad?"),
        ("x_m,y_m,z_m\n0,0,0\n", "holds 1; a path needs two or more"),
        ("x_m,y_m,z_m\n0,0,0\n0,0,0\n", ":3: x_m, y_m, z_m: repeats the point before"),
        ("x_m,y_m,z_m\n0,0,0\n0,nan,1\n", ":3: column 'y_m' is empty or not a number: give a finite number"),
        ("x_m,y_m,z_m\n0,0,0\n0,inf,1\n", ":3: column 'y_m' = inf: give a finite number"),
        ("x_m,y_m,z_m,pause_s\n0,0,0,-1\n0,0,1,0\n", ":2: column 'pause_s' = -1: give a finite number, 0 or more"),
        ("x_m,y_m,z_m\n0,0,0\n0,far,1\n", ":3: column 'y_m' = 'far': not a number"),
        ("x_m,y_m,z_m\n\n0,0,0\n\n1,,0\n", ":5: column 'y_m' is empty or not a number"),
        ("x_m,y_m,z_m\n\n0,0,0\n\n0,0,0\n", ":5: x_m, y_m, z_m: repeats the point before"),
    ],
)
def test_bad_files_are_refused(refuse, tmp_path, config, text, complaint):
    path = put_file(tmp_path / "bad.csv", text)
    (message,) = refuse("trajectory", config, "--waypoints", path, "-o", tmp_path / "t.h5")
    assert message.startswith(str(path))
    assert complaint in message


def test_waypoints_without_points_are_refused(refuse, tmp_path, config):
    (message,) = refuse("trajectory", config, "-o", tmp_path / "t.h5", "--set", "trajectory.path=waypoints")
    assert message.startswith("trajectory.waypoints = []: a path needs two or more points")


def test_a_duration_too_short_for_the_file_is_refused(refuse, tmp_path, config):
    path = put_file(tmp_path / "far.csv", "x_m,y_m,z_m\n0,0,0\n30,0,0\n0,0,0\n30,0,0\n0,0,0\n")
    assert refuse("trajectory", config, "--waypoints", path, "-o", tmp_path / "t.h5") == [
        "trajectory.duration_s = 54.86: 4 moves take 64 s; raise it, or set it to null for as long as they take"
    ]


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("limits.velocity_m_s", "-1", "greater than 0"),
        ("limits.velocity_m_s", "0", "greater than 0"),
        ("limits.velocity_m_s", ".inf", "finite"),
        ("limits.velocity_m_s", "[1, 2]", "3"),
        ("limits.velocty_m_s", "1", "did you mean 'velocity_m_s'?"),
        ("displacement_m", "0", "must be greater than 0"),
        ("limits", "{velocity_m_s: 1}", "the snap unlimited"),
    ],
)
def test_bad_limits_name_their_key(refuse, tmp_path, config, key, value, complaint):
    (message,) = refuse("trajectory", config, "-o", tmp_path / "t.h5", "--set", f"trajectory.{key}={value}")
    assert f"trajectory.{key.split('=')[0]}" in message
    assert complaint in message


def test_more_than_the_rotors_give_is_refused_with_time_and_place(refuse, tmp_path, config):
    weak = ("--set", "vehicle.rotor_speed_max_rad_s=350")
    messages = refuse("trajectory", config, "-o", tmp_path / "t.h5", *weak, code=1)
    assert messages[0].startswith("thrust of up to 66.51")
    assert " N at 4.00 s, at x y z = " in messages[0]
    assert "M1: above the limit asked for at " in messages[1]
    assert messages[-1].endswith("set trajectory.infeasible: report")


def test_tilt_beyond_its_limit_is_refused_or_reported(cpfls, refuse, tmp_path, config):
    steep = ("trajectory", config, "-o", tmp_path / "t.h5", "--set", "trajectory.tilt_max_rad=0.1")
    assert refuse(*steep, code=1)[0].startswith("tilt of up to 0.18")
    assert "tilt of up to 0.18" in cpfls.done(*steep, "--set", "trajectory.infeasible=report").stderr


def test_a_turn_in_yaw_that_is_too_fast_is_named(refuse, tmp_path, config):
    near = put_file(tmp_path / "near.csv", "x_m,y_m,z_m\n0,0,0\n3,0,0\n")
    turn = ("--set", "trajectory.yaw_turn_rad=6.28")
    messages = refuse(
        "trajectory", config, "--waypoints", near, "-o", tmp_path / "t.h5", *LIMITED, *FREE, *turn, code=1
    )
    assert "it is the turn in yaw: lower trajectory.yaw_turn_rad = 6.28" in messages[-1]


def test_a_turn_between_points_that_is_too_fast_is_named(refuse, tmp_path, config):
    points = "[{position_m: [0,0,0], yaw_rad: 0}, {position_m: [60,0,0], yaw_rad: 40}]"
    asked = ("--set", "trajectory.path=waypoints", "--set", f"trajectory.waypoints={points}")
    messages = refuse("trajectory", config, "-o", tmp_path / "t.h5", *asked, code=1)
    assert "it is the turn in yaw: lower trajectory.waypoints: their yaw_rad" in messages[-1]


def test_what_lies_between_two_samples_is_checked_too(refuse, tmp_path, config):
    keys = ("period_s=0.1", "duration_s=8", "path=straight", "direction=[1, 0, 0]", "yaw_turn_rad=0")
    coarse = ("displacement_m=0.64", "sample_time_s=0.8", "tilt_max_rad=0.15")
    asked = [word for key in keys + coarse for word in ("--set", f"trajectory.{key}")]
    messages = refuse("trajectory", config, "-o", tmp_path / "t.h5", *asked, code=1)
    # A hundredth of the printed displacement in a tenth of the period has the printed 2 m/s^2: arctan(2 / 9.81).
    assert messages[0].startswith("tilt of up to 0.2011 rad")


def test_a_move_too_short_to_be_looked_at_is_refused(refuse, tmp_path, config):
    short = ("--set", "trajectory.period_s=1e-5", "--set", "trajectory.displacement_m=1e-12")
    (message,) = refuse("trajectory", config, "-o", tmp_path / "t.h5", *short)
    assert "trajectory.sample_time_s = 0.05: moves have parts of 1e-05 s" in message


def test_a_file_replaces_a_path_that_could_not_be_planned(cpfls, tmp_path, config, points):
    replaced = ("--set", "trajectory.path=optimised")
    cpfls.done("trajectory", config, "--waypoints", points, "-o", tmp_path / "t.h5", *LIMITED, *FREE, *replaced)


def test_a_dry_run_finds_what_the_plan_would(refuse, tmp_path, config):
    far = put_file(tmp_path / "far.csv", "x_m,y_m,z_m\n0,0,0\n30,0,0\n0,0,0\n30,0,0\n0,0,0\n")
    (message,) = refuse("trajectory", config, "--waypoints", far, "-o", tmp_path / "t.h5", "--dry-run")
    assert "4 moves take 64 s" in message
    weak = ("--set", "vehicle.rotor_speed_max_rad_s=350")
    assert refuse("trajectory", config, "-o", tmp_path / "t.h5", "--dry-run", *weak, code=1)


def test_a_given_period_that_decides_alone_is_named(cpfls, tmp_path, config):
    loose = ("--set", "trajectory.limits.pop_m_s6=100", "--set", "trajectory.period_s=1")
    result = cpfls("trajectory", config, "-o", tmp_path / "t.h5", "-v", *loose)
    assert re.search(r"^1 +0 +16 +64 +period$", result.stdout, re.MULTILINE)
    assert "integral of |jerk| by move, m/s^2: 8, 8, 8" in result.stdout


@pytest.mark.usefixtures("drawn")
def test_plot_draws_both_figures(cpfls, refuse, tmp_path, config):
    cpfls.done("trajectory", config, "-o", tmp_path / "t.h5", "--plot")
    for name, words in (("derivatives", ["pop", "crackle", "displacement"]), ("attitude", ["roll", "pitch"])):
        drawn = (tmp_path / f"t-{name}.svg").read_text()
        assert all(f">{word}</" in drawn for word in words)
    (tmp_path / "t.h5").unlink()
    (message,) = refuse("trajectory", config, "-o", tmp_path / "t.h5", "--plot")
    assert message.endswith("t-derivatives.svg: exists already; --force replaces it")


@pytest.mark.parametrize("option", [("--box", "1,1,1"), ("--height", "3")])
def test_room_for_a_path_that_is_not_planned_for_it_is_refused(refuse, tmp_path, config, option):
    (line,) = refuse("trajectory", config, "-o", tmp_path / "path.h5", *option)
    assert line.startswith(f"{option[0]} {option[1]}")
    assert "is room for the flight that --separate or --for plans" in line


HELD = """\
seed: {seed}
trajectory: {{path: {path}, duration_s: 12.0, sample_time_s: 0.05, rotation: {{starts: 2, iterations: 3}}}}
reduction: {{size: 60}}
identification:
  input_map: full-circle
  consequents: harmonic
  harmonic_order: 2
  products: tensor
  membership_functions: 1
  base: none
"""


@pytest.fixture
def study(tmp_path):
    def write(path="full-rotation", seed=1):
        config = tmp_path / f"{path}-{seed}.yaml"
        config.write_text(HELD.format(path=path, seed=seed) + VEHICLE.replace("[0.6, 0.6, 1.2]", "[0.06, 0.05, 0.08]"))
        return config

    return write


@pytest.mark.usefixtures("drawn")
def test_a_held_vehicle_has_no_position(cpfls, tmp_path, study):
    planned = cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5", "--plot")
    assert "held at its centre of mass" in planned.stdout
    assert ">yaw</" in (tmp_path / "t-rotation.svg").read_text()
    with h5py.File(tmp_path / "t.h5") as file:
        assert "position" not in file
        turned = np.ptp(file["attitude"][:], axis=0)
    assert turned.min() > np.pi
    cpfls.done("check", tmp_path / "t.h5")
    cpfls.done("report", study(), tmp_path / "t.h5", "-o", tmp_path / "r.html")


def test_optimised_says_what_the_path_is_worth(cpfls, tmp_path, study):
    summary = cpfls.summary("trajectory", study("optimised"), "-o", tmp_path / "t.h5")
    assert summary["condition_number"] <= summary["random"]["best"] <= summary["random"]["median"]
    assert summary["evaluations"] == 5


@pytest.mark.usefixtures("sketched")
def test_a_model_learned_on_full_rotations_holds_on_another_one(cpfls, tmp_path, study):
    for seed in (1, 2):
        t, f = tmp_path / f"t{seed}.h5", tmp_path / f"f{seed}.h5"
        cpfls.done("trajectory", study(seed=seed), "-o", t)
        cpfls.done("simulate", study(seed=seed), t, "-o", f)
    found = cpfls.done(
        *("identify", study(), tmp_path / "f1.h5", "--validate", tmp_path / "f2.h5", "-o", tmp_path / "m.h5", "--json")
    )
    assert json.loads(found.stdout)["held_out"]["f2.h5"]["relative_error"] < 1e-8
    cpfls.done("report", study(), tmp_path / "f1.h5", "-o", tmp_path / "r.html")
    assert "Attitude and Euler rates of f1.h5" in (tmp_path / "r.html").read_text()


def test_what_a_held_vehicle_lacks_has_no_noise(cpfls, refuse, tmp_path, study):
    cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5")
    noise = ("--set", "simulation.noise={position: 0.5}")
    (message,) = refuse("simulate", study(), tmp_path / "t.h5", "-o", tmp_path / "f.h5", *noise)
    assert "simulation.noise" in message
    assert "position: a vehicle held at its centre of mass has none" in message


def test_no_autopilot_flies_a_held_vehicle(cpfls, refuse, tmp_path, study):
    cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5")
    (message,) = refuse(*("simulate", study(), tmp_path / "t.h5", "-o", tmp_path / "f.h5", "--mode", "closed-loop"))
    assert "turns a vehicle that is held at its centre of mass" in message


def test_turns_that_no_rotor_gives_name_the_torque_to_limit(refuse, tmp_path, study):
    heavy = ("--set", "vehicle.inertia_kg_m2=[6, 6, 12]")
    messages = refuse("trajectory", study(), "-o", tmp_path / "t.h5", *heavy, code=1)
    assert any("M1: above the limit asked for" in message for message in messages)
    assert (
        "trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to 36.4 36.5 5.4 N m)"
        in messages[-1]
    )


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("rotation.rate_max_rad_s", "1e-3", "turn"),
        ("rotation.frequency_max_hz", "1e-3", "no harmonic fits into 12 s"),
        ("rotation.turns", "[100, 0, 0]", "turn"),
        ("duration_s", "null", "path full-rotation needs a duration"),
    ],
)
def test_impossible_rotations_name_their_key(refuse, tmp_path, study, key, value, complaint):
    (message,) = refuse("trajectory", study(), "-o", tmp_path / "t.h5", "--set", f"trajectory.{key}={value}")
    assert f"trajectory.{key.rsplit('.', 1)[0]}" in message
    assert complaint in message
