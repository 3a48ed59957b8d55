"""A vehicle found in flights, with how well it predicts flights that it was not found in, and how far to trust it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.artifacts.model import AnyModel, of_no_body
from cpfls_cli.artifacts.parameters import DRAG, FOUND_AS, GUESSES, INERTIA, Parameter, is_learned, parameters_of
from cpfls_cli.flightlog.stated_vehicle import SLOW_HZ
from cpfls_cli.playback.errors import FADING, AlongFlights
from cpfls_cli.playback.vehicle import FoundNumber, FoundVehicle
from cpfls_cli.response.flown import VehicleResponse
from cpfls_cli.response.mismatch import NOT_ACCEPTABLE, NOT_JUDGED, ROTATION, THRUST, response_word
from cpfls_cli.result import About, about, part, result
from cpfls_cli.validation.trust import GOOD, Trust, capped, trust_by_playback


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
        if name in (*ROTATION, THRUST) and (each.instrumented or not instrumented)
    )


@result
class Vehicle(FoundVehicle, AnyModel):
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
            identified = identified and self.identifies_yaw and not self.loop.misses
            return capped(
                self._by_playback,
                self.contradictions,
                loop=self.loop.shows_loop,
                lacks=self.responses_off,
                identified=identified,
            )
        lacks = self.responses_off or self.instruments.lacks
        word = Trust.SIMULATION if lacks or self.responses_judged else Trust.NOT_JUDGED
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
    def responses_judged(self) -> bool:
        """Whether the frequency responses of roll and pitch are judged, both."""
        return len(self._turning) == len(ROTATION[:2]) and NOT_JUDGED not in self._turning

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
