"""Held-out flights flown in the simulator itself by its own file, as given and as corrected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import install_command, visible
from cpfls_cli.gap.before_after import PlaybackChange, PlayedPair, errors_by_horizon
from cpfls_cli.playback.course import Course, Flies
from cpfls_cli.playback.errors import MODEL, STATED
from cpfls_cli.playback.motion import State
from cpfls_cli.playback.player import Runs
from cpfls_cli.simulators.formats import as_stated
from cpfls_cli.simulators.in_mujoco import compiled, controls_of, fly_mujoco
from cpfls_cli.simulators.in_pybullet import fly_pybullet, without_shapes
from cpfls_cli.simulators.in_rotorpy import fly_rotorpy, quad_params
from cpfls_cli.simulators.results import InSimulator
from cpfls_cli.simulators.study import VehicleOf, corrected_files
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import Recording


def _mujoco(file: Path, of: VehicleOf, thrusts: Array) -> Flies:
    folder = of.model.file.parent
    # Controls are those that fit the file as given.
    controls = controls_of(compiled(of.model.file, folder), of.model, thrusts)
    made = compiled(file, folder)
    return lambda course, lags: fly_mujoco(made, course, controls, lags=lags)


def _rotorpy(file: Path, of: VehicleOf, _thrusts: Array) -> Flies:
    parameters = quad_params(file, of.model)
    return lambda course, lags: fly_rotorpy(parameters, course, lags=lags)


def _pybullet(file: Path, _of: VehicleOf, _thrusts: Array) -> Flies:
    text, model = without_shapes(file.read_bytes()), as_stated(file)
    return lambda course, _lags: fly_pybullet(text, model, course)


class Simulator(NamedTuple):
    """A simulator that a package brings.

    Attributes
    ----------
    install : str
        What installs it.
    samples : int
        How many samples are flown at most by each of the two files, which takes up to ten seconds.
    loaded : callable
        From a file as given or corrected, the vehicle and thrusts over squared speeds of its rotors, shape (rotor,).
    """

    name: str
    package: str
    install: str
    samples: int
    loaded: Callable[[Path, VehicleOf, Array], Flies]


_EXTRA = install_command("simulators")
SIMULATORS = {
    "mjcf": Simulator("MuJoCo", "mujoco", _EXTRA, 100_000, _mujoco),
    "rotorpy": Simulator("RotorPy", "rotorpy", _EXTRA, 2_500, _rotorpy),
    # It is compiled where there is no wheel for this Python, so that the extra leaves it out there.
    "urdf": Simulator("PyBullet", "pybullet", "pip install pybullet", 50_000, _pybullet),
}
"""By the format of the file."""


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

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> Runs:
        """Fly from samples of the flight."""
        if prediction not in self.flies:
            return super().runs(prediction, starts, horizon)
        course = Course(replace(self.flight, speed=self.flight.speed[:, self.rotors]), starts, horizon)
        return runs_of(course, self.flies[prediction](course, self.lags))


def runs_of(course: Course, states: State) -> Runs:
    """Compare states with a flight; a run that ran away stays as it was before."""
    gone: BoolArray = np.asarray(np.isnan(states.rate).any(axis=2))
    diverged = np.where(gone.any(axis=1), gone.argmax(axis=1), -1)
    last = np.where(diverged < 0, course.horizon, diverged)
    kept = np.minimum(np.arange(1, course.horizon + 1), last[:, None])
    run = np.arange(len(kept))[:, None]
    paths = (np.concatenate([begin[:, None], path], axis=1) for begin, path in zip(course.start, states, strict=True))
    return Runs(course.errors(State(*(path[run, kept] for path in paths))), diverged)


def in_simulator(
    of: VehicleOf,
    texts: Mapping[str, bytes],
    stated: VehicleSettings,
    held: Sequence[Recording],
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
    why = ""
    if find_spec(known.package) is None:
        why = f"its package is not installed; {known.install} does"
    elif not of.order:
        why = f"{of.model.file.name} states no rotors"
    elif any(recording.signals.rotor_speed is None for recording in held):
        why = "the flights have no rotor speeds"
    if why:
        return InSimulator(program=known.name, why_not=why, flown=None)
    program = f"{known.name} {version(known.package)}"
    rotors = np.argsort(of.order)
    thrusts = np.array([stated.rotors[place].thrust_factor_n_s2 for place in rotors])
    try:
        with corrected_files(of.model, texts) as after:
            flies = {STATED: known.loaded(of.model.file, of, thrusts), MODEL: known.loaded(after, of, thrusts)}
        flown = [
            _Flown(**vars(pair), flies=flies, rotors=rotors, lags=recording.signals.commanded)
            for pair, recording in zip(pairs, held, strict=True)
        ]
        replayed = errors_by_horizon(flown, horizon_s, known.samples)
    except Exception as error:  # Of another package, whose kinds of errors are its own; the answer does not hang on it.
        lines = str(error).splitlines() or [type(error).__name__]
        return InSimulator(program=program, why_not=f"it refuses {of.model.file.name}: {visible(lines[0])}", flown=None)
    return InSimulator(program=program, why_not="", flown=PlaybackChange.of_pairs(flown, replayed))
