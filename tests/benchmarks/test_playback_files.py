"""Readers of public flights: made-up files come back as what was put into them, and the real ones as published."""

import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from benchmarks.shared import nanodrone_files, neurobem_files
from benchmarks.shared.flight_csv import write_flight
from benchmarks.shared.playback_scores import HORIZON, Runs, as_published, nothing_moves, rate_stays, score
from cpfls_cli.config.load import load_study
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.motion import MeasuredMotion

PERIOD, SAMPLES, LEAD_IN, SPIKE = 0.01, 900, 120, 400
ERPM_OF_RAD_S = 6 * 60 / (2 * np.pi)
OFFSET = 0.25
NAME = "random2_20251017_run1"


def slow_motion(time):
    """Columns of a flight whose frequencies lie below all cut-offs, and its rotor speeds."""
    turn = Rotation.from_rotvec(
        np.stack([0.1 * np.sin(2 * time), 0.08 * np.cos(3 * time), 0.05 * np.sin(time)], axis=1)
    )
    columns = {axis: np.sin((1 + n) * time) for n, axis in enumerate("xyz")}
    columns |= {f"v{axis}": (1 + n) * np.cos((1 + n) * time) for n, axis in enumerate("xyz")}
    columns |= {f"w{axis}": 0.5 * np.sin((2 + n) * time) for n, axis in enumerate("xyz")}
    columns |= dict(zip(("qx", "qy", "qz", "qw"), turn.as_quat().T, strict=True))
    thrust = 9.81 + 2 * np.sin(5 * time) + np.sin(7.3 * time)
    acceleration = turn.apply(np.stack([0 * time, 0 * time, thrust], axis=1))
    columns |= dict(zip(("ax", "ay", "az"), acceleration.T, strict=True))
    speed = 500 * np.sqrt(thrust)[:, None] * np.array([1.0, 1.01, 0.99, 1.02])
    return columns, speed


@pytest.fixture
def folder(tmp_path):
    """Raw and planned files of one flight, in the layout of the repository."""
    time = PERIOD * np.arange(SAMPLES)
    planned, _ = slow_motion(time)
    planned |= {"t": time, "x_r": np.exp(-(((time - 4) / 1.5) ** 2))}
    logged = PERIOD * np.arange(SAMPLES + 2 * LEAD_IN)
    raw, speed = slow_motion(logged - PERIOD * LEAD_IN)
    raw |= {"t": logged + 3.0, "x_r": np.exp(-(((logged - PERIOD * LEAD_IN - 4) / 1.5) ** 2))}
    raw["t"] -= raw["t"][0]
    raw["x"] = raw["x"] + OFFSET
    raw |= {f"m{n + 1}_erpm": values * ERPM_OF_RAD_S for n, values in enumerate(speed.T)}
    raw["m2_erpm"][LEAD_IN + SPIKE] = 9e5
    raw["m3_erpm"][:5] = np.nan
    for place, name, columns in (
        ("data/real/raw/parquets", NAME, raw),
        ("data/sim", "random_20251017", {column: planned[column] for column in planned if column[0] != "a"}),
    ):
        (tmp_path / place).mkdir(parents=True)
        parquet.write_table(pa.table(columns), tmp_path / place / f"{name}.parquet")
    return tmp_path


def test_a_raw_flight_is_cut_to_its_plan_and_loses_offset_and_spike(folder):
    (flight,) = nanodrone_files.flights(folder, [NAME])
    time = PERIOD * np.arange(SAMPLES)
    planned, speed = slow_motion(time)
    inner = slice(60, -60)
    assert len(flight) == SAMPLES
    assert flight.hold == "previous"
    assert flight.motion.position[inner, 0] == pytest.approx(planned["x"][inner], abs=2e-3)
    assert flight.motion.rate[inner, 2] == pytest.approx(planned["wz"][inner], abs=2e-3)
    assert flight.speed[inner] == pytest.approx(speed[inner], rel=2e-3)
    turn = np.stack([planned[column] for column in ("qx", "qy", "qz", "qw")], axis=1)
    off = Rotation.from_matrix(flight.motion.rotation).inv() * Rotation.from_quat(turn)
    assert off.magnitude()[inner].max() < 2e-3


def test_files_side_by_side_in_one_folder_are_read_as_well(folder):
    for path in list(folder.rglob("*.parquet")):
        path.rename(folder / path.name)
    (flight,) = nanodrone_files.flights(folder, [NAME])
    assert len(flight) == SAMPLES


def test_a_published_flight_is_taken_as_it_is(folder):
    columns = [*(f"{kind}{axis}" for kind in ("", "v", "w") for axis in "xyz"), "qx", "qy", "qz", "qw"]
    columns += [f"m{n}_rads" for n in (1, 2, 3, 4)]
    rows = np.vstack([[0.5] * 12 + [0.9] + [1500.0] * 4] * 3)
    np.savetxt(folder / f"{NAME}.csv", rows, delimiter=",", header=",".join(columns), comments="")
    (flight,) = nanodrone_files.flights(folder, [NAME])
    assert len(flight) == 3
    assert flight.speed.tolist() == [[1500.0] * 4] * 3
    assert flight.motion.velocity.tolist() == [[0.5] * 3] * 3


def test_a_missing_flight_is_named(tmp_path):
    with pytest.raises(InputError, match=r"no melon_20251017_run1\.parquet"):
        nanodrone_files.flights(tmp_path, ["melon_20251017_run1"])


def flight_of(position, rate):
    """A flight that never turns its body, whatever its rate says."""
    samples = len(position)
    flat, still = np.tile(np.eye(3), (samples, 1, 1)), np.zeros((samples, 3))
    motion = MeasuredMotion(position, still, flat, rate, PERIOD)
    return PlaybackFlight(
        name="made up", motion=motion, speed=np.ones((samples, 4)), hold="previous", stretches=(slice(0, samples),)
    )


def test_counted_as_published_the_last_windows_meet_the_next_flight():
    first, second = (flight_of(np.zeros((8, 3)), np.full((8, 3), value)) for value in (0.0, 2.0))
    exact = [Runs(np.zeros((5, 3, 4, 3))) for _ in range(2)]
    held = [run.errors[..., 3, 0] for run in as_published([first, second], exact)]
    meets_next = np.add.outer(np.arange(5), np.arange(3)) >= 5
    assert np.array_equal(held[0], np.where(meets_next, -2.0, 0.0))
    assert np.array_equal(held[1], np.where(meets_next, np.nan, 0.0), equal_nan=True)


def test_baselines_on_a_flight_of_constant_velocity():
    time = PERIOD * np.arange(HORIZON + 5)
    flight = flight_of(np.outer(time, [1.0, 0.0, 0.0]), np.zeros((len(time), 3)))
    flight.motion.velocity[:, 0] = 1.0
    still, moving = score([nothing_moves(flight)]), score([rate_stays(flight)])
    assert still.mae[:, 0] == pytest.approx(PERIOD * np.arange(1, HORIZON + 1))
    assert moving.sums == pytest.approx(0.0, abs=1e-12)


@pytest.fixture
def segment(tmp_path):
    """A segment of 400 Hz that turns about z at 2 rad/s and flies forward, and its path."""
    samples = 400
    time = neurobem_files.PERIOD * np.arange(samples)
    table = np.zeros((samples, 41))
    table[:, 0], table[:, 6], table[:, 14] = time, 2.0, 3.0
    table[:, 1:4] = [10.0, 0.0, 0.0]
    table[:, 7:11] = Rotation.from_rotvec(np.outer(2 * time, [0, 0, 1])).as_quat()
    table[:, 13] = 9.81
    table[:, 20:24] = [900.0, 901.0, 902.0, 903.0]
    table[:, 29:35] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    path = tmp_path / "bemnn20210223114138seg3.mat"
    savemat(path, {path.stem: table})
    return path


def test_a_segment_is_thinned_to_100_hz_with_velocity_in_the_world(segment):
    found = neurobem_files.segment(segment, "Melon_1")
    flight = found.flight
    assert (len(flight), flight.motion.period, flight.hold) == (100, 0.01, "linear")
    assert flight.motion.velocity[25] == pytest.approx([3 * np.cos(0.5), 3 * np.sin(0.5), 0.0])
    assert flight.speed[7].tolist() == [900.0, 901.0, 902.0, 903.0]
    assert found.wrench[3] == pytest.approx([10 * 2.5e-3, 0.0, 0.0, 0.0, 0.0, 0.772 * 9.81])
    assert found.hybrid[3].tolist() == [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]


def test_a_segment_as_csv_is_imported_as_it_was(segment, tmp_path):
    found = neurobem_files.segment(segment, "Melon_1")
    write_flight(tmp_path / "csv", found.flight, found.wrench[:, 3:] / neurobem_files.MASS)
    study = load_study(Path(__file__).parents[2] / "configs" / "gap" / "neurobem.yaml")
    columns = log_contents(tmp_path / "csv" / "Melon_1.csv").topics[""]
    flight = import_log(columns, study.import_, rotor_torque=lambda signals: 0 * signals.body_rate)
    for name, logged in (("position", "position"), ("velocity", "velocity"), ("body_rate", "rate")):
        np.testing.assert_allclose(getattr(flight, name), getattr(found.flight.motion, logged), atol=1e-6)
    turned = Rotation.from_euler("ZYX", flight.attitude[:, ::-1]).as_matrix()
    np.testing.assert_allclose(turned, found.flight.motion.rotation, atol=1e-6)
    np.testing.assert_allclose(flight.rotor_speed, found.flight.speed)
    np.testing.assert_allclose(flight.specific_force[:, 2], 9.81)


def test_missing_and_foreign_segments_are_named(segment):
    with pytest.raises(InputError, match=r"bemnn20210218170320seg2\.mat"):
        neurobem_files.segments(segment.parent)
    savemat(segment, {"table": np.zeros((100, 20))})
    with pytest.raises(InputError, match="35 or more columns"):
        neurobem_files.segment(segment, "Melon_1")


def data_of(variable):
    """Give the folder that a variable names, or skip the test."""
    if variable not in os.environ:
        pytest.skip(f"{variable} does not name the folder of the public flights")
    return Path(os.environ[variable])


def test_nothing_moves_on_the_real_test_flights_as_published():
    test = nanodrone_files.flights(data_of("CPFLS_NANODRONE"), nanodrone_files.TEST)
    runs = [nothing_moves(flight) for flight in test]
    within, published = score(runs), score(as_published(test, runs))
    assert within.windows == 19350
    assert within.mae[[0, 9, 49], 3] == pytest.approx([0.0796, 0.3588, 0.8777], abs=5e-5)
    assert within.sums[3] == pytest.approx(28.98, abs=5e-3)
    # Three windows less are published, which says nothing of which.
    assert published.mae[[0, 9, 49], 3] == pytest.approx([0.0796, 0.3596, 0.8837], abs=1e-4)
    assert published.sums == pytest.approx([17.7878, 38.9241, 8.2138, 29.0866], rel=3e-4)


def test_our_steps_give_the_published_square_flight():
    folder, name = data_of("CPFLS_NANODRONE"), "square_20251017_run3"
    published = nanodrone_files.flight(folder, name)
    columns = (nanodrone_files.columns(folder, file) for file in (name, "square_20251017"))
    ours = nanodrone_files.prepared(name, *columns)
    for signal in ("position", "velocity", "rotation", "rate"):
        assert getattr(ours.motion, signal) == pytest.approx(getattr(published.motion, signal), abs=1e-12)
    assert ours.speed == pytest.approx(published.speed, abs=1e-9)


def test_the_real_segments_fly_as_their_columns_say():
    found = neurobem_files.segments(data_of("CPFLS_NEUROBEM"))
    assert [len(segment.flight) for segment in found] == [3577, 3181, 2613, 2938, 2858, 2350]
    for segment in found:
        motion = segment.flight.motion
        moved = np.diff(motion.position, axis=0) / motion.period
        assert np.abs(moved - 0.5 * (motion.velocity[1:] + motion.velocity[:-1])).mean() < 0.05
        assert np.sqrt(np.mean((segment.wrench - segment.hybrid)[:, 5] ** 2)) < 0.08 * segment.wrench[:, 5].mean()
