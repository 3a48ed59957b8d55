"""Flights that end before their time, by what a vehicle does then, and what looks alike and is flight."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.builders.unknown_logs import GRAVITY, INERTIA, MASS, mixer

SECONDS = 40.0
"""Of flight before what ends it."""

_FIELDS = ("angles", "rate", "position", "velocity", "acceleration", "specific_force", "speed")
UPSIDE_DOWN = (0.0, 0.0, -GRAVITY)
ONE_AT_FULL = (1.6, 0.3, 0.3, 0.3)
TWO_AT_FULL = (1.6, 0.3, 1.6, 0.3)


def changed(own, **fields):
    """Copy a flight but for some fields."""
    return type(own)(**vars(own) | fields)


def then(own, seconds, *, rate=0.0, felt=(0.0, 0.0, GRAVITY), rotors=0.0, roll=None, falls=0.0, seed=5):
    """Append some seconds: rate about x, rad/s, force that is felt, rotors as shares of hover, roll, fall, m/s^2."""
    rng = np.random.default_rng(seed)
    step = own.time[1] - own.time[0]
    late = step * np.arange(1, round(seconds / step) + 1)
    count = len(late)
    last = own.angles[-1]
    angles = np.tile(last, (count, 1))
    angles[:, 0] = last[0] + rate * late if roll is None else roll
    down = np.column_stack([0 * late, 0 * late, -0.5 * falls * late**2])
    more = {
        "angles": angles,
        "rate": np.column_stack([rate + 0 * late, 0 * late, 0 * late]) + 0.02 * rng.standard_normal((count, 3)),
        "position": own.position[-1] + down + 0.002 * rng.standard_normal((count, 3)),
        "velocity": np.gradient(down, step, axis=0) + 0.01 * rng.standard_normal((count, 3)),
        "acceleration": np.tile([0.0, 0.0, -falls], (count, 1)),
        "specific_force": np.tile(felt, (count, 1)) + 0.2 * rng.standard_normal((count, 3)),
        "speed": np.broadcast_to(rotors, (count, 4)) * own.speed.mean() + rng.standard_normal((count, 4)),
    }
    longer = changed(own, **{name: np.vstack([getattr(own, name), more[name]]) for name in _FIELDS})
    longer.time = step * np.arange(len(own.time) + count)
    longer.speed = np.maximum(longer.speed, 0.0)
    longer.rotation = Rotation.from_euler("ZYX", longer.angles[:, ::-1])
    return longer


def joined(first, second):
    """One flight after another."""
    longer = changed(first, **{name: np.vstack([getattr(first, name), getattr(second, name)]) for name in _FIELDS})
    longer.time = (first.time[1] - first.time[0]) * np.arange(len(first.time) + len(second.time))
    longer.rotation = Rotation.from_euler("ZYX", longer.angles[:, ::-1])
    return longer


def hits(own):
    """Hit the ground, turn over, and lie on the back with one motor at full."""
    struck = then(own, 0.06, rate=-16.0, felt=(30.0, -20.0, 40.0), rotors=1.0)
    rolls = then(struck, 0.3, rate=-9.0, felt=(0.0, 5.0, 8.0), rotors=ONE_AT_FULL)
    return then(rolls, 8.0, felt=UPSIDE_DOWN, rotors=ONE_AT_FULL, roll=np.pi)


def hits_with_rotors_that_drop(own):
    """Hit the ground with rotors that drop at once, turn over, and lie on the back, disarmed."""
    struck = then(own, 0.06, rate=-16.0, felt=(30.0, -20.0, 40.0), rotors=0.2)
    return then(then(struck, 0.3, rate=-9.0, rotors=0.2), 8.0, felt=UPSIDE_DOWN, roll=np.pi)


def tumbles(own):
    """Lose control and tumble until the log ends."""
    return then(own, 2.5, rate=17.0, felt=(0.0, 0.0, 1.0), rotors=ONE_AT_FULL, falls=7.0)


def rolls_on_the_ground(own, height=0.0):
    """Take off, fly 5 m high, lose control, fall to some height, and roll there to the end with the rotors on."""
    flown = changed(own, position=own.position.copy())
    flown.position[:, 2] = np.interp(own.time, [0.0, 4.0], [0.0, 5.0])
    rolls = then(then(flown, 1.2, rate=17.0, felt=(0.0, 0.0, 1.0), rotors=ONE_AT_FULL, falls=7.0), 25.0, rate=6.0)
    rolls.speed[len(own.time) :] = own.speed.mean() * np.array(ONE_AT_FULL)
    rolls.position[rolls.time > own.time[-1] + 1.2, 2] = height
    return rolls


def gives_way(own):
    """Lean more and more with two rotors at full, swing, and hit the ground three seconds later."""
    leans = then(own, 1.5, rate=0.8, felt=(0.0, 0.0, 9.0), rotors=(2.5, 0.9, 2.5, 0.9))
    return hits(
        then(then(leans, 0.75, rate=-3.0, rotors=(2.5, 0.9, 1.2, 0.9)), 0.75, rate=3.0, rotors=(0.9, 0.9, 2.5, 1.0))
    )


def falls_and_hits(own):
    """Cut the throttle in the air, fall with idling rotors, hit, and lie on the back with one motor at full."""
    return hits(then(own, 0.6, felt=(0.0, 0.0, 0.5), rotors=0.08, falls=9.3))


def turns_over(own):
    """Tip over when landing, slowly, and lie on the back with the rotors on."""
    tips = then(own, 1.0, rate=3.0, felt=(0.0, 7.0, 6.0), rotors=0.8)
    return then(tips, 10.0, felt=UPSIDE_DOWN, rotors=0.8, roll=np.pi)


def stops_in_the_air(own):
    """Lose all rotors, fall and hit the ground on the feet."""
    return then(then(then(own, 1.2, felt=(0.0, 0.0, 0.0), falls=9.8), 0.04, rate=2.0, felt=(0.0, 0.0, 100.0)), 6.0)


def held(own):
    """Stand with the rotors on, held by something while they ask to turn."""
    return then(own, 8.0, rotors=ONE_AT_FULL)


def rocks_on_the_ground(own):
    """Hover calmly, hit the ground, and rock on the feet with one motor at full."""
    calm = changed(own, rate=0.02 * own.rate, speed=own.speed.mean() + 0.1 * (own.speed - own.speed.mean()))
    struck = then(then(calm, 0.04, rate=-14.0, felt=(30.0, -20.0, 40.0), rotors=1.0), 1.0, rotors=1.0)
    rocks = then(struck, 25.0, rotors=ONE_AT_FULL)
    late = rocks.time > struck.time[-1]
    rocks.rate[late] += 0.6 * np.sin(4 * rocks.time[late, None])
    return rocks


def rocks_on_its_back(own, seconds=12.0):
    """Tumble for a second, hit the ground, and rock on the back with the rotors on."""
    tumbles = then(own, 1.0, rate=-14.0, felt=(0.0, 0.0, 6.0), rotors=TWO_AT_FULL, falls=4.0)
    struck = then(tumbles, 0.06, rate=-16.0, felt=(30.0, -20.0, 60.0), rotors=TWO_AT_FULL)
    rocks = then(struck, seconds, felt=UPSIDE_DOWN, rotors=TWO_AT_FULL, roll=np.pi)
    late = rocks.time > struck.time[-1]
    rocks.rate[late] += 2.0 * np.sin(4 * rocks.time[late, None])
    return rocks


def leans_on_a_wall(own):
    """Lean against something three metres higher, with two rotors near full."""
    leans = then(own, 20.0, felt=(0.0, 4.7, 8.6), rotors=(1.5, 0.4, 0.9, 1.4), roll=0.5)
    leans.position[len(own.time) :, 2] = own.position[:, 2].max() + 3.0
    return leans


def carried(own):
    """Land, and be carried home."""
    rng = np.random.default_rng(7)
    home = then(then(own, 3.0), 15.0)
    late = len(own.time) + round(3.0 / (own.time[1] - own.time[0]))
    home.rate[late:] += 1.5 * np.sin(3 * home.time[late:, None]) + 0.1 * rng.standard_normal((len(home.time) - late, 3))
    return home


def flips(own):
    """Flip over and over in the air: nearly in free fall and upside down, by the torque of the rotors."""
    angles, rate, force = own.angles.copy(), own.rate.copy(), own.specific_force.copy()
    squared = own.speed**2
    for begin in np.arange(5.0, own.time[-1] - 0.4, 2.5):
        turn = (own.time >= begin) & (own.time < begin + 0.7)
        done = np.clip((own.time[turn] - begin) / 0.7, 0, 1)
        angles[turn, 0] += np.pi * (1 - np.cos(np.pi * done))
        rate[turn, 0] += np.pi**2 / 0.7 * np.sin(np.pi * done)
        force[turn] *= 0.5
        torque = INERTIA[0] * (np.pi**3 / 0.49) * np.cos(np.pi * done)
        wanted = np.column_stack([0.5 * MASS * GRAVITY + 0 * done, torque, 0 * done, 0 * done])
        squared[turn] = wanted @ np.linalg.inv(mixer()).T
    flipped = changed(own, angles=angles, rate=rate, specific_force=force, speed=np.sqrt(np.maximum(squared, 1e3)))
    flipped.rotation = Rotation.from_euler("ZYX", angles[:, ::-1])
    return flipped
