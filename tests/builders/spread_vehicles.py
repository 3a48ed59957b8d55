"""The artifact of a vehicle with what its flights say of each number, as if it had been found in them."""

from dataclasses import replace

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.disturbance import FoundGusts
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.playback.parameters import FoundNumber
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import vehicle_of

BLOCKS = 30
RELATIVE = 0.08
"""Half of an interval, as a share of the value."""


def numbers_of(model):
    """Numbers of a model that a fit may find, with their units."""
    vehicle, rotor = model.vehicle, model.vehicle.rotors[0]
    moments = zip(("Ixx", "Iyy", "Izz"), vehicle.inertia_kg_m2, strict=False)
    found = {f"inertia.{name}": (moment, "kg m^2") for name, moment in moments}
    found |= {
        "thrust_factor": (rotor.thrust_factor_n_s2, "N s^2"),
        "drag_factor": (rotor.drag_factor_n_m_s2, "N m s^2"),
    }
    found |= {"lag.time_constant_s": (model.response.lag_s, "s")} if model.response.lag_s else {}
    found |= {"delay.delay_s": (model.response.delay_s, "s")} if model.response.delay_s else {}
    for effect in model.effects:
        pairs = zip(CATALOGUE[effect.name].coefficients, effect.coefficients.tolist(), strict=True)
        found |= {f"{effect.name}.{known.name}": (value, known.unit) for known, value in pairs}
    return found


def found_record(model=None, *, together=0.9, loop=None, gusts=True, lack=None, relative=RELATIVE, **changed):
    """A vehicle; Izz and the drag factor go together, and so do the moments about roll and pitch a little.

    `lack` are the shares of rotors and damping about each axis of torque.
    """
    model = model or truth()
    known = numbers_of(model)
    names = tuple(known)
    correlation = np.eye(len(names))
    for first, second, alike in (
        ("inertia.Izz", "drag_factor", together),
        ("inertia.Ixx", "inertia.Iyy", 0.5 * together),
    ):
        at = names.index(first), names.index(second)
        correlation[at] = correlation[at[::-1]] = alike
    least = [
        value / (1 + relative) if name.startswith("inertia") or name.endswith("factor") else value * (1 - relative)
        for name, (value, _) in known.items()
    ]
    size = inertia_and_mass(model.vehicle) * [3.4, 5.1, 2.0, 0.3, 0.3, 0.3]
    memory = np.array([0.3, 1.2, 0.5, 1.0, 1.0, 1.0])
    white = 0.1 * size * (lack is not None)
    held = Gusts(size, memory, white) if gusts else None
    low, high = np.ones(3), np.ones(3)
    if loop is not None:
        low, high = np.asarray(loop)
    given = {
        "numbers": tuple(
            FoundNumber(name, unit, value, below, value * (1 + relative), np.nan, name != "inertia.Izz", False)
            for (name, (value, unit)), below in zip(known.items(), least, strict=True)
        ),
        "correlation": correlation,
        "blocks": BLOCKS,
        "loop": LoopBounds(low, high, np.full(3, 0.99)),
        "disturbance": None
        if not gusts
        else FoundGusts(
            instrument_kind="repeats",
            size=size,
            low=0.8 * size,
            high=1.3 * size,
            memory=memory,
            memory_low=0.7 * memory,
            memory_high=1.4 * memory,
            predicted=np.full(6, np.nan),
            white=white,
            lack=None if lack is None else lack_of(np.asarray(lack), 0.5 * size),
        ),
    }
    return vehicle_of(replace(model, gusts=held), **{**given, **changed})


def lack_of(share, size):
    """What a model lacks, the same about all axes of torque; of forces nothing is known."""
    return Lack(
        part=("rotors", "linear_damping"),
        share=np.concatenate([np.tile(share, (3, 1)), np.full((3, 2), np.nan)]),
        rest=np.append(size[:3], [np.nan] * 3),
        memory=np.array([0.5, 2.0, 8.0, *[np.nan] * 3]),
    )


def inertia_and_mass(vehicle):
    """What torque about and force along each body axis move."""
    return np.array([*vehicle.inertia_kg_m2[:3], *[vehicle.mass_kg] * 3])
