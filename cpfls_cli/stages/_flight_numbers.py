"""Numbers of a flight, as `changed` and `trend` keep them in their folders, and the words of both."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from cpfls_cli import store
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.changes.numbers import FlightNumbers, StatedFact
from cpfls_cli.changes.numbers import flight_numbers as numbers_of
from cpfls_cli.changes.results import CANNOT_TELL, Found, Shows
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.errors import InputError, visible
from cpfls_cli.flightlog.stated_vehicle import autopilots_apart, ranges_apart, stated_vehicle, vehicles_apart
from cpfls_cli.flights.recordings import read_alone
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.pages.trust import contradicted
from cpfls_cli.report.content import number
from cpfls_cli.result import Estimate
from cpfls_cli.stage import Run, stage
from cpfls_cli.version import code_fingerprint
from cpfls_cli.words import by_name, joined

_HEAVY = 1000.0  # Grams that are written in kg.
_SCALES: Mapping[str, Callable[[float], float]] = {
    "%": lambda size: 100 * size,
    "root": lambda size: 100 * math.expm1(0.5 * size),
    "half": lambda size: 50 * size,
    "ln": lambda size: 100 * math.expm1(size),
    "times": math.exp,
    "ms": lambda size: 1e3 * size,
    "mm": lambda size: 1e3 * size,
    "°": math.degrees,
}
"""From the unit of a change to what the table writes: of logarithms of squares the root, or near 0 half of it."""
_UNITS = {"root": " %", "half": " %", "ln": " %", "times": " times", "°": "°"}
_SHOWN_FIRST = ("rotor M1", "mass", "centre of mass", "vibration", "delay", "gusts")
"""Detection limits, as many as a first screen has room for; of rotors the largest one."""

_OTHERS = 3  # Detection limits, where there is none of those.
_CHECKED = 2
MOST_MOVED = 3  # Numbers that are named where no known change explains them.
_NATURAL = {
    "thrust": "",
    "turn": "",
    "vibration gyroscope": "rad/s",
    "vibration accelerometer": "m/s²",
    "unbalance": "m/s²",
    "gain": "",
    "scale": "",
    "gusts": "rad/s²",
}
"""Units of numbers that are logarithms, without their axis: of what they are the logarithm of."""


class _Amount(NamedTuple):
    """Sizes of a change, or the smallest that shows, as a sentence of the table asks for them."""

    sizes: Sequence[Estimate | float]
    mass_kg: float
    axes: Sequence[str] | None = None

    def __format__(self, spec: str) -> str:
        unit, _, ways = spec.partition(" ")
        sizes = [size for size in self.sizes if isinstance(size, Estimate)]
        if not sizes:
            scale, name = self._scale(unit, least := float(self.sizes[0]))  # type: ignore[arg-type]
            return f"{number(abs(scale(least)) if unit == 'mass' else scale(least), 2)}{name}"
        if self.axes is not None:
            scale, name = self._scale(unit, 1.0)
            shown = [f"{number(scale(size.value), 2)}{name} {ways} {axis}" for size, axis in zip(sizes, self.axes)]  # noqa: B905
            return joined([each for each, size in zip(shown, sizes) if _is_clear(size)] or shown)  # noqa: B905
        return joined(self.one(size, unit, ways) for size in sizes)

    def one(self, size: Estimate, unit: str, ways: str) -> str:
        """Write how much a size is, which way, and its interval turned alike."""
        scale, name = self._scale(unit, size.value)
        value, low, high = (scale(each) for each in (size.value, size.low, size.high))
        if unit == "times":
            return f"{number(value, 2)} times as strong ({number(low, 2)} to {number(high, 2)})"
        if value < 0:
            value, low, high = -value, -high, -low
        way = f" {ways.split('/')[int(size.value <= 0)]}" if ways else ""
        return f"{number(value, 2)}{name}{way} ({number(low, 2)} to {number(high, 2)}{name})"

    def _scale(self, unit: str, size: float) -> tuple[Callable[[float], float], str]:
        if unit in ("mass", "g"):
            heavy = unit == "mass" and abs(1e3 * self.mass_kg * size) >= _HEAVY
            return (lambda share: (1 if heavy else 1e3) * self.mass_kg * share), " kg" if heavy else " g"
        return _SCALES.get(unit, float), _UNITS.get(unit, f" {unit}")


def _is_clear(size: Estimate) -> bool:
    return size.low * size.high > 0


@cache
def _table() -> Mapping[str, Mapping[str, str]]:
    path = Path(__file__).parents[1] / "templates" / "causes.yaml"
    table: Mapping[str, Mapping[str, str]] = yaml.safe_load(path.read_text(encoding="utf-8"))
    return table


def _said(cause: str, what: str, **given: object) -> str | None:
    kind, _, of = cause.partition(" ")
    text = _table().get(kind, {}).get(what)
    rotor = f"rotor {of}" if of else "the rotors" if what == "changed" else "rotors"
    return None if text is None else text.format(of=of, rotor=rotor, **given)


def cause_name(cause: str) -> str:
    """Name a change without its size."""
    return _said(cause, "name") or cause


def what_to_check(cause: str) -> str:
    """Say what to look at by hand."""
    return _said(cause, "check") or "look at the numbers that changed"


def change_words(found: Found, mass_kg: float, names: Iterable[str]) -> str:
    """Say what changed and by how much; of some changes the sizes are along axes of numbers with these names."""
    size, axes = found.sizes[0], [name.split()[-1] for name in names if name.split()[0] == found.name]
    given = {"size": _Amount(found.sizes, mass_kg), "each": _Amount(found.sizes, mass_kg, axes)}
    cable = number(np.nan if found.cable_m is None else found.cable_m, 2)
    either, place = _either(mass_kg, size.value), _place(found.sizes)
    said = _said(found.name, "changed", **given, cable=cable, either=either, place=place)
    return said or f"{found.name}: {number(size.value, 2)}"


def smallest_words(cause: str, size: float, mass_kg: float) -> str:
    """Say what the detection limit of a change is."""
    return _said(cause, "shows", least=_Amount([size], mass_kg)) or f"{cause}: {number(size, 2)}"


def _either(mass_kg: float, share: float) -> str:
    """Say what it can be that hover needs another thrust."""
    weight = f"{_Amount([abs(share)], mass_kg):mass}"
    return f"{weight} {'heavier' if share > 0 else 'lighter'}, or all rotors pull {'less' if share > 0 else 'more'}"


def hover_words(mass_kg: float, share: float, *, alone: bool) -> str:
    """Say what hover needs, and where that is all that is known what it can be."""
    needs = f"needs {number(100 * abs(share), 2)} % {'more' if share > 0 else 'less'} thrust"
    return f"{needs}: {_either(mass_kg, share)}" if alone else f"{needs} than in the reference"


def _place(sizes: Sequence[Estimate]) -> str:
    ways = ("to the front/to the back", "to the left/to the right")
    pairs = list(zip(sizes, ways))  # noqa: B905
    shown = [_Amount([size], 0.0).one(size, "mm", way) for size, way in pairs if _is_clear(size)]
    return joined(shown) if shown else "elsewhere, by too little to say where"


def is_within(other: str, cause: str) -> bool:
    """Check whether a pair of rotors holds the one that changed, or a mass what it does."""
    of_pair = cause.startswith("rotor ") and other.startswith("rotors ") and cause.split()[-1] in other.split()
    return of_pair or (cause in ("hover", "centre of mass") and other == "mass")


def checks(found: Sequence[Found]) -> Iterator[tuple[str, str]]:
    """Say what to look at by hand; with the name of the change where there are several."""
    looked: dict[str, str] = {}
    for each in found:
        for name in (each.name, *(() if each.named else (own.name for own in each.alike))):
            looked.setdefault(what_to_check(name), cause_name(name))
    yield from ((check, name if len(looked) > 1 else "") for check, name in list(looked.items())[:_CHECKED])


def detection_limits(shows: Sequence[Shows], mass_kg: float) -> list[str]:
    """Say what the detection limits of changes are."""
    smallest = {each.cause: each.smallest for each in shows}
    smallest["rotor M1"] = max((size for name, size in smallest.items() if name.startswith("rotor ")), default=np.nan)
    known = [name for name, size in smallest.items() if np.isfinite(size)]
    listed = [name for name in _SHOWN_FIRST if name in known] or known[:_OTHERS]
    return [smallest_words(name, smallest[name], mass_kg) for name in listed]


def most_moved(names: Sequence[str], deviations: Array) -> str:
    """List the numbers that differ most, in deviations."""
    most = np.argsort(-np.abs(deviations), kind="stable")[:MOST_MOVED]
    return f"{joined(f'{names[at]} by {deviations[at]:+.1f}' for at in most)} deviations"


def number_meanings(names: Iterable[str]) -> str:
    """Define the kinds of numbers that a table lists, each once."""
    kinds = dict.fromkeys(name.split()[0] for name in names)
    means = ((kind, _table().get(kind, {}).get("means")) for kind in kinds)
    return "; ".join(f"{kind}: {text}" for kind, text in means if text)


def natural_unit(name: str) -> str | None:
    """Give the unit of what a number is the logarithm of; None where it is none."""
    kind, _, rest = name.partition(" ")
    return _NATURAL.get(kind, _NATURAL.get(f"{kind} {rest.rpartition(' ')[0]}"))


WORDS = {
    **by_name(cause_name, change_words, hover_words, smallest_words, is_within, checks, detection_limits, most_moved),
    **by_name(number_meanings, natural_unit),
}
"""For templates."""


FOLDER = "flights"
"""Of the folder that a command fills, where numbers are kept."""

_HASH = 8
"""Digits by which flights of one name are kept apart."""


def kept_numbers(
    flight: Path, file: InputFile, study: Study, folder: Path, cautions: Iterable[str] = ()
) -> FlightNumbers:
    """Give the numbers of a flight or log as they are kept in a folder, or compute them and keep them there.

    Those that are kept are taken where content, vehicle and import are the same, and the code of the program.
    InputError if the flight has none.
    """
    kept = find_kept(flight, file, study, folder)
    if kept is not None:
        return kept
    read = read_alone(flight, study)
    has_gyroscope = "body_rate" in read.flight.signals
    made = replace(
        numbers_of(read.signals, read.full_voltage, has_gyroscope=has_gyroscope),
        flown_at_s=read.flight.flown_at,
        code=code_fingerprint(),
        contradictions=tuple(read.contradictions),
        warnings=tuple(read.warnings),
        stated=tuple(StatedFact(name=name, value=value) for name, value in read.flight.stated.items()),
    )
    folder.mkdir(parents=True, exist_ok=True)
    origin = store.Origin(
        stage="flight-numbers",
        inputs={"flight": file},
        seed=study.seed,
        config=resolved_yaml(study),
        cautions=tuple(map(visible, cautions)),
    )
    store.write(_path(flight, file, folder), made, origin)
    return made


def stated_of(flight: Path) -> dict[str, str]:
    """Read what a log states of its vehicle, whatever else it holds; nothing where it cannot be read."""
    if not is_log(flight):
        return {}
    try:
        contents = log_contents(flight, ())
    except InputError:
        return {}
    return stated_vehicle(contents.system, contents.parameters)


def _path(flight: Path, file: InputFile, folder: Path) -> Path:
    return folder / f"{flight.name}-{file.sha256[:_HASH]}.h5"


def find_kept(flight: Path, file: InputFile, study: Study, folder: Path) -> FlightNumbers | None:
    """Give the numbers of a flight as they are kept in a folder; None where those of another content or config are."""
    path = _path(flight, file, folder)
    if not path.is_file():
        return None
    try:
        kept, origin = store.read(path, FlightNumbers)
        made_by = stored_study(origin.config, path)
    except InputError:
        return None
    same = origin.inputs["flight"].sha256 == file.sha256 and kept.code == code_fingerprint()
    return kept if same and _of_flight(made_by) == _of_flight(study) else None


def _of_flight(study: Study) -> tuple[object, ...]:
    """Give what of a study the numbers of a flight follow from: a delay that is not given is found in a share of it."""
    return study.vehicle, study.import_, study.identification.training_share


CANNOT_TELL_CODE = 3
"""Exit code where it cannot be said whether a vehicle changed."""

_APART = 3
"""Facts that are named where two logs are of different vehicles."""


@stage(FlightNumbers, title="Numbers of each flight", words=WORDS, study=True)
def flight_numbers(run: Run, flight: Path) -> FlightNumbers:
    """Compute the numbers of a flight, or take those that are kept in the folder of the output."""
    return kept_numbers(flight, run.take({"flight": flight})["flight"], run.study, run.sibling(FOLDER), run.cautions)


def exit_code(verdict: str, *, fail_on_change: bool = False) -> int:
    """Give the exit code of a verdict."""
    return CANNOT_TELL_CODE if verdict == CANNOT_TELL else int(fail_on_change and verdict == "CHANGED")


def first_of_each(contradictions: Sequence[str]) -> list[str]:
    """Say of each flight that contradicts itself what comes first."""
    return [contradicted(each) for each in {own.partition(": ")[0]: own for own in reversed(contradictions)}.values()]


def of_other_vehicles(stated: Sequence[tuple[str, Mapping[str, str]]], *, anyway: bool) -> list[str]:
    """Refuse flights whose logs say that they are of different vehicles, or warn of them where that is asked for.

    Flights that state nothing of their vehicles are passed over.
    """
    (first, own), *others = [each for each in stated if each[1]] or [("", {})]
    warnings = []
    for name, facts in others:
        apart = vehicles_apart(own, facts)
        if apart:
            differ = f"{first} and {name} are of different vehicles ({'; '.join(apart[:_APART])})"
            if not anyway:
                raise InputError(f"{differ}: compare flights of one vehicle, or give --anyway")
            warnings.append(f"{differ}, and are compared anyway")
    return warnings


def of_other_autopilots(flights: Sequence[FlightNumbers], *, thrusts: bool) -> tuple[list[str], list[str]]:
    """List where logs state another board, version or range of outputs, and whose shares of thrust that touches.

    `thrusts`: whether shares of thrust are compared; of commands they are shares of full throttle.
    """
    (first, own), *others = [each for each in stated_by(flights) if each[1]] or [("", {})]
    unlike, ranges = [], []
    for name, facts in others:
        apart = autopilots_apart(own, facts)
        if apart:
            unlike.append(f"the logs of {first} and {name} state {', '.join(apart)}")
        if thrusts and flights[0].commanded and ranges_apart(own, facts):
            ranges.append(name)
    return unlike, ranges


def without_voltage(which: str) -> str:
    """Say of which flights by commands the voltage of the battery is not known, and why it matters."""
    return (
        f"without the battery's voltage: {which}; an emptier battery looks like a heavier vehicle, so name "
        "import.signals.voltage"
    )


def stated_by(flights: Sequence[FlightNumbers]) -> list[tuple[str, Mapping[str, str]]]:
    """Give what the logs of flights state of their vehicles, with the names of the flights."""
    return [(own.name, own.facts) for own in flights]


def contradictions_of(flights: Sequence[FlightNumbers]) -> list[str]:
    """List what of flights contradicts itself or its vehicle, each with the name of its flight."""
    return [f"{own.name}: {words}" for own in flights for words in own.contradictions]
