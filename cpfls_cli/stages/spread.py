"""Draw vehicles from what flights leave possible, for simulators that fly many: .yaml, .json or .npz."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from cpfls_cli.arguments import ExportAnywayOption
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.vehicle_model import name_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.export.sheet import EXPORTER, GUST_RECIPE, LACK_RECIPE, Sheet
from cpfls_cli.export.source import jax_parameters, jax_parts
from cpfls_cli.export.text import identifier, strict_json, yaml_text
from cpfls_cli.flights.models import any_model, found_vehicle, is_found, is_model
from cpfls_cli.inertia import symmetric
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.gusts import GUST_AXES
from cpfls_cli.playback.model import VehicleModel, commanded_anew
from cpfls_cli.playback.parameters import CURVE, FoundNumber
from cpfls_cli.playback.spread import Spread, drawn, require_sure
from cpfls_cli.result import about as described
from cpfls_cli.result import result
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages.export import sheet_of

ENDINGS = (".yaml", ".json", ".npz")

_CONVENTIONS = (
    "Body frame x forward, y left, z up, its origin the centre of mass; SI. Entry k of every column belongs to vehicle "
    "k, and all entries k belong together: numbers that the flights identify only by their ratio differ together. "
    "Rotor i pushes thrust_factor w^2 along z and turns the body by -spin drag_factor w^2 about z; with "
    f"{CURVE} a, w^2 becomes (1 - a) w^2 + a w_h w, w_h the speed that hovers by the square. Commands act "
    "after delay_s through a first-order lag of motor_lag_s."
)
_ENDS = (2.5, 97.5)


class Column(NamedTuple):
    """A number, or several, of each vehicle; the unit says what its axes are."""

    values: Array
    unit: str


class Range(NamedTuple):
    """A number over all vehicles: the estimate, and what 95 % of them lie between."""

    unit: str
    value: float
    low: float
    high: float
    determined: bool


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Vehicles that were drawn from a model, and all that has to be known of them.

    Attributes
    ----------
    not_determined : tuple of str
        Numbers that the flights do not identify.
    held : tuple of str
        Guesses, of which flights say nothing: they do not differ.
    """

    sheet: Sheet
    spread: Spread
    numbers: Mapping[str, FoundNumber]
    seed: int
    not_determined: tuple[str, ...]
    held: tuple[str, ...]

    @property
    def columns(self) -> dict[str, Column]:
        """Named columns."""
        models = self.spread.models
        return {name: Column(values, unit) for name, unit, values in _columns(self.sheet.model, models)}

    @property
    def ranges(self) -> dict[str, Range]:
        """One range of each number that differs, gusts among them."""
        found = {}
        ends = np.percentile(self.spread.values, _ENDS, axis=0).T.tolist() if self.spread.names else []
        centre = self.spread.centre.tolist()
        for name, value, (low, high) in zip(self.spread.names, centre, ends, strict=True):
            found[name] = Range(self.numbers[name].unit, value, low, high, name not in self.not_determined)
        return found | dict(_gust_ranges(self.sheet.model, self.spread))

    @property
    def moved(self) -> dict[str, float]:
        """By which factors they were drawn around other numbers than the estimates, which are of no body."""
        pairs = zip(self.spread.names, self.spread.centre.tolist(), strict=True)
        factors = {name: value / self.numbers[name].value for name, value in pairs}
        return {name: factor for name, factor in factors.items() if factor != 1.0}

    @property
    def document(self) -> dict[str, Any]:
        """All but the parameters of JAX, for JSON and YAML."""
        vehicle = self.sheet.model.vehicle
        return {
            **self.facts,
            "ranges": {name: each._asdict() for name, each in self.ranges.items()},
            "lack": self.lack,
            "fixed": {
                "gravity_m_s2": vehicle.gravity_m_s2,
                "rotor_position_m": [list(rotor.position_m) for rotor in vehicle.rotors],
                "rotor_spin": [rotor.spin for rotor in vehicle.rotors],
                "rotor_speed_max_rad_s": vehicle.rotor_speed_max_rad_s,
            },
            "units": {name: column.unit for name, column in self.columns.items()},
            "samples": {name: column.values.tolist() for name, column in self.columns.items()},
        }

    @property
    def lack(self) -> dict[str, Any] | None:
        """What the model lacks, and how to play it; 0 on axes of which nothing is known."""
        found = self.spread.lack
        if found is None:
            return None
        share, rest = np.nan_to_num(found.share), np.nan_to_num(found.rest)
        memory = np.where(np.isfinite(found.memory), found.memory, 1.0)
        return {
            "how_to_play": LACK_RECIPE,
            "units": "rows of torque x y z, force x y z: share 1, rest N m and N, memory s",
            "share": dict(zip(found.part, share.T.tolist(), strict=True)),
            "rest": rest.tolist(),
            "memory_s": memory.tolist(),
        }

    @property
    def facts(self) -> dict[str, Any]:
        """What they are, and what speaks against them."""
        return {
            "model": self.sheet.file,
            "sha256": self.sheet.sha256,
            "cpfls": EXPORTER,
            "seed": self.seed,
            "verdict": self.sheet.verdict,
            "cautions": list(self.sheet.cautions),
            "not_determined": list(self.not_determined),
            "held_at_guesses": list(self.held),
            "vehicles": len(self.spread.models),
            "drawn": self.spread.tried,
            "rejected": dict(self.spread.rejected),
            "moved_to_a_body": self.moved,
            "conventions": _CONVENTIONS,
            "gusts": None if self.sheet.model.gusts is None else GUST_RECIPE,
        }

    def written(self, ending: str) -> bytes:
        """Write them by the ending of a file."""
        if ending == ".npz":
            return self._arrays()
        if ending == ".json":
            return strict_json(self.document).encode()
        return yaml_text([*self.sheet.facts, "", _CONVENTIONS], self.document).encode()

    def _arrays(self) -> bytes:
        ranges = self.ranges
        document = self.document
        made = {
            **{name: column.values for name, column in self.columns.items()},
            **{name: np.array(values) for name, values in document["fixed"].items()},
            "parameters": jax_parameters(self.sheet, self.spread.models),
            **self._lack_arrays(),
            "range_names": np.array(list(ranges)),
            "range_units": np.array([each.unit for each in ranges.values()]),
            "ranges": np.array([[each.low, each.value, each.high] for each in ranges.values()]).reshape(-1, 3),
            "facts": np.array(strict_json(self.facts | {"units": document["units"]})),
        }
        file = io.BytesIO()
        np.savez_compressed(file, allow_pickle=False, **made)
        return file.getvalue()

    def _lack_arrays(self) -> dict[str, Array]:
        lack = self.lack
        if lack is None:
            return {}
        return {
            "lack_part": np.array(list(lack["share"])),
            "lack_parameters": jax_parts(self.sheet, list(lack["share"])),
            "lack_share": np.array(list(lack["share"].values())),
            "lack_rest": np.array(lack["rest"]),
            "lack_memory_s": np.array(lack["memory_s"]),
        }


def _columns(nominal: VehicleModel, models: tuple[VehicleModel, ...]) -> Iterator[tuple[str, str, Array]]:
    """Give names, units and values."""
    vehicles, responses = [each.vehicle for each in models], [commanded_anew(each).response for each in models]
    rotors = [each.rotors for each in vehicles]
    yield "mass_kg", "kg, as stated", np.array([each.mass_kg for each in vehicles])
    inertia = np.array([symmetric(each.inertia_kg_m2) for each in vehicles])
    yield "inertia_kg_m2", "kg m^2, tensor, axis by axis", inertia
    yield "thrust_factor_n_s2", "N s^2, by rotor", np.array([[rotor.thrust_factor_n_s2 for rotor in r] for r in rotors])
    yield (
        "drag_factor_n_m_s2",
        "N m s^2, by rotor",
        np.array([[rotor.drag_factor_n_m_s2 for rotor in r] for r in rotors]),
    )
    yield "motor_lag_s", "s", np.array([each.lag_s for each in responses])
    yield "delay_s", "s", np.array([each.delay_s for each in responses])
    if nominal.response.slow_roll_pitch or nominal.response.slow_yaw:
        for name, unit in (("slow_roll_pitch", "1"), ("slow_yaw", "1"), ("slow_s", "s")):
            yield name, unit, np.array([getattr(each, name) for each in responses])
    for place, effect in enumerate(nominal.effects):
        for index, known in enumerate(CATALOGUE[effect.name].coefficients[: len(effect.coefficients)]):
            values = np.array([each.effects[place].coefficients[index] for each in models])
            yield f"{effect.name}.{known.name}", f"{known.unit or '1'}, see `cpfls effects {effect.name}`", values
    if nominal.remainder is not None:
        learned = [each.remainder.coefficients for each in models if each.remainder is not None]
        yield "remainder", "SI, learned, without a name: row, column, power", np.array(learned)
    if nominal.gusts is not None:
        gusts = np.array([each.gusts for each in models])
        halves = (("torque_n_m", "torque_memory_s", "N m", _TURNS), ("force_n", "force_memory_s", "N", _PUSHES))
        for size, memory, unit, axes in halves:
            yield f"gust_{size}", f"{unit}, standard deviation, x y z", gusts[:, 0, axes]
            yield f"gust_{memory}", "s, in which a gust falls to 37 %, x y z", gusts[:, 1, axes]
        for size, unit, axes in (("torque_white_n_m_sqrt_s", "N m", _TURNS), ("force_white_n_sqrt_s", "N", _PUSHES)):
            yield f"gust_{size}", f"{unit} s^0.5, white noise with it, x y z", gusts[:, 2, axes]


_TURNS, _PUSHES = slice(0, 3), slice(3, 6)


def _gust_ranges(nominal: VehicleModel, spread: Spread) -> Iterator[tuple[str, Range]]:
    if nominal.gusts is None:
        return
    drawn = np.array([each.gusts for each in spread.models])
    for axis in np.flatnonzero(nominal.gusts.size).tolist():
        units = ("N m" if axis < 3 else "N", "s")
        for part, (word, unit) in enumerate(zip(("size", "memory"), units, strict=True)):
            low, high = np.percentile(drawn[:, part, axis], _ENDS).tolist()
            value = float(nominal.gusts[part][axis])
            yield f"gust.{GUST_AXES[axis]}_{word}", Range(unit, value, low, high, True)


VehicleArgument = Annotated[Path, typer.Argument(metavar="VEHICLE", help="Made by `cpfls vehicle`.")]
CountOption = Annotated[int, typer.Option("-n", "--count", metavar="N", min=2, help="Vehicles to draw.")]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of the draws.")]


@result
class Written:
    """Vehicles that were drawn, in a file."""

    dry_run: bool = described("whether nothing was written")
    output: str = described("the file")
    bytes: int = described("of the file")
    samples: Samples

    @property
    def calm(self) -> dict[str, list[str]]:
        """Axes on which no gusts are known, those about which the vehicle turns and those along which it moves."""
        gusts = self.samples.sheet.model.gusts
        known = np.zeros(len(GUST_AXES), bool) if gusts is None else np.asarray(gusts.size) != 0
        still = [name for name, known_there in zip(GUST_AXES, known, strict=True) if not known_there]
        parted = (("about", GUST_AXES[:3]), ("along", GUST_AXES[3:]))
        return {word: own for word, axes in parted if (own := [name for name in axes if name in still])}


@stage(Written, words={"name_of": name_of, "trust_words": trust_words})
def spread(
    run: Run,
    model: VehicleArgument,
    count: CountOption = 1000,
    seed: SeedOption = 1,
    anyway: ExportAnywayOption = False,
) -> Written | None:
    """Draw vehicles, and write them."""
    ending = run.output.suffix
    if ending not in ENDINGS:
        known = ", ".join(ENDINGS)
        raise InputError(f"{run.output}: its suffix names no form; give the name one of the suffixes {known}")
    source = run.take({"model": model})["model"]
    if is_model(model) and not is_found(model):
        raise InputError(
            f"{model}: is a model of `cpfls {any_model(model).MADE_BY}`, which holds no covariance of its numbers; "
            "`cpfls vehicle` finds a vehicle with one"
        )
    found = found_vehicle(model)
    sheet = sheet_of(model, identifier(model.stem), source, force=run.force, anyway=anyway)
    with about(model, InputError, ComputationError):
        require_sure(found)
        if run.dry_run:
            run.say(f"{count} vehicles would be drawn from {model}")
            return None
        samples = Samples(
            sheet=sheet,
            spread=drawn(sheet.model, found, count, np.random.default_rng(seed)),
            numbers={number.name: number for number in found.numbers},
            seed=seed,
            not_determined=found.not_determined,
            held=found.guessed,
        )
    run.texts[run.output] = text = samples.written(ending)
    run.also = {**samples.facts, "ranges": {name: each._asdict() for name, each in samples.ranges.items()}}
    return Written(dry_run=False, output=str(run.output), bytes=len(text), samples=samples)
