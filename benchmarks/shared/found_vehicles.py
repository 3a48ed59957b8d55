"""Vehicles found in training flights: the structure that is chosen, and the baselines of its choice."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from time import perf_counter

from cpfls_cli.config.load import validate
from cpfls_cli.playback.fit import fit, parts_of
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.history_fit import fit_observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import INERTIA
from cpfls_cli.playback.player import Observer
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import BASELINES, Judged, Structure, fitted_to_all
from cpfls_cli.playback.vehicle import find_vehicle
from cpfls_cli.vehicle.settings import VehicleSettings

SEED = 1


def constants_unknown(vehicle: VehicleSettings) -> VehicleSettings:
    """Keep mass and geometry, as of a vehicle of which nobody knows the rest."""
    open_ = {"thrust_factor_n_s2": None, "drag_factor_n_m_s2": None}
    data = {
        "mass_kg": vehicle.mass_kg,
        "gravity_m_s2": vehicle.gravity_m_s2,
        "inertia_kg_m2": None,
        "rotor_speed_max_rad_s": vehicle.rotor_speed_max_rad_s,
        "rotors": [{"position_m": list(each.position_m), "spin": each.spin, **open_} for each in vehicle.rotors],
    }
    return validate({"vehicle": data}, "a vehicle of mass and geometry").vehicle


def learned(
    vehicle: VehicleSettings, training: Sequence[PlaybackFlight], baselines: bool = True
) -> dict[str, VehicleModel]:
    """Find a vehicle with the program's settings, and fit the baselines of the choice; what was found is printed."""
    used, start, judged = PlaybackSettings(), perf_counter(), list[Judged]()

    def progress(known: Sequence[Judged], total: int) -> None:
        judged[:] = known
        _shown(known, total)

    found = find_vehicle(vehicle, training, used, progress)
    tried = {each.name: each for each in found.structures}
    print(f"\nfound in {perf_counter() - start:.0f} s, {found.evaluated} structures judged on flights kept aside:")
    for name in filter(tried.__contains__, BASELINES):
        row = tried[name]
        size = f"{row.error:.4f} ({row.worse:+.4f} +- {row.uncertain:.4f})"
        print(f"  {name}: error {size}, {row.numbers} parameters: {' '.join(row.blocks)}")
    for number in found.numbers:
        weak = ", on a bound" if number.at_bound else "" if number.determined else ", not determined"
        print(f"  {number.name} = {number.value:.4g} ({number.low:.4g} to {number.high:.4g}) {number.unit}{weak}")
    # Where flights repeat each other the model is the constants, and no forecast.
    models = {f"vehicle, {tried['chosen'].numbers} parameters": found.forecast or found.model}
    for name in ("added", "everything") if baselines else ():
        of, clock = tried[name], perf_counter()
        own = next(each for each in judged if (each.structure.blocks, each.error) == (of.blocks, of.error))
        fitted, _ = fitted_to_all(own.structure, vehicle, training, used, own.fit)
        print(f"  {name} fitted to all in {perf_counter() - clock:.1f} s")
        models[f"{name}, {own.numbers} parameters"] = fitted.model
    return models


def fitted_blocks(
    vehicle: VehicleSettings, training: Sequence[PlaybackFlight], blocks: Sequence[str], past_s: float
) -> tuple[VehicleModel, Observer]:
    """Fit a forecast of given blocks and its observer, which uses so much of the past, as `learned` fits its choice."""
    used, clock = PlaybackSettings(), perf_counter()
    held = Structure(tuple(block for block in blocks if block != INERTIA))
    windows = [each for part in parts_of(training, used) for each in part]
    # On the body as it is first, as in a search.
    first = fit(held.free(vehicle), windows, {}, 12, 1e-3)
    fitted, windows = fitted_to_all(Structure(tuple(blocks)), vehicle, training, used, first)
    print(f"{len(fitted.values)} parameters fitted in {perf_counter() - clock:.0f} s, loss {fitted.loss:.4f}")
    clock = perf_counter()
    observer = fit_observer(fitted, windows, past_s)
    print(f"observer fitted in {perf_counter() - clock:.0f} s: {observer}\n")
    return fitted.model, observer


def _shown(judged: Sequence[Judged], total: int) -> None:
    if len(judged) % 10 == 0:
        best = min(each.error for each in judged)
        print(f"{len(judged)} of about {total}, smallest error {best:.4f}", file=sys.stderr, flush=True)
