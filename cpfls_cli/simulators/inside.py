"""Held-out flights flown in the simulator itself by its own file, as given and as corrected."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import install_command, visible
from cpfls_cli.gap.before_after import PlaybackChange, PlayedPair, errors_by_horizon
from cpfls_cli.playback.errors import MODEL, STATED
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.player import Course, Flies
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.windows import RunErrors
from cpfls_cli.simulators.formats import as_stated
from cpfls_cli.simulators.in_mujoco import compiled, controls_of, fly_mujoco
from cpfls_cli.simulators.in_pybullet import fly_pybullet, without_shapes
from cpfls_cli.simulators.literals import Numbers, python_numbers
from cpfls_cli.simulators.model import SimulatorModel
from cpfls_cli.simulators.results import InSimulator
from cpfls_cli.simulators.study import VehicleOf, corrected_files
from cpfls_cli.vehicle.settings import VehicleSettings


def quad_params(file: Path, model: SimulatorModel) -> dict[str, Any]:
    """Make the dictionary that `Multirotor` takes of a module that is not executed, without the noise of motors."""
    found = _nested(python_numbers(file), model.name)
    return dict(found) | {"num_rotors": len(model.rotors), "motor_noise_std": 0.0}


def _nested(numbers: Numbers, *key: str | int) -> Any:
    below = numbers.below(*key)
    if not below:
        return numbers.need(*key).value
    found = {name: _nested(numbers, *key, name) for name in below}
    return np.array(list(found.values())) if isinstance(below[0], int) else found


def fly_rotorpy(parameters: dict[str, Any], course: Course, *, lags: bool, **integrator: Any) -> State:
    """Fly RotorPy's `Multirotor`; see `cpfls_cli.playback.player.Flies`.

    Parameters
    ----------
    integrator : dict
        What `scipy.integrate.solve_ivp` takes; RotorPy's own where there is none.
    """
    from rotorpy.vehicles.multirotor import Multirotor
    from scipy.spatial.transform import Rotation

    more = {"integrator_kwargs": integrator} if integrator else {}
    flown = Multirotor(parameters, control_abstraction="cmd_motor_speeds", **more)
    # It limits commands, and not the speeds of a state that it is given.
    limited = np.clip(course.flight.speed, flown.rotor_speed_min, flown.rotor_speed_max)
    course = replace(course, flight=replace(course.flight, speed=limited))
    begun, start, commands = course.lagged(RotorResponse(lag_s=parameters["tau_m"])), course.start, course.commands

    def along(run: int) -> Iterator[State]:
        now = flown.initial_state | {
            "x": start.position[run],
            "v": start.velocity[run],
            "q": Rotation.from_matrix(start.rotation[run]).as_quat(),
            "w": start.rate[run],
            "rotor_speeds": begun[run],
        }
        for speed in commands[run]:
            now["rotor_speeds"] = now["rotor_speeds"] if lags else speed
            now = flown.step(now, {"cmd_motor_speeds": speed}, course.period)
            yield State(now["x"], now["v"], Rotation.from_quat(now["q"]).as_matrix(), now["w"])

    return course.collected(map(along, range(len(commands))))


def _mujoco(own: Any, given: Any, of: VehicleOf, thrusts: Array) -> Flies:
    # Controls are those that fit the file as given.
    controls = controls_of(given, of.model, thrusts)
    return lambda course, lags: fly_mujoco(own, course, controls, lags=lags)


def _rotorpy(own: Any, _given: Any, _of: VehicleOf, _thrusts: Array) -> Flies:
    return lambda course, lags: fly_rotorpy(own, course, lags=lags)


def _pybullet(own: Any, _given: Any, _of: VehicleOf, _thrusts: Array) -> Flies:
    text, model = own
    return lambda course, _lags: fly_pybullet(text, model, course)


class Simulator(NamedTuple):
    """A simulator that a package brings.

    Attributes
    ----------
    oldest : str
        The oldest version that flies as documented.
    install : str
        What installs it.
    samples : int
        How many samples are flown at most by each of the two files, which takes up to ten seconds.
    load : callable
        Load a file as given or corrected.
    flies : callable
        From what was loaded of a file and of the file as given, the vehicle and thrusts over squared speeds of its
        rotors, shape (rotor,).
    """

    name: str
    package: str
    oldest: str
    install: str
    samples: int
    load: Callable[[Path, VehicleOf], Any]
    flies: Callable[[Any, Any, VehicleOf, Array], Flies]


_EXTRA = install_command("simulators")
SIMULATORS = {
    "mjcf": Simulator(
        *("MuJoCo", "mujoco", "3.2.7", _EXTRA, 100_000), lambda file, of: compiled(file, of.model.file.parent), _mujoco
    ),
    "rotorpy": Simulator(
        *("RotorPy", "rotorpy", "3.0", _EXTRA, 2_500), lambda file, of: quad_params(file, of.model), _rotorpy
    ),
    # It is compiled where there is no wheel for this Python, so that the extra leaves it out there.
    "urdf": Simulator(
        *("PyBullet", "pybullet", "3.2.6", "pip install pybullet", 50_000),
        lambda file, _of: (without_shapes(file.read_bytes()), as_stated(file)),
        _pybullet,
    ),
}
"""By the format of the file."""

_WHICH = {STATED: "as given", MODEL: "as corrected"}


class _NotFlownError(Exception):
    """Why a file was not flown, as one sentence."""


@contextmanager
def _why_not(sentence: str, *, typed: bool = True) -> Iterator[None]:
    """Put an error, maybe with its type, behind the begin of a sentence, which is kept if there is one already.

    Errors are of another package, whose types are its own.
    """
    try:
        yield
    except _NotFlownError:
        raise
    except Exception as error:
        name = type(error).__name__
        text = visible(" ".join(str(error).split()).rstrip("."))
        raise _NotFlownError(f"{sentence}: {f'{name}: ' if typed and text else ''}{text or name}") from error


@dataclass(frozen=True)
class _Flown(PlayedPair):
    """A flight with the file as corrected and as given, flown in the simulator.

    Attributes
    ----------
    flies : mapping of str to callable
        By prediction; all others are those of a playback.
    rotors : array of int, shape (rotor,)
        Rotors of the flight in the order of the file.
    lags : bool
        Whether rotors lag behind what is logged.
    """

    flies: Mapping[str, Flies] = field(kw_only=True)
    rotors: IntArray = field(kw_only=True)
    lags: bool = field(kw_only=True)

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> RunErrors:
        """Fly from samples of the flight."""
        if prediction not in self.flies:
            return super().runs(prediction, starts, horizon)
        course = Course(replace(self.flight, speed=self.flight.speed[:, self.rotors]), starts, horizon)
        with _why_not(f"the file {_WHICH[prediction]} could not be flown"):
            return runs_of(course, self.flies[prediction](course, self.lags))


def runs_of(course: Course, states: State) -> RunErrors:
    """Compare states with a flight; a run that ran away stays as it was before."""
    gone: BoolArray = np.asarray(np.isnan(states.rate).any(axis=2))
    diverged = np.where(gone.any(axis=1), gone.argmax(axis=1), -1)
    last = np.where(diverged < 0, course.horizon, diverged)
    kept = np.minimum(np.arange(1, course.horizon + 1), last[:, None])
    run = np.arange(len(kept))[:, None]
    paths = (np.concatenate([begin[:, None], path], axis=1) for begin, path in zip(course.start, states, strict=True))
    return RunErrors(course.errors(State(*(path[run, kept] for path in paths))), diverged)


def in_simulator(
    of: VehicleOf,
    texts: Mapping[str, bytes],
    stated: VehicleSettings,
    held: Sequence[Signals],
    pairs: Sequence[PlayedPair],
    horizon_s: float,
) -> InSimulator | None:
    """Fly held-out flights in the simulator that a file is of, where its package is installed.

    Parameters
    ----------
    texts, stated
        As in `cpfls_cli.simulators.study.played`.
    held, pairs : sequence
        Held-out flights, and these made ready for playback.
    horizon_s : float, s

    Returns
    -------
    InSimulator or None
        None of a format whose simulator no package brings.
    """
    known = SIMULATORS.get(of.model.format)
    if known is None:
        return None
    why, spec, has = "", find_spec(known.package), _version(known.package)
    # A folder of this name without code is no package.
    if spec is None or spec.origin is None:
        why = f"its package is not installed; {known.install} does"
    elif has and _numbers(has) < _numbers(known.oldest):
        why = f"{known.name} {has} is too old; it needs {known.oldest} or later: pip install -U {known.package}"
    elif not of.order:
        why = f"{of.model.file.name} states no rotors"
    elif any(flight.rotor_speed is None for flight in held):
        why = "the flights have no rotor speeds"
    if why:
        return InSimulator(program=known.name, why_not=why, refused=False, flown=None)
    program = f"{known.name} {has}".strip()
    rotors = np.argsort(of.order)
    thrusts = np.array([stated.rotors[place].thrust_factor_n_s2 for place in rotors])
    name = of.model.file.name
    try:
        with _why_not(f"{name} could not be flown"):
            import_module(known.package)
            with corrected_files(of.model, texts) as after:
                loaded = {}
                for prediction, file in ((STATED, of.model.file), (MODEL, after)):
                    with _why_not(f"it refuses {name} {_WHICH[prediction]}", typed=False):
                        loaded[prediction] = known.load(file, of)
            flies = {which: known.flies(own, loaded[STATED], of, thrusts) for which, own in loaded.items()}
            flown = [
                _Flown(**vars(pair), flies=flies, rotors=rotors, lags=flight.commanded)
                for pair, flight in zip(pairs, held, strict=True)
            ]
            replayed = errors_by_horizon(flown, horizon_s, known.samples)
            change = PlaybackChange.of_pairs(flown, replayed)
    except _NotFlownError as error:
        return InSimulator(program=program, why_not=str(error), refused=True, flown=None)
    return InSimulator(program=program, why_not="", refused=False, flown=change)


def _version(package: str) -> str:
    """Give the version of a package; empty where it was put on the path without being installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)[:3]]
