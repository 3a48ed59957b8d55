"""A model as an object: predictions, replays as the command makes them, single steps, and exports."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpfls_cli.errors import CpflsError, InputError
from cpfls_cli.library.artifact import Artifact, _read, read

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike

    from cpfls_cli.config.study import Study
    from cpfls_cli.flights.prediction import AlongFlight
    from cpfls_cli.playback.flight import State
    from cpfls_cli.playback.model import VehicleModel
    from cpfls_cli.playback.rotors import Hold
    from cpfls_cli.report.content import Outcome
    from cpfls_cli.stage import Run


def run(*words: str | os.PathLike[str]) -> None:
    """Run a command in this process and print what it prints: ``run("info", "flight.h5")`` is ``cpfls info flight.h5``.

    Parameters
    ----------
    *words : str or path
        The command, its arguments and its options, each by itself.

    Raises
    ------
    CpflsError
        If the command fails; its message is on standard error.
    """
    from cpfls_cli.cli.stages import app

    given = [str(word) for word in words]
    try:
        app(given, prog_name="cpfls")
    except SystemExit as end:
        if end.code:
            raise CpflsError(f"cpfls {' '.join(given)}: exit code {end.code}, see standard error") from None


def load_model(path: str | os.PathLike[str], config: str | os.PathLike[str] | None = None) -> Model:
    """Load a model.

    Parameters
    ----------
    path : str or path
        Made by ``cpfls identify``, ``extend``, ``gap`` or ``vehicle``.
    config : str or path, optional
        Config of the flights that it is held against, as ``cpfls replay`` takes one; without it the one that made
        the model.

    Raises
    ------
    InputError
        If the file is no good model; the message says why.
    """
    from cpfls_cli.artifacts.model import AnyModel
    from cpfls_cli.config.load import load_study, validate
    from cpfls_cli.flights.models import MAKERS

    artifact = read(path)
    if not isinstance(artifact._record, AnyModel):
        raise InputError(f"{path}: is a {artifact.format}, not a model; models are made by {MAKERS}")
    study = validate(artifact.config, f"{path}: /config") if config is None else load_study(Path(config))
    return Model(artifact.path, study, artifact)


def stated_vehicle(config: str | os.PathLike[str]) -> Model:
    """Take the vehicle that a config states for a model, to hold others against.

    Raises
    ------
    ConfigError
        If the config is not good; the message names every wrong key.
    """
    from cpfls_cli.config.load import load_study
    from cpfls_cli.playback.settings import VEHICLE

    return Model(Path(VEHICLE), load_study(Path(config)), None)


class Model:
    """A model of a multirotor.

    Besides the methods listed, ``to_c(path)``, ``to_jax(path)`` and so on export it, one for each of `formats`.

    Attributes
    ----------
    artifact : Artifact or None
        The file that it was loaded from: its numbers, its summary, its figures; None for a stated vehicle.
    """

    def __init__(self, path: Path, study: Study, artifact: Artifact | None) -> None:
        self._path = path
        self._study = study
        self.artifact = artifact

    def __repr__(self) -> str:
        return f"<model {self._path}>" if self.artifact else "<vehicle as stated>"

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(f"to_{form}" for form in self.formats)]

    def __getattr__(self, name: str) -> Callable[..., list[Path]]:
        if name.startswith("to_") and name.removeprefix("to_") in self.formats:
            return partial(self.export, form=name.removeprefix("to_"))
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)

    def predict(self, flight: str | os.PathLike[str] | Artifact) -> AlongFlight:
        """Predict torque and inertia along a flight, of a whole vehicle force as well.

        Parameters
        ----------
        flight : str, path or Artifact
            Made by ``cpfls simulate`` or ``cpfls import``.

        Returns
        -------
        AlongFlight
            Arrays by name: of the model, and what was measured.
        """
        from cpfls_cli.flights.prediction import along_flight

        found, noted = along_flight(self._file("predict"), _path_of(flight), self._study)
        for each in noted:
            warnings.warn(each, stacklevel=2)
        return found

    def replay(
        self,
        *flights: str | os.PathLike[str] | Artifact,
        horizon_s: float = 0.5,
        every: int = 1,
        hold: Hold | None = None,
        history_s: float = 0.0,
    ) -> Artifact:
        """Play it back along flights from every sample, as ``cpfls replay`` does.

        Parameters
        ----------
        *flights : str, path or Artifact
            Flights, or logs that the config describes.
        horizon_s : float
            Longest horizon, s.
        every : int
            Begin at every n-th sample.
        hold : {"linear", "previous"}, optional
            What a rotor speed is between samples; without it, measured ones the first, commands the second.
        history_s : float
            How much of the flight before a start is used, s, by a forecast that ``cpfls vehicle`` found for that.

        Returns
        -------
        Artifact
            Of the format ``cpfls/replay``, in memory.
        """
        if not flights:
            raise InputError("replay needs at least one flight")
        from tempfile import TemporaryDirectory

        from cpfls_cli.arguments import Between
        from cpfls_cli.stages.replay import replay

        given: dict[str, Any] = {"flights": [_path_of(flight) for flight in flights], "every": every}
        given |= {"horizon": horizon_s, "history": history_s, "hold": None if hold is None else Between(hold)}
        with TemporaryDirectory(prefix="cpfls-") as folder:
            output = Path(folder, "artifact.h5")
            _warn(replay.run(self._run(output, force=False), model=self._path, **given), 3)
            return _read(output)

    def state(
        self,
        position: ArrayLike = (0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        attitude: ArrayLike = (0.0, 0.0, 0.0),
        body_rate: ArrayLike = (0.0, 0.0, 0.0),
    ) -> State:
        """Make a state to begin with, of one vehicle or of many side by side; without arguments at rest and level.

        Parameters
        ----------
        position, velocity : array, shape (3,) or (vehicles, 3), m and m/s, world frame, z up
        attitude : array, shape (3,) or (vehicles, 3), rad
            Roll, pitch, yaw.
        body_rate : array, shape (3,) or (vehicles, 3), rad/s, body frame

        Returns
        -------
        State
            A tuple of position, velocity, rotation (body to world) and rate, all of one number of vehicles.
        """
        import numpy as np

        from cpfls_cli.playback.flight import State
        from cpfls_cli.rotations import rotation_matrix

        given = [np.atleast_2d(np.asarray(part, dtype=float)) for part in (position, velocity, attitude, body_rate)]
        place, speed, angles, rate = np.broadcast_arrays(*given)
        return State(place.copy(), speed.copy(), rotation_matrix(angles), rate.copy())

    def step(self, state: State, rotor_speed: ArrayLike, period: float) -> State:
        """Move vehicles on by one midpoint step, in the wind of the model, with rotors that keep their speeds.

        Parameters
        ----------
        state : State
            See `state`.
        rotor_speed : array, shape (rotors,) or (vehicles, rotors), rad/s
            That acts: no delay or lag is between it and the thrust; `fly` has both.
        period : float, s

        Returns
        -------
        State
            After the step.

        Raises
        ------
        InputError
            If the model holds an effect that depends on more than the state, such as a load on a cable.
        """
        import numpy as np

        from cpfls_cli.playback.player import one_step
        from cpfls_cli.playback.rotors import steady_terms

        speed = np.atleast_2d(np.asarray(rotor_speed, dtype=float))
        self._require_rotors(speed)
        many = np.broadcast_to(speed, (len(state.rate), speed.shape[1]))
        return one_step(self._whole, state, steady_terms(many), period)

    def fly(
        self, state: State, rotor_speed: ArrayLike, period: float, hold: Hold = "previous", *, logged: bool = False
    ) -> State:
        """Fly one vehicle along rotor speeds, with the delay and the lag of the model's rotors; raises as `step`.

        Parameters
        ----------
        state : State
            Of one vehicle, see `state`.
        rotor_speed : array, shape (time, rotors), rad/s
            Commanded or measured, one row for each sample.
        period : float, s
        hold : {"linear", "previous"}
            What a speed is between samples: a straight line, or what it was.
        logged : bool
            Whether commands are a log's, which held until the next sample are half a period late already.

        Returns
        -------
        State
            At each sample, the first one being what was given; its arrays have time as their first axis.
        """
        import numpy as np

        from cpfls_cli.playback.flight import State
        from cpfls_cli.playback.model import commanded_anew
        from cpfls_cli.playback.player import one_step

        speed = np.atleast_2d(np.asarray(rotor_speed, dtype=float))
        self._require_rotors(speed)
        if len(state.rate) != 1:
            raise InputError(f"fly takes one vehicle, the state holds {len(state.rate)}; step takes many")
        path, late = [state], period if logged and hold == "previous" else 0.0
        for terms in commanded_anew(self._whole, late).response.terms_by_step(speed, period, hold)[:-1]:
            path.append(one_step(self._whole, path[-1], terms[None], period))
        return State(*(np.concatenate(parts) for parts in zip(*path, strict=True)))

    @property
    def formats(self) -> tuple[str, ...]:
        """The forms in which it can be exported."""
        from cpfls_cli.stages.export import ENDINGS

        return tuple(ENDINGS)

    def export(
        self, path: str | os.PathLike[str], form: str | None = None, name: str | None = None, *, force: bool = False
    ) -> list[Path]:
        """Write it for another program, as ``cpfls export`` does.

        Parameters
        ----------
        form : str, optional
            One of `formats`; without it, by the ending of the path.
        name : str, optional
            Prefix of names in C, name in JSON; without it, from the name of the file.
        force : bool
            Replace existing files, and export what was stopped, is not to be used, or has impossible numbers.

        Returns
        -------
        list of Path
            The files written.
        """
        from cpfls_cli.stages.export import Formats, export

        chosen = None if form is None else Formats(form)
        outcome = export.run(
            self._run(Path(path), force), model=self._file("export"), format=chosen, name=name, anyway=force
        )
        _warn(outcome, 3)
        return [Path(file) for file in outcome.summary["output"]]

    @cached_property
    def _whole(self) -> VehicleModel:
        """The model with its rotors, as far as a state and rotor speeds alone give its motion, as flights show it."""
        from cpfls_cli.flights.models import modelled
        from cpfls_cli.playback.model import VehicleModel

        if self.artifact is None:
            return VehicleModel(vehicle=self._study.vehicle)
        record: Any = self.artifact._record
        model = modelled(self._path, record)
        if model.unsimulated:
            parts = ", ".join(model.unsimulated)
            raise InputError(f"{self._path}: holds {parts}, which depends on more than the state; use Model.replay")
        return model

    def _require_rotors(self, speed: Any) -> None:
        if speed.shape[-1] != self._whole.rotors:
            raise InputError(f"rotor_speed: has shape {speed.shape}; the last axis is {self._whole.rotors} rotors")

    def _file(self, task: str) -> Path:
        if self.artifact is None:
            raise InputError(f"{task} needs a model that a command found; a stated vehicle takes replay, step and fly")
        return self._path

    def _run(self, output: Path, force: bool) -> Run:
        from cpfls_cli.stage import Run

        return Run(self._study, output, force, dry_run=False, progress=lambda *_: None, reads=lambda _: None)


def _path_of(flight: str | os.PathLike[str] | Artifact) -> Path:
    return flight.path if isinstance(flight, Artifact) else Path(flight)


def _warn(outcome: Outcome, caller: int) -> None:
    """Pass on what a command notes on standard error, as warnings of whoever called the library."""
    from cpfls_cli.report.terminal import warnings_of

    for warning in warnings_of(outcome.blocks):
        warnings.warn(warning.text, stacklevel=caller)
