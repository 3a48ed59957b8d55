"""A vehicle found in flights, its constants by name, how well it predicts other flights, how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight, of_no_body
from cpfls_cli.effects.registry import CENTRE_OF_MASS
from cpfls_cli.flightlog.stated_vehicle import SLOW_HZ
from cpfls_cli.inertia import INERTIA_PARAMETERS, MEASURED, beyond_any_body, more_than_others, six_parameters, symmetric
from cpfls_cli.playback.errors import FADING, AlongFlights
from cpfls_cli.playback.parameters import CURVE, FoundNumber
from cpfls_cli.playback.vehicle import VehicleFit
from cpfls_cli.response import spectra
from cpfls_cli.response.flown import VehicleResponse
from cpfls_cli.response.spectra import NOT_ACCEPTABLE, NOT_JUDGED, ROTATION, response_word
from cpfls_cli.result import About, about, part, result
from cpfls_cli.rounding import apart
from cpfls_cli.validation.trust import GOOD, Trust, capped, trust_by_playback
from cpfls_cli.words import spoken

_DIGITS = 6
THRUST, DRAG = "rotors.thrust_factor_n_s2", "rotors.drag_factor_n_m_s2"
INERTIA = tuple(f"inertia_kg_m2.{place}" for place in range(6))
LAG, DELAY, CENTRE = "motor_lag_s", "delay_s", ("com_m.0", "com_m.1")
FOUND_AS = {
    THRUST: "thrust_factor",
    DRAG: "drag_factor",
    **dict(zip(INERTIA[:3], (f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), strict=True)),
    **dict(zip(INERTIA[3:], (f"products.{name}" for name in INERTIA_PARAMETERS[3:]), strict=True)),
    LAG: "lag.time_constant_s",
    DELAY: "delay.delay_s",
    **dict(zip(CENTRE, (f"{CENTRE_OF_MASS.name}.{each.name}" for each in CENTRE_OF_MASS.coefficients), strict=True)),
}
"""Numbers of a fit, by the keys under which people look for them."""


_REMAINDER = "remainder"
_NAMES = {
    THRUST: "thrust factor",
    DRAG: "drag factor",
    **dict(zip(INERTIA, INERTIA_PARAMETERS, strict=True)),
    LAG: "lag of the rotors",
    DELAY: "delay",
    **dict(zip(CENTRE, ("centre of mass along x", "along y"), strict=True)),
}

_FOUND_NAMES = {found: _NAMES[key] for key, found in FOUND_AS.items()}
_FOUND_NAMES |= {
    CURVE: "share of the thrust in hover that is linear",
    "slow_actuation.roll_pitch": "share of the slow pole in roll and pitch",
    "slow_actuation.yaw": "share of the slow pole in yaw",
    "slow_actuation.slow_s": "time constant of the slow pole",
}

OF_TURNING = frozenset(FOUND_AS[key] for key in (DRAG, *INERTIA))
"""Numbers of a fit that are known only as far as the torques are that turn the vehicle."""

_UNITS = {THRUST: "N s^2", DRAG: "N m s^2", LAG: "s", DELAY: "s", **dict.fromkeys(CENTRE, "m")}
ON_BOUND = "at the limit of the search"
BY_BOUNDS = "the middle of its bounds, whatever the autopilot answers"
OF_NONE = "impossible for such a vehicle; it fits these flights, but is not a constant of the vehicle"

STATED = (THRUST, DRAG, *INERTIA)
"""What a config states, where it states anything."""

GUESSES = {"thrust_factor": (THRUST,), "drag_factor": (DRAG,), "inertia": INERTIA[:3]}


def name_of(found: str) -> str:
    """Say what people call a number of a fit."""
    block, _, number = found.partition(".")
    number = number if is_learned(found) else spoken(number)
    return _FOUND_NAMES.get(found, f"{block.replace('_', ' ')} {number}".strip())


def is_learned(found: str) -> bool:
    """Tell whether a number of a fit belongs to a remainder: to that of the torque, or of the force."""
    return found.startswith(_REMAINDER)


class Parameter(NamedTuple):
    """A constant of a vehicle.

    Attributes
    ----------
    key : str
        Below the section `vehicle` of a config, where that has it.
    value : float or None
        None: no flight identifies it, and no config states it.
    low, high : float or None
        95 % interval of what was found.
    stated : float or None
        In the config.
    determined : bool
        Whether the flights identify it.
    possible : bool
        Whether such a vehicle can have it.
    reason : str
        Why, or why not.
    """

    key: Annotated[str, About("below the section `vehicle` of a config", brief=False)]
    value: float | None
    unit: str
    low: float | None
    high: float | None
    stated: float | None
    determined: bool
    reason: str
    possible: bool = True

    @property
    def name(self) -> str:
        """What people call it."""
        return _NAMES[self.key]

    @property
    def identified(self) -> str:
        """Whether the flights identify it, in a word."""
        if self.determined:
            return "by bounds" if self.reason == BY_BOUNDS else "yes"
        if self.value is None:
            return "a guess"
        if self.low is None:
            return "as in the config" if self.stated is not None else "not needed"
        if not self.possible:
            return "no: impossible"
        return f"no: {ON_BOUND}" if self.reason == ON_BOUND else "no"

    @property
    def wanting(self) -> bool:
        """Whether it was looked for and not found."""
        return self.value is None or (self.low is not None and not self.determined)

    @property
    def needed(self) -> bool:
        """Whether it is anything but a zero that nobody asked for."""
        return self.value != 0 or self.low is not None or self.stated is not None


def parameters_of(vehicle: Vehicle) -> Iterator[Parameter]:
    """List the constants of a vehicle that was found, known or not."""
    guesses = {key for name in vehicle.guessed for key in GUESSES[name]}
    for key, name in FOUND_AS.items():
        unit = _UNITS.get(key, "kg m^2")
        if name in vehicle.found:
            number = vehicle.found[name]
            stated = number.stated if np.isfinite(number.stated) else None
            reason, possible = _reason(vehicle, number), name not in vehicle.impossible
            why = reason or (BY_BOUNDS if vehicle.by_bounds and name in OF_TURNING else "found in flights")
            yield Parameter(key, number.value, unit, number.low, number.high, stated, not reason, why, possible)
        elif key in guesses:
            reason = "not known: neither velocity nor accelerometer separates thrust from weight"
            yield Parameter(key, None, unit, None, None, None, False, reason)
        else:
            held = _held(vehicle, key)
            stated = held if key in STATED and held else None
            adds = key in (LAG, DELAY, *CENTRE, *INERTIA[3:])
            why = "not needed: no lower error with it" if adds else "as stated: no lower error with another"
            if vehicle.by_bounds and (vehicle.forecast is not None or key in STATED):
                why = "not tried: the body is held by bounds"
            yield Parameter(key, held, unit, None, None, stated, False, why)


def _reason(vehicle: Vehicle, number: FoundNumber) -> str:
    """Say why a number is not determined; empty where it is."""
    name, alone = number.name, vehicle.instruments is None and number.name != FOUND_AS[THRUST]
    if name not in vehicle.not_determined:
        return ""
    if name in vehicle.on_bound:
        return ON_BOUND
    if vehicle.loop.shows_loop and alone:
        return "these flights show the loop, not the vehicle"
    if name in OF_TURNING and too_heavy(vehicle):
        return too_heavy(vehicle)
    if name in excess(vehicle):
        return f"{excess(vehicle)[name]}: a number that predicts, not the body's"
    if name in vehicle.impossible:
        return OF_NONE
    pairs = [(trade.first, trade.second) for trade in vehicle.trades]
    others = [second if first == name else first for first, second in pairs if name in (first, second)]
    if others:
        return f"only its ratio to {' and '.join(others)} is known: they trade against each other"
    if vehicle.by_bounds and name in OF_TURNING:
        ends = f"bounds from {number.low:.3g} to {number.high:.3g} leave it open"
        return ends if name in vehicle.bounded else "the flights set no bounds to it: taken as open by a factor of ten"
    return "the flights say too little, the interval is too wide"


def too_heavy(vehicle: Vehicle) -> str:
    """Say that the inertia that was found is that of no body; empty where it can be."""
    moments = {number.name: number.value for number in vehicle.numbers}
    stated = vehicle.model.vehicle
    limits = beyond_any_body(stated.mass_kg, np.array([rotor.position_m for rotor in stated.rotors]), moments)
    if not limits:
        return ""
    beyond = " and ".join(
        f"{name_of(name)} {' where at most '.join(apart(moments[name], limit))} is possible"
        for name, limit in limits.items()
    )
    return (
        f"too heavy for {stated.mass_kg:.3g} kg between these rotors ({beyond}, kg m^2): numbers that predict, not the "
        "body's"
    )


def excess(vehicle: Vehicle) -> dict[str, str]:
    """Say of a moment of inertia that was found and is more than the other two together that no body has it."""
    moments = np.array(vehicle.model.vehicle.inertia_kg_m2[:3])
    named = {f"inertia.{name}": float(moments[INERTIA_PARAMETERS.index(name)]) for name in more_than_others(moments)}
    return {
        name: f"no body has it, for the other two are {moments.sum() - moment:.3g} kg m^2 together"
        for name, moment in named.items()
        if name in vehicle.found
    }


def _held(vehicle: Vehicle, key: str) -> float:
    stated, response = vehicle.model.vehicle, vehicle.model.response
    if key in INERTIA:
        return float(six_parameters(stated.inertia_kg_m2)[INERTIA.index(key)])
    if key in (THRUST, DRAG):
        return float(np.mean([getattr(rotor, key.rpartition(".")[2]) for rotor in stated.rotors]))
    return {LAG: response.lag_s, DELAY: response.delay_s}.get(key, 0.0)


def vehicle_section(vehicle: Vehicle) -> dict[str, Any]:
    """Write the section `vehicle` of a config with what was found; null for what was not known and still is not."""
    known, stated = vehicle.parameters, vehicle.model.vehicle

    def relied_on(key: str, held: float) -> float | None:
        # What the flights do not identify stays as it was stated, if it was.
        value = known[key].stated if _open(known[key]) else held
        return None if value is None else _rounded(value)

    # A product that is not known is none; a moment that is not known is to be found.
    inertia = [relied_on(key, held) for key, held in zip(INERTIA, six_parameters(stated.inertia_kg_m2), strict=True)]
    inertia[3:] = [value or 0.0 for value in inertia[3:]]
    if all(inertia[:3]) and not _of_a_body(np.array(inertia)):
        # Numbers that were found with stated ones that do not go with them: those are to be found too.
        inertia[:3] = [
            value if known[key].determined else None for key, value in zip(INERTIA, inertia[:3], strict=False)
        ]
        inertia[:3] = [None] * 3 if all(inertia[:3]) else inertia[:3]
    return {
        "gravity_m_s2": stated.gravity_m_s2,
        "mass_kg": _rounded(stated.mass_kg),
        "inertia_kg_m2": inertia if all(inertia[:3]) and any(inertia[3:]) else inertia[:3],
        "rotors": [
            {
                "position_m": [_rounded(value) for value in rotor.position_m],
                "spin": rotor.spin,
                "thrust_factor_n_s2": relied_on(THRUST, rotor.thrust_factor_n_s2),
                "drag_factor_n_m_s2": relied_on(DRAG, rotor.drag_factor_n_m_s2),
                "radius_m": None if rotor.radius_m is None else _rounded(rotor.radius_m),
            }
            for rotor in stated.rotors
        ],
        "rotor_speed_max_rad_s": stated.rotor_speed_max_rad_s,
    }


def _of_a_body(inertia: Array) -> bool:
    """Tell whether no principal moment is more than the other two together, which a config refuses."""
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(inertia))
    return bool(largest <= MEASURED * (smallest + middle))


def _open(parameter: Parameter) -> bool:
    """Tell whether a number that a fit was free to choose is not to be relied on."""
    return not parameter.determined and (parameter.low is not None or parameter.value is None)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


class ResponseMismatch(NamedTuple):
    """How far the model is from a frequency response that its flights show (see `cpfls response`)."""

    name: Annotated[str, About("roll, pitch, yaw, thrust")]
    cost: Annotated[float, About("J; not finite where the flights do not show it", gaps=True)]
    low: Annotated[float, About("from this frequency", unit="Hz", gaps=True)]
    high: Annotated[float, About("to this one", unit="Hz", gaps=True)]


def mismatches(responses: Mapping[str, VehicleResponse], *, instrumented: bool) -> tuple[ResponseMismatch, ...]:
    """List those about the body axes and of thrust; only those that instruments move, where they have to."""
    return tuple(
        ResponseMismatch(name, each.cost, *(each.band or (np.nan, np.nan)))
        for name, each in responses.items()
        if name in (*ROTATION, spectra.THRUST) and (each.instrumented or not instrumented)
    )


@result
class Vehicle(VehicleFit, AnyModel):
    """A vehicle found in flights."""

    FORMAT: ClassVar = "cpfls/vehicle"
    MADE_BY: ClassVar = "vehicle"
    SHOWN: ClassVar = ("verdict", "forecast_verdict", "trust", "not_determined", "parameters")

    held_out: AlongFlights | None = part(default=None)
    """Playback along flights held out."""
    responses: tuple[ResponseMismatch, ...] = part(default=())
    fading_s: float | None = about(FADING, unit="s", default=None)
    full_speed_rad_s: float | None = about(
        "largest speed of a rotor, assumed, where commands are shares of it; thrust and drag factor go with it",
        unit="rad/s",
        default=None,
    )
    rotors_logged_hz: float | None = about("how often the slowest log holds the rotors", unit="Hz", default=None)
    logged_by: tuple[str, ...] = about(
        "what wrote the logs, each once; none where they do not say", "system", default=()
    )
    warnings: tuple[str, ...] = about("what to know about the flights", "warning", default=())
    contradictions: tuple[str, ...] = about(
        "contradictions within the flights or with the vehicle", "contradiction", default=()
    )
    learned: tuple[LearnedFlight, ...] = part(default=())
    """Flights that it was found in."""

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that it was found in."""
        return self.learned

    @property
    def trust(self) -> str:
        """What it is as the vehicle: whoever takes it elsewhere takes its constants."""
        return self.verdict

    @property
    def judged_as(self) -> dict[str, str]:
        """How far to trust it as a forecast along logged rotor speeds, and as the vehicle."""
        return {"forecast": self.forecast_verdict, "vehicle": self.verdict}

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return "" if self.complete else "interrupted"

    @property
    def verdict(self) -> Trust:
        """How far to trust its constants, where the flights neither contradict themselves nor show the loop.

        Where they rest on instruments, by what they explain of the repeatable motion; else by playback, as far as they
        are identified at all. No word is good where the frequency response about roll or pitch is off.
        """
        identified = self.identifies_turning and not set(FOUND_AS.values()) & set(self.on_bound)
        if self.instruments is None:
            identified = identified and self.identifies_yaw
            return capped(
                # Of flights that show the loop as well no forecast judges the vehicle.
                self._by_playback if self.forecast is None else Trust.NOT_JUDGED,
                self.contradictions,
                loop=self.loop.shows_loop,
                lacks=self.responses_off,
                identified=identified,
            )
        lacks = self.responses_off or self.instruments.lacks
        judged = len(self._turning) == len(ROTATION[:2]) and NOT_JUDGED not in self._turning
        word = Trust.SIMULATION if lacks or judged else Trust.NOT_JUDGED
        return capped(word, self.contradictions, lacks=lacks, identified=identified)

    @property
    def forecast_verdict(self) -> Trust:
        """What playback on flights held out says of it as a forecast along logged rotor speeds.

        No word is good where the body that turns in it is none, or its frequency response about roll or pitch is off:
        what merely stops turning predicts rates as well for a while.
        """
        doubted = bool(self.unreal) or self.responses_off
        return Trust.NOT_CONTROL if doubted and self._by_playback in GOOD else self._by_playback

    @property
    def _by_playback(self) -> Trust:
        return capped(trust_by_playback(self.held_out), self.contradictions)

    @property
    def _turning(self) -> list[str]:
        """Words on the frequency responses of roll and pitch, where there are any."""
        return [response_word(each.cost) for each in self.responses if each.name in ROTATION[:2]]

    @property
    def responses_off(self) -> bool:
        """Whether the frequency response about roll or pitch is not acceptable."""
        return NOT_ACCEPTABLE in self._turning

    @property
    def identifies_turning(self) -> bool:
        """Whether the moments of inertia about roll and pitch are identified, or known, and on no bound."""
        return not {FOUND_AS[key] for key in INERTIA[:2]} & set(self.not_determined)

    @property
    def identifies_yaw(self) -> bool:
        """Whether the moment of inertia about yaw is identified, or its ratio to the drag factor."""
        drag, moment = FOUND_AS[DRAG], FOUND_AS[INERTIA[2]]
        ratios = {frozenset((trade.first, trade.second)) for trade in self.trades}
        return moment not in self.not_determined or frozenset((drag, moment)) in ratios

    @property
    def bounded(self) -> tuple[str, ...]:
        """Numbers of a body by bounds that have bounds: about yaw the one that was found, for two have only a ratio."""
        yaw = [name for name in (FOUND_AS[INERTIA[2]], FOUND_AS[DRAG]) if name in self.found]
        names = (FOUND_AS[INERTIA[0]], FOUND_AS[INERTIA[1]], *(yaw if len(yaw) == 1 else ()))
        known = self.by_bounds & np.isfinite(self.loop.low * self.loop.high)
        return tuple(name for name, own in zip(names, known.tolist(), strict=False) if own and name in self.found)

    @cached_property
    def found(self) -> Mapping[str, FoundNumber]:
        """The numbers by name."""
        return {number.name: number for number in self.numbers}

    @property
    def named(self) -> tuple[str, ...]:
        """Numbers of the fit that mean something by themselves, those of a learned remainder left out."""
        return tuple(name for name in self.found if not is_learned(name))

    @property
    def on_bound(self) -> tuple[str, ...]:
        """Numbers that lie on a bound of what is tried, and are not just zero."""
        return tuple(name for name in self.named if self.found[name].at_bound and self.found[name].value)

    @cached_property
    def not_determined(self) -> tuple[str, ...]:
        """Numbers that the flights do not identify: not determined, on a bound, of no vehicle, or guesses still."""
        weak = {number.name for number in self.numbers if not number.determined} | {*self.on_bound, *self.impossible}
        guessed = (FOUND_AS[key] for name in self.guessed for key in GUESSES[name])
        return (*(name for name in self.named if name in weak), *(key for key in guessed if key not in self.named))

    @property
    def impossible(self) -> tuple[str, ...]:
        """Numbers that were found and that no such vehicle has."""
        wrong = {number.name for number in self.numbers if not number.possible} | {*of_no_body(self.model)}
        return tuple(name for name in self.named if name in wrong)

    @property
    def unreal(self) -> tuple[str, ...]:
        """Moments of inertia about roll and pitch that its forecast turns by and that are on a bound, or of no body."""
        wrong = {*self.on_bound, *of_no_body(self.forecast or self.model)}
        turning = (FOUND_AS[key] for key in INERTIA[:2])
        return tuple(name for name in turning if name in wrong and name in self.named)

    @property
    def sought(self) -> int:
        """How many numbers were looked for, guesses among them."""
        return len({*self.named, *self.not_determined})

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Its constants by the keys of a config, known or not."""
        return {each.key: each for each in parameters_of(self)}

    @property
    def logged_slowly(self) -> bool:
        """Whether the rotors are logged too slowly for what a flight is asked to show."""
        return self.rotors_logged_hz is not None and self.rotors_logged_hz < SLOW_HZ
