"""The study: which craft hides which effects, and what its log leaves out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from .gusts import gusts
from .measure import ATTACKS, rotor_columns
from .strengths import CATALOGUE, FORMS, OUTSIDE, strength
from .vehicles import STUDIED, VEHICLES

VELOCITY_COLUMNS = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")
FORCE_COLUMNS = ("ax", "ay", "az")
LAGGED = frozenset({"motor_lag", "lag_second_order", "lag_uneven"})
COMMAND_ONLY = LAGGED | {"notch_filter", "command_delay", "battery_sag", "thrust_curve"}


@dataclass(frozen=True)
class Case:
    """One craft and what is hidden in it.

    ``hidden`` maps effects to their parameters; ``truth`` holds the catalogue names a perfect judge would give,
    ``outside`` what no catalogue lists, ``nearest`` the catalogue name of an effect whose form differs.
    ``esc_speed`` logs rotor speeds as a controller believes them, without the loss of voltage;
    ``ideal_command`` logs a command that the rotors follow exactly; ``attack`` is what the logger does to the log;
    ``only`` the role of the flights that the effects are in, if not all; ``gusts`` the level of the air, ``air`` its
    numbers, and ``instruments`` what separates it from the vehicle.
    """

    name: str
    group: str
    vehicle: str
    hidden: dict = field(default_factory=dict)
    truth: tuple = ()
    outside: tuple = ()
    nearest: tuple = ()
    dominant: str = ""
    hover_only: bool = False
    left_out: tuple = ()
    esc_speed: bool = False
    ideal_command: bool = False
    attack: str = ""
    only: str = ""
    gusts: int = 0
    instruments: str = "none"
    air: dict = field(default_factory=dict)

    @property
    def usual(self):
        """Whether it flies in still air, each path once, and its log holds no setpoints."""
        return not self.gusts and self.instruments == "none"

    def key(self):
        """Give what is hidden as plain data."""
        plain = {name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()}
        unusual = ("gusts", "instruments", "air") if self.usual else ()
        return {"case" if name == "name" else name: value for name, value in plain.items() if name not in unusual}


def make(name, group, vehicle, effects, rng, level=None, **options):
    """Draw one case; effects that need company (wind needs rotor drag, a command without speeds has lag) get it."""
    effects = list(effects)
    if "wind" in effects and "rotor_drag" not in effects:
        effects.append("rotor_drag")
    levels = level if isinstance(level, dict) else dict.fromkeys(effects, level)
    hidden = {effect: strength(effect, VEHICLES[vehicle], rng, levels.get(effect)) for effect in effects}
    if "rotor_gyroscopic" in hidden and "rotor_acceleration" in hidden:
        hidden["rotor_gyroscopic"] = hidden["rotor_acceleration"]
    truth = [NAMES.get(effect, effect) for effect in effects if effect in (*CATALOGUE, *NAMES)]
    if options.get("only"):
        truth = []
    left_out = list(options.pop("left_out", ()))
    if group == "commands" or (COMMAND_ONLY & set(effects) and not options.get("esc_speed")):
        left_out += rotor_columns(VEHICLES[vehicle].count)
        # Rotors always lag by 50 ms behind their command, so a log of commands hides that too.
        if not LAGGED & set(effects):
            truth.append("motor_lag")
    nearest = tuple(FORMS[effect][1] for effect in effects if effect in FORMS)
    nearest += tuple(name for effect in effects for name in NEAREST.get(effect, ()))
    outside = tuple(effect for effect in effects if effect in (*OUTSIDE, "bullet_downwash") and effect not in NAMES)
    if options.get("ideal_command"):
        left_out += rotor_columns(VEHICLES[vehicle].count)
    return Case(
        name, group, vehicle, hidden, tuple(truth), outside, nearest, left_out=tuple(dict.fromkeys(left_out)), **options
    )


INSTRUMENTS = {
    "none": (),
    "setpoints": ("setpoint_position", "setpoint_velocity"),
    "sticks": ("setpoint_position", "setpoint_velocity", "sticks"),
    "repeats": (),
}
"""What the log holds of what was asked for; with repeats each path is flown once more, in other gusts and noise."""


def in_air(case, level, instruments, seed):
    """Give a case in gusts of a level; those of two levels, or with other instruments, differ in nothing else."""
    rng = np.random.default_rng([seed, *case.name.encode(), *b"gusts"])
    air = gusts(VEHICLES[case.vehicle], level, rng) if level else {}
    return replace(case, gusts=level, instruments=instruments, air=air)


NAMES = {
    "drag_factor": "parameter_error",
    "flexible_arm": "flexible_mount",
    "notch_filter": "notch_filter",
    "rotor_interference": "own_wake",
    "thrust_curve": "thrust_slope",
    "thrust_tilt": "rotor_tilt",
    "wake_on_body": "own_wake",
}
"""Names that the catalogue has for what is hidden under another; what it takes in of ``OUTSIDE`` gets a line here."""

NEAREST = {
    "bullet_damping": ("parasitic_drag", "linear_damping", "quadratic_damping", "rotor_drag", "inflow"),
    "bullet_drag": ("rotor_drag", "inflow"),
    "bullet_ground": ("ground_effect",),
    "drag_factor": ("drag_factor_error",),
}
"""Names in the catalogue that come close to the physics of another simulator, or say the same in another way."""

SUITABLE = {name: tuple(STUDIED) for name in CATALOGUE}
# The hubs of the Hummingbird lie in the plane of its centre of mass: leaning thrust has no lever.
SUITABLE["rotor_plane_damping"] = ("sixkg", "xquad", "crazyflie", "hexarotor", "coaxial")

PAIRS = (
    ("rotor_drag", "com_offset"),
    ("linear_damping", "motor_lag"),
    ("rotor_gyroscopic", "rotor_acceleration"),
    ("ground_effect", "rotor_mismatch"),
    ("inflow", "parasitic_drag"),
    ("payload", "torque_bias"),
    ("vertical_descent", "rotor_drag"),
    ("products_of_inertia", "flapping_moment"),
    ("battery_sag", "com_offset"),
    ("wind", "torque_bias"),
    ("gyro_bias", "linear_damping"),
    ("imu_misalignment", "rotor_drag"),
    ("wind", "inflow"),
    ("wind", "parasitic_drag"),
    ("com_offset", "gust_turbulence"),
    ("rotor_drag", "yaw_cogging"),
    ("linear_damping", "fuel_slosh"),
)
TRIPLES = (
    ("rotor_drag", "inflow", "com_offset"),
    ("linear_damping", "rotor_acceleration", "torque_bias"),
    ("motor_lag", "com_offset", "rotor_drag"),
    ("ground_effect", "rotor_mismatch", "rotor_acceleration"),
    ("flapping_moment", "products_of_inertia", "quadratic_damping"),
    ("inflow", "parasitic_drag", "magnetic_torque"),
)
BACKGROUND = (
    "linear_damping", "quadratic_damping", "rotor_drag", "inflow", "translational_lift", "parasitic_drag",
    "ground_effect", "rotor_gyroscopic", "rotor_acceleration", "com_offset", "products_of_inertia",
)  # fmt: skip
DOMINANT = (
    "com_offset", "payload", "rotor_drag", "torque_bias", "linear_damping", "rotor_mismatch", "flapping_moment",
    "inflow", "rotor_acceleration", "vertical_descent", "ground_effect", "motor_lag",
)  # fmt: skip
LACKING = {
    "velocity": ("x", "y", "z", "vx", "vy", "vz"),
    "attitude": ("phi", "theta", "psi"),
    "acceleration": FORCE_COLUMNS,
    "motion": VELOCITY_COLUMNS,
}
LIMITED = (
    "linear_damping", "rotor_drag", "inflow", "ground_effect", "vertical_descent", "parasitic_drag", "wind", "payload",
    "com_offset", "rotor_acceleration", "products_of_inertia", "rotor_mismatch",
)  # fmt: skip


def _singles(draws):
    for effect in CATALOGUE:
        for draw in range(draws):
            yield f"single-sixkg-{effect}-{draw}", "single", "sixkg", (effect,), {}
        for vehicle in SUITABLE[effect]:
            if vehicle != "sixkg":
                yield f"single-{vehicle}-{effect}-0", "single", vehicle, (effect,), {}
    for draw in range(draws):
        yield f"single-sixkg-battery_sag_esc-{draw}", "single", "sixkg", ("battery_sag",), {"esc_speed": True}


def _none(draws):
    for vehicle in STUDIED:
        for draw in range(2 * draws if vehicle == "sixkg" else draws):
            yield f"none-{vehicle}-{draw}", "none", vehicle, (), {}
    for draw in range(draws):
        yield f"none-sixkg-ideal_command-{draw}", "none", "sixkg", (), {"ideal_command": True}
        yield f"none-sixkg-hover-{draw}", "none", "sixkg", (), {"hover_only": True}


def _strange(draws):
    for group, effects in (("outside", OUTSIDE), ("form", FORMS)):
        for effect in effects:
            for draw in range(draws):
                vehicle = ("sixkg", "xquad", "crazyflie", "hummingbird", "hexarotor", "coaxial")[draw % 6]
                yield f"{group}-{vehicle}-{effect}-{draw}", group, vehicle, (effect,), {}


def _several(draws):
    for group, sets in (("pair", PAIRS), ("triple", TRIPLES)):
        for effects in sets:
            for draw in range(max(1, draws // 2)):
                options = {"level": dict.fromkeys(effects, 0.6)} if draw == 0 else {}
                yield f"{group}-sixkg-{'+'.join(effects)}-{draw}", group, "sixkg", effects, options


def _background(draws):
    for effect in DOMINANT:
        effects = (effect, *(other for other in BACKGROUND if other != effect))
        options = {"level": dict.fromkeys(effects, -0.4) | {effect: 0.8}, "dominant": effect}
        for draw in range(max(1, draws // 2)):
            yield f"background-sixkg-{effect}-{draw}", "background", "sixkg", effects, options


def _limited(draws):
    for effect in LIMITED:
        for draw in range(max(1, draws // 2)):
            yield f"hover-sixkg-{effect}-{draw}", "hover", "sixkg", (effect,), {"hover_only": True}
            columns = {"left_out": VELOCITY_COLUMNS}
            yield f"no_velocity-sixkg-{effect}-{draw}", "no_velocity", "sixkg", (effect,), dict(columns)
            yield f"no_force-sixkg-{effect}-{draw}", "no_force", "sixkg", (effect,), {"left_out": FORCE_COLUMNS}


def _lacking(draws):
    """Hide what a log without a signal cannot show: its rival is not defeated."""
    for signal, columns in LACKING.items():
        for effect in ("rotor_drag", "inflow"):
            for draw in range(max(1, draws // 2)):
                for still in (False, True):
                    name = f"lacking-sixkg-{'hover_' if still else ''}{signal}-{effect}-{draw}"
                    yield name, "lacking", "sixkg", (effect,), {"left_out": columns, "hover_only": still}


def _drag_factor(draws):
    for draw in range(draws):
        vehicle = ("sixkg", "xquad", "hexarotor")[draw % 3]
        yield f"drag_factor-{vehicle}-alone-{draw}", "drag_factor", vehicle, ("drag_factor",), {}
        effects = ("rotor_drag", "drag_factor")
        yield f"drag_factor-{vehicle}-rotor_drag-{draw}", "drag_factor", vehicle, effects, {}


def _commanded(draws):
    """Hide a thrust curve, wrong numbers, both and neither in logs of commands alone."""
    sets = ((), ("parameter_error",), ("thrust_curve",), ("thrust_curve", "parameter_error"),
            ("thrust_curve", "rotor_drag"))  # fmt: skip
    for effects in sets:
        for vehicle in STUDIED:
            for draw in range(draws):
                yield f"commands-{vehicle}-{'+'.join(effects) or 'none'}-{draw}", "commands", vehicle, effects, {}


def _attacked(draws):
    for attack in ATTACKS:
        for effect in ("", "rotor_drag", "inflow", "com_offset", "linear_damping"):
            for draw in range(max(1, draws // 2)):
                effects = (effect,) if effect else ()
                name = f"attack-sixkg-{attack}-{effect or 'none'}-{draw}"
                yield name, "attack", "sixkg", effects, {"level": 0.4, "attack": attack}


def _one_sided(draws):
    """Hide an effect in the flights of one role alone, as where a propeller was changed between flights."""
    for only in ("train", "held_out"):
        for effect in ("rotor_mismatch", "com_offset", "rotor_drag", "linear_damping"):
            for draw in range(max(1, draws // 2)):
                name = f"differing-sixkg-{only}-{effect}-{draw}"
                yield name, "differing", "sixkg", (effect,), {"level": 0.5, "only": only}


def _pybullet(draws):
    for physics in ("plain", "drag", "ground", "downwash"):
        effects = ("quick_rotors", "bullet_damping", *(() if physics == "plain" else (f"bullet_{physics}",)))
        for draw in range(draws):
            yield f"pybullet-cf2x-{physics}-{draw}", "pybullet", "cf2x", effects, {}


def cases(study_seed, draws=3):
    """List the whole study; single effects on the 6 kg craft are drawn so often, other groups follow."""
    kinds = (
        _singles, _none, _strange, _several, _background, _limited,
        _lacking, _drag_factor, _attacked, _one_sided, _pybullet, _commanded,
    )  # fmt: skip
    out = []
    for name, group, vehicle, effects, options in chain.from_iterable(kind(draws) for kind in kinds):
        rng = np.random.default_rng([study_seed, *name.encode()])
        out.append(make(name, group, vehicle, effects, rng, **options))
    return out
