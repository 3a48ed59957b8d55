"""Vehicles that were drawn, as parameters of the functions in JAX: one batched call flies them all."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.export.points import parts_along, reference_points
from cpfls_cli.export.registry import exported
from cpfls_cli.export.source import jax_parameters, jax_parts, python_source
from cpfls_cli.playback.player import free_runs, player_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.spread import Estimates, drawn
from tests.builders.exported_vehicles import on_numpy, sheet_of_vehicle
from tests.builders.flown_exports import executed
from tests.builders.playback_flights import flown, truth
from tests.builders.spread_vehicles import found_record
from tests.builders.vehicle_models import whole

DELAYED = replace(truth(), response=RotorResponse(lag_s=0.035, delay_s=0.013), thrust_linear=0.15)


def vehicles(model, count):
    record = found_record(model)
    return record.model, drawn(record.model, Estimates.of(record), count, np.random.default_rng(1))


def test_the_parameters_of_each_vehicle_are_those_of_its_own_export():
    model, spread = vehicles(DELAYED, 3)
    sheet = sheet_of_vehicle(model)
    for own, row in zip(spread.models, jax_parameters(sheet, spread.models), strict=True):
        text = python_source(replace(sheet, model=own), "v.py", "casadi")
        start = text.index("PARAMETERS = [") + len("PARAMETERS = [")
        alone = np.fromstring(text[start : text.index("]", start)].replace("\n", " "), sep=",")
        assert np.array_equal(row[:-1], alone)
        assert row[-1] == own.response.delay_s


def test_the_parts_alone_are_those_of_the_model():
    model = whole()
    sheet, points = sheet_of_vehicle(model), reference_points(model, np.random.default_rng(1), 3)
    wrench = on_numpy(python_source(sheet, "v.py", "jax"))["wrench"]
    parts = parts_along(model, points.air, points.rate, points.rotor)
    for own, row in zip(parts.values(), jax_parts(sheet, [*parts]), strict=True):
        found = np.array([wrench(*each, row) for each in zip(points.air, points.rate, points.rotor, strict=True)])
        assert np.abs((found - own) / points.scale).max() < 1e-12


def test_one_batched_function_flies_all_vehicles():
    jax = pytest.importorskip("jax", reason="the extra simulators is not installed")
    model, spread = vehicles(DELAYED, 4)
    flight = flown(model, ("multisine",), hold="linear", duration_s=1.0)[0]
    period, horizon = flight.motion.period, len(flight) - 1
    with jax.enable_x64(True):
        sheet = sheet_of_vehicle(model)
        module = executed(exported(sheet, "jax", "v.py").text)
        parameters = jax_parameters(sheet, spread.models)
        assert parameters.shape[1] == len(module["PARAMETER_NAMES"]) == len(module["PARAMETERS"])
        state = np.concatenate([part[0].ravel() for part in flight.motion[:4]])
        longest = max(each.response.delay_s for each in spread.models)

        def fly(own):
            return module["fly"](state, flight.speed, period, parameters=own, longest=longest)

        flown_ = np.array(jax.jit(jax.vmap(fly))(parameters))
        short = np.array(
            jax.jit(jax.vmap(lambda own: module["fly"](state, flight.speed, period, parameters=own, longest=0.0)))(
                parameters
            )
        )
    assert np.isnan(short).any()
    for own, path in zip(spread.models, flown_, strict=True):
        runs = free_runs(player_of(own, flight), flight, np.array([0]), horizon)
        rate = runs.errors[0, :, 3] + flight.motion.rate[1:]
        assert np.abs(path[:, 15:] - rate).max() < 1e-9
