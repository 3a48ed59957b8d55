"""The room that a vehicle has for an excitation: limits hold, the one that is reached is named, nothing is refused."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.room_left import ROTOR_SHARE, hover_squared, room_left, rotor_load, squared_speeds, tilt_of
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings
from cpfls_cli.vehicle.settings import VehicleSettings

USUAL = VehicleSettings()


def of(vehicle=USUAL, *, tilt_max=None, **asked):
    excite = ExciteSettings(**{"axes": ("roll", "pitch"), "band_hz": (0.5, 2.0), **asked})
    settings = TrajectorySettings(path="hover", duration_s=20.0, tilt_max_rad=tilt_max, excite=excite)
    path = plan(settings, vehicle.gravity_m_s2)
    added = added_motion(excite, path, vehicle.gravity_m_s2)
    return path, added, settings, room_left(path, added, settings, vehicle)


def flown(path, added, factor=1.0):
    return added.of_sizes(factor * added.sizes).onto(path, USUAL.gravity_m_s2)


def test_what_fits_is_left_as_it_is():
    _, added, _, room = of(size_rad=0.03)
    np.testing.assert_array_equal(room.added.sizes, added.sizes)
    assert room.limits == ("", "")


def test_tilt_is_kept_and_reached():
    path, _, _, room = of(size_rad=0.4, tilt_max=0.1, band_hz=(0.5, 1.0))
    assert room.limits == ("tilt (trajectory.tilt_max_rad = 0.1)",) * 2
    tilt = tilt_of(flown(path, room.added).attitude).max()
    assert 0.0995 < tilt <= 0.1


def test_velocity_is_kept_and_reached():
    _, _, _, room = of(size_rad=0.4, velocity_max_m_s=0.2, band_hz=(0.5, 1.0))
    assert all("trajectory.excite.velocity_max_m_s = 0.2" in limit for limit in room.limits)
    velocity = np.linalg.norm(room.added.motion[1], axis=1).max()
    assert 0.199 < velocity <= 0.2


def test_rotors_keep_what_control_takes():
    path, _, _, room = of(size_rad=0.3)
    assert all("rotor speed" in limit for limit in room.limits)
    squared, hover = squared_speeds(vars(flown(path, room.added)), USUAL), hover_squared(USUAL)
    assert squared.max() <= ROTOR_SHARE * USUAL.rotor_speed_max_rad_s**2
    assert (squared >= (1 - ROTOR_SHARE) * hover * (1 - 1e-9)).all()
    load = rotor_load(vars(flown(path, room.added, 1.01)), USUAL)
    assert max(load.fast, load.slow) > 1


def test_the_largest_speed_is_named():
    hover = float(np.sqrt(hover_squared(USUAL).max()))
    weak = replace(USUAL, rotor_speed_max_rad_s=1.15 * hover)
    _, _, _, room = of(weak, size_rad=0.1)
    largest = f"rotor speed (85 % of the square of vehicle.rotor_speed_max_rad_s = {1.15 * hover:g})"
    assert room.limits == (largest, largest)


def test_an_axis_that_can_little_leaves_the_others_their_size():
    alone = of(axes=("roll",), size_rad=0.02)[3]
    path, _, _, room = of(axes=("roll", "yaw"), size_rad=0.02)
    roll, yaw = room.added.sizes
    assert alone.added.sizes[0] == 0.02
    assert yaw < 0.6 * roll
    assert roll > 0.9 * 0.02
    load = rotor_load(vars(flown(path, room.added)), USUAL)
    assert 0.99 < max(load.fast, load.slow) <= 1


def test_next_to_no_room_is_refused():
    with pytest.raises(SettingError, match=r"room for only .* degrees of roll: rotor speed") as caught:
        of(size_rad=0.5, band_hz=(0.5, 10.0))
    assert caught.value.key == "excite.size_rad"
