"""The signals of one log on one uniform clock, as everything that `look` computes takes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray

AXES = ("roll", "pitch", "yaw")


class Samples(NamedTuple):
    """A signal as it was logged, time first, on its own clock: strictly increasing, s from the first stamp of the log.

    `source`: columns of the log that it comes from.
    """

    time: Array
    values: Array
    source: str = ""

    @property
    def rate_hz(self) -> float:
        """Samples in a second, the median; 0 for fewer than two."""
        return float(1 / np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


@dataclass(frozen=True, kw_only=True)
class LogFlight:
    """One log of a multirotor.

    Body axes are forward, right, down, as autopilots have them: roll to the right, pitch nose up and yaw clockwise
    seen from above are positive. All times are s from the first stamp of the log. A signal on the common clock that
    the log lacks, or lacks for a while, is NaN.

    Attributes
    ----------
    name : str
        Of the file.
    autopilot : str
        A name of `cpfls_cli.autopilots.registry`; empty where it is another or unknown.
    system : str
        What wrote the log, and its version.
    parameters : mapping
        Of the autopilot, as the log states them.
    rate_hz : float
        Of the common clock: twice that of the slower of body rate and command, at most 1000.
    time : array, shape (time,), s
    body_rate : array, shape (time, 3), rad/s
        As the control law takes it: after the autopilot's filters where the log has both.
    command : array, shape (time, 3)
        What acts on the vehicle about each axis, share of the full command of the autopilot (1: the mixer moves each
        rotor by its full share), positive as the body rate that it causes.
    command_source : str
        How it is known: logged, or rebuilt from what.
    rate_setpoint : array, shape (time, 3), rad/s
    unfollowed : bool
        Whether rate setpoints are logged by name that the body rate does not follow; they are left out.
    stick : array, shape (time, 3)
        Of the pilot, -1 to 1, positive as the body rate.
    attitude_setpoint : array, shape (time, 3), rad
        Roll, pitch, yaw.
    attitude : array, shape (time, 3), rad
        Roll, pitch, yaw.
    collective : array, shape (time,)
        Mean command of the rotors, share of full.
    voltage : array, shape (time,), V
        Of the battery.
    current : array, shape (time,), A
    height : array, shape (time,), m
        Upward, from where it starts.
    climb_rate : array, shape (time,), m/s
    specific_force : array, shape (time, 3), m/s^2
    relative : bool
        Whether full is not known, and shares of it are shares of the largest that occurs.
    flown, usable : array of bool, shape (time,)
        Where it flies; and of that where signals are whole: no gap, no crash, not on the wing.
    rotors : Samples
        Commands of the rotors, shape (sample, rotor), share of full, as logged or rebuilt.
    rotors_source : str
        ``logged``, ``rebuilt``, or empty where neither is there.
    rotor_speed : Samples or None
        Shape (sample, rotor), rad/s.
    places : array, shape (rotor, 2), or None
        Forward and right, share of the arm.
    spins : array, shape (rotor,), or None
        1 for a rotor that turns counter-clockwise seen from above, -1 for one that turns clockwise.
    gyroscope : Samples
        Fastest logged body rate, shape (sample, 3), rad/s.
    gyroscope_unfiltered : Samples or None
        In front of the autopilot's filters.
    accelerometer : Samples or None
        Fastest logged specific force, shape (sample, 3), m/s^2.
    reads_at_rest : float
        What the accelerometer reads where it stands, in gravity; NaN where that is not known. Where it is wrong,
        `specific_force` is not known.
    gaps_s : array, shape (gap, 2), s
        Begin and end of each.
    gains : mapping from str to array, shape (3,)
        ``p``, ``i``, ``d``, ``ff`` of the rate loop as the autopilot's own parameters have them; empty where unknown.
    """

    name: str
    autopilot: str = ""
    system: str = ""
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    rate_hz: float
    time: Array
    body_rate: Array
    command: Array
    command_source: str = ""
    rate_setpoint: Array
    unfollowed: bool = False
    stick: Array
    attitude_setpoint: Array
    attitude: Array
    collective: Array
    voltage: Array
    current: Array
    height: Array
    climb_rate: Array
    specific_force: Array
    relative: bool = False
    flown: BoolArray
    usable: BoolArray
    rotors: Samples
    rotors_source: str = ""
    rotor_speed: Samples | None = None
    places: Array | None = None
    spins: Array | None = None
    gyroscope: Samples
    gyroscope_unfiltered: Samples | None = None
    accelerometer: Samples | None = None
    reads_at_rest: float = np.nan
    gaps_s: Array
    gains: Mapping[str, Array] = field(default_factory=dict)
