"""The forms of an export: languages, simulators and libraries, what each holds, how it is written and flown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cpfls_cli.errors import InputError, about
from cpfls_cli.export.holding import NOTHING, Held, Holds, Missing, Off, everything, missing, probe_flight, together
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators import ardupilot, betaflight, crazyflie, px4
from cpfls_cli.export.simulators.crazyflow import crazyflow_held, crazyflow_text
from cpfls_cli.export.simulators.mjcf import mjcf_held, mjcf_text
from cpfls_cli.export.simulators.pegasus import pegasus_held, pegasus_text
from cpfls_cli.export.simulators.pyflyt import NUMBERS, pyflyt_held, pyflyt_text
from cpfls_cli.export.simulators.rotorpy import rotorpy_held, rotorpy_text
from cpfls_cli.export.simulators.sdf import sdf_held, sdf_text
from cpfls_cli.export.simulators.urdf import OTHERWISE, fly_urdf, urdf_held, urdf_text
from cpfls_cli.export.simulators.webots import webots_held, webots_text
from cpfls_cli.export.source import c_source, python_source
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Course

Write = Callable[[Sheet, Held, Sequence[str], str], str]
"""Takes a model, what the target holds of it, what it does not, in words, and the name of the file."""


class Otherwise(NamedTuple):
    """What a form flies otherwise than any sum of weights.

    `words`: what that is. `fly`: from the text of the file and a course to states at the samples behind each start,
    shape (run, horizon, ...); with ``own=False`` without it. `step_s`: longest step that it is flown with.
    """

    words: str
    fly: Callable[..., State]
    step_s: float


@dataclass(frozen=True)
class Form:
    """A form that a model is exported in.

    `held`: from a vehicle to what the form holds of it, and to how it takes weights; `also`: ending of a file that the
    other one needs, empty for none; `lacks`: what no file of this form can state, whatever the vehicle.
    """

    title: str
    ending: str
    held: Callable[[VehicleModel], tuple[Held, Holds]]
    write: Write
    also: str = ""
    lacks: str = ""
    otherwise: Otherwise | None = None


def _whole(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what code holds of a vehicle: everything that follows from its motion and its rotors."""
    return Held.whole(model), everything


def _c(sheet: Sheet, _held: Held, remarks: Sequence[str], file: str) -> str:
    path = Path(file)
    source = c_source(sheet, path.stem, remarks)
    return source.header if path.suffix == ".h" else source.source


FORMS: dict[str, Form] = {
    "json": Form("JSON", ".json", _whole, lambda sheet, _held, remarks, _file: json_text(sheet, remarks)),
    "c": Form("C", ".c", _whole, _c, also=".h"),
    "mjcf": Form("MuJoCo", ".xml", mjcf_held, mjcf_text),
    "sdf": Form("Gazebo's motor model", ".sdf", sdf_held, sdf_text),
    "px4": Form("PX4's Gazebo", ".sdf", sdf_held, px4.px4_text, px4.AIRFRAME),
    "crazyflow": Form("crazyflow", ".toml", crazyflow_held, crazyflow_text),
    "urdf": Form(
        "gym-pybullet-drones", ".urdf", urdf_held, urdf_text, otherwise=Otherwise(OTHERWISE, fly_urdf, step_s=1e-3)
    ),
    "ardupilot": Form(
        "ArduPilot's SITL",
        ".json",
        ardupilot.ardupilot_held,
        ardupilot.ardupilot_text,
        otherwise=Otherwise(ardupilot.OTHERWISE, ardupilot.fly_ardupilot, ardupilot.STEP_S),
    ),
    "rotorpy": Form("RotorPy", ".py", rotorpy_held, rotorpy_text),
    "pegasus": Form("Pegasus Simulator", ".py", pegasus_held, pegasus_text),
    "pyflyt": Form("PyFlyt", ".urdf", pyflyt_held, pyflyt_text, NUMBERS),
    "webots": Form("Webots", ".proto", webots_held, webots_text),
    "crazyflie": Form(
        "the Crazyflie's header", ".h", crazyflie.crazyflie_held, crazyflie.crazyflie_text, lacks=crazyflie.LACKS
    ),
    "betaflight": Form(
        "Betaflight's mixer", ".txt", betaflight.betaflight_held, betaflight.betaflight_text, lacks=betaflight.LACKS
    ),
    "px4params": Form("PX4's geometry", ".params", px4.px4_held, px4.px4_parameters, lacks=px4.LACKS),
    "casadi": Form(
        "CasADi", ".py", _whole, lambda sheet, _, remarks, file: python_source(sheet, file, "casadi", remarks)
    ),
    "jax": Form("JAX", ".py", _whole, lambda sheet, _, remarks, file: python_source(sheet, file, "jax", remarks)),
}
"""All, by the word of ``--format``."""


@dataclass(frozen=True)
class Exported:
    """A model in a form: the text of each file by name, the one that needs the others last.

    `remarks`: what the form does not hold, in words.
    """

    texts: dict[str, str]
    held: Held
    missing: tuple[Missing, ...]
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """Of the file that needs the others."""
        return list(self.texts.values())[-1]


def exported(sheet: Sheet, form: str, file: str) -> Exported:
    """Write a model in one of `FORMS`."""
    chosen = FORMS[form]
    with about(sheet.file, InputError):
        held, holds = chosen.held(sheet.model)
    left, remarks = _left(sheet, held, holds, chosen)
    files = [Path(file).with_suffix(ending).name for ending in (chosen.also, chosen.ending) if ending]
    return Exported({name: chosen.write(sheet, held, remarks, name) for name in files}, held, left, remarks)


def _left(sheet: Sheet, held: Held, holds: Holds, form: Form) -> tuple[tuple[Missing, ...], tuple[str, ...]]:
    """List what is left of a vehicle, and say so."""
    about_hover = missing(sheet.model, held, holds, np.array(sheet.floor), sheet.wind)
    left = (*about_hover, *_otherwise(sheet, held, form), *sheet.outside)
    remarks = (*([form.lacks] if form.lacks else []), *(each.sentence for each in left))
    if len(about_hover) - any(sheet.wind) > 1:
        off = together(sheet.model, held).sentence
        remarks = (*remarks, f"In all, {form.title} ends {off} off after half a second about hover.")
    return left, remarks or (f"{form.title} holds all of it.",)


def _otherwise(sheet: Sheet, held: Held, form: Form) -> Iterator[Missing]:
    """Compute how far half a second about hover ends off by what a form does otherwise than a sum of weights."""
    if form.otherwise is None:
        return
    words, fly, step_s = form.otherwise
    flight = probe_flight(sheet.model)
    horizon = len(flight) // len(flight.stretches) - 1
    finer = max(1, round(flight.motion.period / step_s))
    course = Course(flight, flight.starts(horizon, 1), horizon, finer, gravity=held.body.gravity)
    text = form.write(sheet, held, (), f"uav{form.ending}")
    ends = [course.errors(fly(text, course, own=own))[:, -1] for own in (True, False)]
    off = Off.of(np.linalg.norm(ends[0] - ends[1], axis=2).mean(axis=0))
    if max(off) > NOTHING:
        yield Missing(words, 0.0, 0.0, np.nan, off)
