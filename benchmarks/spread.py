"""How often 1000 closed-loop flights of vehicles that were drawn hold the rates of a flight that was held out.

simulated: two vehicles of 45 g and 1.5 kg in gusts, whose truth is known. A path with sines of up to 5 Hz is flown four
times, 20 s each; the constants, their correlation, and the gusts are found in these flights as `cpfls vehicle` does
where flights repeat each other. Drawn vehicles then fly another path in closed loop, under the autopilot and with the
motors that flew, each in gusts of its own and with the noise of the gyroscope: in JAX by one batched function of the
export, which takes the samples as they are. Counted is how often the rates of flights that were held out, in gusts of
their own, lie between the 2.5th and the 97.5th percentile of the 1000 at that instant. Compared are vehicles drawn
without what the model lacks; all vehicles the estimate, in gusts; vehicles drawn, in still air, with nothing lacking;
numbers drawn from their ranges each by itself; and the truth in its true gusts, which is what can be had.

real: the nano-drone benchmark (see nanodrone.py for --data). Constants and gusts are found in its training flights,
each path of which was flown three or four times. The law of its autopilot is not known: how torque and thrust answer is
found in how runs of one path differ. Vehicles drawn fly the test flights in closed loop, asked what the flight was
asked: their rotors turn as logged, and answer the difference to the logged state by that law. About yaw these flights
identify neither the moment of inertia nor gusts, so all keep the logged heading, and roll and pitch are counted.

Needs jax (extra `simulators`); real needs pyarrow (extra `parquet`) too.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import typer

from benchmarks.shared.gusty_sets import VEHICLES
from benchmarks.shared.measure import program, progress, table
from benchmarks.shared.nanodrone_files import TEST, TRAINING, VEHICLE, flights
from cpfls_cli.arrays import Array
from cpfls_cli.export.registry import exported
from cpfls_cli.export.source import jax_parameters, jax_parts
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.disturbance import find_gusts
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import rotation_vectors
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.spread import drawn
from cpfls_cli.playback.vehicle import VehicleFit, bodily, estimate_correlation, found_numbers
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.flown_exports import executed
from tests.builders.gusty_flights import EVERY, GRAVITY, GUSTS, MEMORY_S, STEP_S, Flight, Truth, gusty_flights, path_of
from tests.builders.spread_vehicles import found_record

RUNS, HELD_OUT, SECONDS, REACH_HZ, SWING = 4, 5, 20.0, 5.0, 0.2
SHOVE, SHOVE_MEMORY_S = 0.06, 1.0
"""Of the flights of gusty_flights: acceleration by the largest gust, and its memory."""
ENDS, TUMBLES = (2.5, 97.5), 50.0
"""Percentiles; and a rate in rad/s that no controlled flight of these has."""


def main(part: Annotated[str, typer.Argument()], data: Path = Path(), count: int = 1000) -> None:
    with jax.enable_x64(True):
        if part == "real":
            real(data, count)
        else:
            simulated(count)


class Found(NamedTuple):
    """What flights tell: a model with its gusts, and how sure its numbers are."""

    model: VehicleModel
    known: VehicleFit
    lack: Lack | None


def found(vehicle: VehicleSettings, flights: Sequence[PlaybackFlight]) -> Found:
    """Find constants and gusts by instruments, as `cpfls vehicle` does."""
    given = instruments(flights)
    constants = find_constants(vehicle, flights, given, PlaybackSettings().leave_out)
    assert constants is not None
    assert constants.identified, "instruments identify the body of these flights"
    solved, spread = constants.fitted, constants.spread
    numbers = tuple(bodily(vehicle, tuple(found_numbers(solved, spread))))
    gusts = find_gusts(solved.model, given, {each.name: each.determined for each in numbers}, identified=True)
    if gusts is not None:
        print(f"  repeatable share of the residual, by axis: {np.round(gusts.predicted, 2)}", file=sys.stderr)
    held = None if gusts is None or gusts.gusts is None else gusts.gusts
    model = replace(solved.model, gusts=held)
    known = found_record(
        model,
        numbers=numbers,
        correlation=estimate_correlation(solved, spread),
        blocks=spread.blocks,
        disturbance=gusts,
    )
    return Found(model, known, None if gusts is None else gusts.lack)


class Fleet(NamedTuple):
    """Vehicles side by side: parameters of the functions in JAX, gusts, and what the model lacks.

    Attributes
    ----------
    module : mapping of str
        What the export names.
    parts : array, shape (part, parameter)
        Parameters of the model's parts alone; of all of it by vehicle in `parameters`.
    share : array, shape (vehicle, part, 6)
        With `rest` and `memory`, shape (vehicle, 6): what the model lacks.
    """

    module: Mapping[str, Any]
    parts: Array
    parameters: Array
    gusts: Array
    share: Array
    rest: Array
    memory: Array
    inertia: Array
    mass: Array


def fleet(
    nominal: VehicleModel, models: Sequence[VehicleModel], lack: Lack | None = None, *, still: bool = False
) -> Fleet:
    """Export a vehicle once, and take the samples as they are."""
    sheet = sheet_of_vehicle(replace(nominal, gusts=None))
    module = executed(exported(sheet, "jax", "v.py").text)
    none, parts, count = Gusts(np.zeros(6), np.ones(6)), tuple(one.name for one in nominal.parts), len(models)
    gusts = np.array([none if still or each.gusts is None else each.gusts for each in models])
    share, rest, memory = np.zeros((len(parts), 6)), np.zeros(6), np.ones(6)
    if lack is not None:
        assert lack.part == parts
        share, rest = np.nan_to_num(lack.share).T, np.nan_to_num(lack.rest)
        memory = np.where(np.isfinite(lack.memory), lack.memory, 1.0)
    return Fleet(
        module,
        jax_parts(sheet, parts),
        jax_parameters(sheet, models),
        gusts,
        *(np.tile(each, (count, *[1] * each.ndim)) for each in (share, rest, memory)),
        np.array([each.body.inertia for each in models]),
        np.array([each.body.mass for each in models]),
    )


class Air(NamedTuple):
    """Torque and force that act on vehicles next to those of their models: gusts and what the model lacks."""

    flying: Fleet
    keep: Any
    size: Any
    white: Any
    parts: Any

    @classmethod
    def of(cls, flying: Fleet, step: float) -> Air:
        """Play them as docs/spread.md says."""
        keep = jnp.exp(-step / jnp.stack([flying.gusts[:, 1], flying.memory]))
        size = jnp.stack([flying.gusts[:, 0], jnp.ones_like(flying.memory)])
        wrench = jax.vmap(flying.module["wrench"], (0, 0, 0, None))
        parts = jax.vmap(wrench, (None, None, None, 0))
        return cls(flying, keep, size, flying.gusts[:, 2] / np.sqrt(step), parts)

    def first(self, key: Any) -> Any:
        """Draw both processes, shape (2, vehicle, 6)."""
        return self.size * jax.random.normal(key, self.keep.shape)

    def after(self, now: Any, key: Any) -> Any:
        """Draw them a step later."""
        return self.keep * now + self.size * jnp.sqrt(1 - self.keep**2) * jax.random.normal(key, now.shape)

    def push(self, now: Any, key: Any, state: Any, speed: Any) -> Any:
        """Add them up in a state, with the white part, shape (vehicle, 6)."""
        mean = jnp.sqrt((speed**2).mean(axis=1, keepdims=True))
        rotor = jax.vmap(self.flying.module["steady"])(jnp.tile(mean, (1, speed.shape[1])))
        velocity = jnp.einsum("nji,nj->ni", state[:, 6:15].reshape(-1, 3, 3), state[:, 3:6])
        given = self.parts(velocity, jnp.zeros_like(velocity), rotor, self.flying.parts)
        share = jnp.moveaxis(jnp.asarray(self.flying.share), 1, 0)
        size = jnp.sqrt(self.flying.rest**2 + ((share * given) ** 2).sum(axis=0))
        return now[0] + size * now[1] + self.white * jax.random.normal(key, self.white.shape)


def pushed(fleet: Fleet, state: Any, gust: Any, step: float) -> Any:
    """Add what gusts do in a step to velocity and rate, as docs/simulators.md says."""
    rotation = state[:, 6:15].reshape(-1, 3, 3)
    faster = jnp.einsum("nij,nj->ni", rotation, gust[:, 3:]) / fleet.mass[:, None]
    spun = jnp.linalg.solve(fleet.inertia, gust[:, :3, None])[..., 0]
    return state.at[:, 3:6].add(step * faster).at[:, 15:].add(step * spun)


def tumbled(flown: Array) -> Array:
    """Tell which flights turn faster than any that is controlled, or end beyond all numbers, shape (flight,)."""
    return ~(np.abs(np.nan_to_num(flown, nan=np.inf)).max(axis=(1, 2)) < TUMBLES)


def share_inside(flown: Array, measured: Array) -> Array:
    """Tell how often what was measured lies between the percentiles of those that do not tumble, shape (..., 3)."""
    low, high = np.percentile(flown[~tumbled(flown)], ENDS, axis=0)
    return np.asarray(((low <= measured) & (measured <= high)).mean(axis=-2))


def simulated(count: int) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        training = gusty_flights(
            [Flight(truth, GUSTS, 0, run, reach=REACH_HZ, swing=SWING) for run in range(RUNS)], SECONDS
        )
        result = found(unknown(truth), [replace(flight, setpoints={}) for flight in training])
        aside = [Flight(truth, GUSTS, 7, 100 + run, reach=REACH_HZ, swing=SWING) for run in range(HELD_OUT)]
        measured = np.stack([flight.motion.rate for flight in gusty_flights(aside, SECONDS)])
        for kind, own in fleets(result, truth, count).items():
            flown = closed_loop(truth, own, aside[0])
            low, high = np.percentile(flown[~tumbled(flown)], ENDS, axis=0)
            wide = ", ".join(f"{value:.2g}" for value in (high - low).mean(axis=0))
            rows.append((*row(name, kind, share_inside(flown, measured)), wide))
            progress(rows[-1])
    columns = "vehicle | flown | roll | pitch | yaw | all | one flight, least to most | width, rad/s"
    table("spread_simulated", columns, rows)


def row(name: str, kind: str, shares: Array) -> tuple[str, ...]:
    """Write shares of flights, shape (flight, axis), in per cent."""
    each = 100 * shares.mean(axis=1)
    mean = [f"{value:.1f}" for value in 100 * shares.mean(axis=0)]
    return name, kind, *mean, f"{each.mean():.1f}", f"{each.min():.1f} to {each.max():.1f}"


def unknown(truth: Truth) -> VehicleSettings:
    """State what anybody knows: the mass, the rotors, and an inertia that is off by a third."""
    vehicle = truth.vehicle
    moments = tuple(1.3 * moment for moment in vehicle.inertia_kg_m2[:3])
    return replace(vehicle, inertia_kg_m2=moments)


def fleets(result: Found, truth: Truth, count: int) -> dict[str, Fleet]:
    """Make what is flown: the spread, and what it has to be better than."""
    alone = replace(result.known, correlation=np.eye(len(result.known.numbers)))
    by_itself = drawn(result.model, alone, count, np.random.default_rng(1))
    true = VehicleModel(vehicle=truth.vehicle, gusts=true_gusts(truth))
    return kinds_of(result, count) | {
        "each number by itself": fleet(result.model, by_itself.models, result.lack),
        "the true vehicle, true gusts": fleet(true, [true] * count),
    }


def true_gusts(truth: Truth) -> Gusts:
    """Give what blew."""
    size = np.array([*(np.array(truth.inertia) * GUSTS), *[truth.mass * SHOVE * max(GUSTS)] * 3])
    return Gusts(size, np.array([*MEMORY_S, *[SHOVE_MEMORY_S] * 3]))


def closed_loop(truth: Truth, flying: Fleet, asked: Flight) -> Array:
    """Fly all vehicles on a path under the autopilot of the truth; give rates as read, shape (flight, time, 3)."""
    path = jnp.asarray(path_of(asked, round(SECONDS / STEP_S)))
    count, module = len(flying.parameters), flying.module
    hover, unmix = truth.mass * GRAVITY / 4 / truth.thrust_factor, np.linalg.inv(truth.mixer)
    outer, loop = min(2.0, asked.bandwidth / 6), asked.bandwidth * np.array([1.0, 1.0, 0.4])
    air = Air.of(flying, STEP_S)
    terms = jax.vmap(lambda now, then: module["steady"](jnp.sqrt(0.5 * (now**2 + then**2))))
    move = jax.vmap(lambda state, rotor, own: module["step"](state, rotor, STEP_S, own))

    def autopilot(state: Any, wanted_at: Any, measured: Any) -> Any:
        rotation = state[:, 6:15].reshape(-1, 3, 3)
        wanted = (
            wanted_at[6:9] + outer**2 * (wanted_at[:3] - state[:, :3]) + 1.6 * outer * (wanted_at[3:6] - state[:, 3:6])
        )
        wanted = jnp.clip(wanted, -6.0, 6.0) + jnp.array([0.0, 0.0, GRAVITY])
        up = wanted / jnp.linalg.norm(wanted, axis=1, keepdims=True)
        error = -jnp.einsum("nji,nj->ni", rotation, jnp.cross(up, rotation[:, :, 2]))
        error = error.at[:, 2].set(
            jnp.sin(wanted_at[9]) * rotation[:, 0, 0] - jnp.cos(wanted_at[9]) * rotation[:, 1, 0]
        )
        torque = jnp.array(truth.inertia) * (loop**2 * error - 1.4 * loop * measured)
        thrust = truth.mass * (wanted * rotation[:, :, 2]).sum(axis=1, keepdims=True)
        squared = jnp.concatenate([thrust, torque], axis=1) @ unmix.T
        return jnp.sqrt(jnp.clip(squared, 0.05 * hover, 4 * hover))

    def along(carried: Any, given: Any) -> Any:
        state, speed, gust = carried
        wanted_at, key = given
        felt, blown, new = jax.random.split(key, 3)
        measured = state[:, 15:] + truth.gyro_noise * jax.random.normal(felt, (count, 3))
        after = speed + STEP_S / truth.lag_s * (autopilot(state, wanted_at, measured) - speed)
        rotor = terms(speed, after)
        shoved = pushed(flying, state, air.push(gust, blown, state, after), STEP_S)
        return (move(shoved, rotor, flying.parameters), after, air.after(gust, new)), measured

    begun = jnp.concatenate([path[0, :6], jnp.eye(3).ravel(), jnp.zeros(3)])
    start = jnp.tile(begun, (count, 1)), jnp.full((count, 4), jnp.sqrt(hover)), air.first(jax.random.key(1))
    keys = jax.random.split(jax.random.key(2), len(path))

    def ten(carried: Any, given: Any) -> Any:
        moved, measured = jax.lax.scan(along, carried, given)
        return moved, measured[0]

    chunks = path.reshape(-1, EVERY, path.shape[1]), keys.reshape(-1, EVERY)
    return np.asarray(jax.jit(lambda: jax.lax.scan(ten, start, chunks)[1])()).swapaxes(0, 1)


PART = 500
"""Samples that are flown at a time."""
ANSWERS = {"thrust": (8, 11), "roll": (0, 3, 7, 10), "pitch": (1, 4, 6, 9)}
"""What each answers of a difference of states: rotation, rate, velocity and position along the body axes."""


class Law(NamedTuple):
    """How thrust and torque answer a difference between two states, as accelerations: what is left later, and gains."""

    keep: Array
    gain: Array


def real(folder: Path, count: int) -> None:
    """Find the nano-drone in its training flights, judge on a path that is not among them."""
    training, test = flights(folder, TRAINING), flights(folder, TEST)
    judged(found(VEHICLE, training), instruments(training), test, count)


def judged(result: Found, given: Instruments, aside: Sequence[PlaybackFlight], count: int) -> None:
    """Fly the spread, and what it has to be better than, along flights kept aside; print how often they hold them."""
    law = law_of(result.model, given)
    print(f"  law: {law}", file=sys.stderr)
    kinds = kinds_of(result, count)
    # Side by side, so that they are compiled once.
    columns = zip(*(own[2:] for own in kinds.values()), strict=True)
    whole = Fleet(*kinds["spread"][:2], *map(np.concatenate, columns))
    fly = twins(result.model, whole, law, given.flown[0].motion.period)
    rows: dict[str, list[tuple[Array, ...]]] = {kind: [] for kind in kinds}
    for flight in aside:
        turned, measured = np.split(fly(flight), len(kinds)), flight.motion.rate[1:]
        for kind, own in zip(kinds, turned, strict=True):
            low, middle, high = np.percentile(own[~tumbled(own)], (ENDS[0], 50.0, ENDS[1]), axis=0)
            off = np.sqrt(((middle - measured) ** 2).mean(axis=0))
            shares, lost = share_inside(own, measured), np.array([tumbled(own).sum()])
            rows[kind].append((shares[:2], off[:2], (high - low).mean(axis=0)[:2], lost))
            print(f"  {flight.name}, {kind}: {np.concatenate(rows[kind][-1]).round(3)}", file=sys.stderr, flush=True)
    listed = []
    for kind, each in rows.items():
        shares, off, wide, lost = (np.array(part) for part in zip(*each, strict=True))
        sizes_ = (", ".join(f"{value:.2g}" for value in part.mean(axis=0)) for part in (off, wide))
        listed.append((*row("nano-drone", kind, shares), *sizes_, f"{lost.sum()} of {len(aside) * count}"))
    columns = "vehicle | flown | roll | pitch | all | one flight, least to most | median off | width | tumbled"
    table("spread_nano-drone", columns, listed)


def kinds_of(result: Found, count: int) -> dict[str, Fleet]:
    """Draw the spread, and leave out of it what it has more than others."""
    models = drawn(result.model, result.known, count, np.random.default_rng(1)).models
    return {
        "spread": fleet(result.model, models, result.lack),
        "spread without what the model lacks": fleet(result.model, models),
        "the estimate, in gusts": fleet(result.model, [result.model] * count),
        "spread in still air, nothing lacking": fleet(result.model, models, still=True),
    }


def answers(model: VehicleModel, speed: Array) -> Array:
    """Give thrust and torque of rotors as accelerations of the body, shape (time, 4)."""
    return np.asarray(speed**2 @ allocation_matrix(model.vehicle).T / sizes(model))


def sizes(model: VehicleModel) -> Array:
    return np.append(model.body.mass, np.diag(model.body.inertia))


def law_of(model: VehicleModel, given: Instruments) -> Law:
    """Regress how answers differ between runs of a path on how their states did a sample before, by least squares.

    What was asked of them is the same. An offset between two runs is that of their trims.
    """
    before, after = [], []
    for number, run in enumerate(given.flown):
        for other, place in given.repeats.places[number].items():
            known = np.isfinite(place)
            there = known[1:] & known[:-1]
            rows = np.hstack([answers(model, run.speed), states(run)]) - given.repeats.at(
                number, other, np.hstack([answers(model, given.flown[other].speed), states(given.flown[other])])
            )
            turned = rotation_vectors(
                np.where(known[:, None, None], nearest(given, number, other), np.eye(3)), run.motion.rotation
            )
            rows[:, 4:7] = turned
            for part in (slice(7, 10), slice(10, 13), slice(13, 16)):
                rows[:, part] = (
                    rows[:, part] if part.start == 7 else np.einsum("tji,tj->ti", run.motion.rotation, rows[:, part])
                )
            centred = rows - rows[known].mean(axis=0)
            before.append(centred[:-1][there])
            after.append(centred[1:][there])
    x, y = np.vstack(before), np.vstack(after)
    keep, gain = np.zeros(4), np.zeros((4, 12))
    for row_, columns in enumerate(ANSWERS.values()):
        own = x[:, [row_, *(4 + column for column in columns)]]
        solved = np.linalg.lstsq(own, y[:, row_], rcond=None)[0]
        keep[row_], gain[row_, list(columns)] = solved[0], solved[1:]
    return Law(keep, gain)


def states(flight: PlaybackFlight) -> Array:
    """Arrange place for a rotation, rate, velocity and position, shape (time, 12)."""
    motion = flight.motion
    return np.hstack([np.zeros_like(motion.rate), motion.rate, motion.velocity, motion.position])


def nearest(given: Instruments, number: int, other: int) -> Array:
    """Give rotations of another run at the same places of the path."""
    mean = given.repeats.at(number, other, given.flown[other].motion.rotation.reshape(-1, 9)).reshape(-1, 3, 3)
    first, _, last = np.linalg.svd(np.nan_to_num(mean) + 1e-12 * np.eye(3))
    return np.asarray(first @ last)


def difference(rotation: Any, own: Any) -> Any:
    """Give the rotation from one to each of others about the body axes, small ones, shape (vehicle, 3)."""
    away = jnp.einsum("ji,njk->nik", rotation, own)
    pairs = ((2, 1), (0, 2), (1, 0))
    return 0.5 * jnp.stack([away[:, row, column] - away[:, column, row] for row, column in pairs], axis=1)


def about_z(angle: Any) -> Any:
    """Turn about body z, shape (vehicle, 3, 3)."""
    none, one, cosine, sine = jnp.zeros_like(angle), jnp.ones_like(angle), jnp.cos(angle), jnp.sin(angle)
    rows = [[cosine, -sine, none], [sine, cosine, none], [none, none, one]]
    return jnp.moveaxis(jnp.array(rows), 2, 0)


def twins(model: VehicleModel, flying: Fleet, law: Law, period: float) -> Callable[[PlaybackFlight], Array]:
    """Make what flies all vehicles from the first logged state of a flight to rates, shape (vehicle, time, 3).

    They are asked what the flight was asked. About yaw they keep what was logged, which these flights do not identify.
    """
    module, count = flying.module, len(flying.parameters)
    unmix = np.linalg.pinv(allocation_matrix(model.vehicle)) * sizes(model)
    air = Air.of(flying, period)
    terms = jax.vmap(module["steady"])
    move = jax.vmap(lambda state, rotor, own: module["step"](state, rotor, period, own))

    def along(carried: Any, given: Any) -> Any:
        state, answer, gust = carried
        (position, velocity, rotation, rate, speed), key = given
        own = state[:, 6:15].reshape(-1, 3, 3)
        own = own @ about_z(-difference(rotation, own)[:, 2])
        state = state.at[:, 6:15].set(own.reshape(-1, 9)).at[:, 17].set(rate[2])
        turned = difference(rotation, own)
        moved = jnp.concatenate([state[:, 3:6] - velocity, state[:, :3] - position], axis=1).reshape(-1, 2, 3)
        along_body = jnp.einsum("nji,nkj->nki", own, moved).reshape(-1, 6)
        squared = jnp.maximum(speed**2 + answer @ unmix.T, 0.0)
        after = law.keep * answer + jnp.concatenate([turned, state[:, 15:] - rate, along_body], axis=1) @ law.gain.T
        blown, new = jax.random.split(key)
        rotor = terms(jnp.sqrt(squared))
        shoved = pushed(flying, state, air.push(gust, blown, state, jnp.sqrt(squared)), period)
        moved_on = move(shoved, rotor, flying.parameters)
        return (moved_on, after, air.after(gust, new)), moved_on[:, 15:]

    part = jax.jit(lambda carried, rows: jax.lax.scan(along, carried, rows))

    def fly(flight: PlaybackFlight) -> Array:
        logged = (*flight.motion[:4], flight.speed)
        begun = jnp.concatenate([jnp.asarray(each[0]).ravel() for each in logged[:4]])
        carried = jnp.tile(begun, (count, 1)), jnp.zeros((count, 4)), air.first(jax.random.key(1))
        # The last part is filled up with its last row, so that all are as long.
        places = np.minimum(np.arange(-(-len(flight) // PART) * PART), len(flight) - 2)
        keys, found = jax.random.split(jax.random.key(2), len(places)), []
        for first in range(0, len(places), PART):
            own = slice(first, first + PART)
            carried, rates = part(carried, (tuple(jnp.asarray(each[places[own]]) for each in logged), keys[own]))
            found.append(np.asarray(rates))
        return np.concatenate(found)[: len(flight) - 1].swapaxes(0, 1)

    return fly


if __name__ == "__main__":
    program(main)
