"""The part of a log in which the vehicle flies: not on the ground, not idling, not disarmed."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.ndimage import binary_dilation

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog import crash
from cpfls_cli.flightlog.crash import ALIVE, HARD, LIVELY_RAD_S, SLOW_S, Resting, Signs, averaged, smoothed
from cpfls_cli.flightlog.names import BY_HAND
from cpfls_cli.flightlog.repair import SignalTable, fill, increasing_rows
from cpfls_cli.flightlog.settings import ROTORS, ImportSettings
from cpfls_cli.flightlog.stretches import live_rows
from cpfls_cli.units import STANDARD_GRAVITY

_OF_HOVER = 0.6  # Share of the level at hover below which rotors idle.
_OF_LARGEST = 0.5  # Share of the largest level above which rotors carry the vehicle.
_SHORT_S = 1.0  # Shorter pauses are part of a flight, and shorter flights none.
_OF_HEIGHT, _LEAST_HEIGHT = 0.1, 0.05  # Above the ground it flies: as a share of the highest, and in m.
_CLIMBS_M_S = 0.2  # Rate at which no estimate of height drifts for long.
_MARGIN_S = 0.5  # Left out after take-off and before landing, where the ground pushes.
_STILL_RAD_S = 0.005  # Rate below which a vehicle does not turn.
_SOFT_RAD_S = 0.02  # Slow rates, and
_PUSHED = 0.03  # slow forces in weights, that nothing on the ground has;
_RANGE = 6.0  # Of means of noise over a log, in their standard deviations;
_OF_NOISE = 1.3  # how far those of noise may be beyond what its number of samples makes them.
_DRIFTS_M_S, _DRIFTS_M = 0.12, 1.0  # Rate and range of an estimated height on the ground at most.
_FAR_RAD = 0.2  # Range of leans that no estimate has there.
_UNMOVED, _STILL_M = 0.01, 0.3  # Ranges of height, m, and lean, rad, that no hover keeps to; of a height that drifts.
_ABOVE_IDLE = 1.2  # Times the level at which rotors idle amid a flight.
# Rate from which on forces are held against it, and slope and correlation of both from which on a stand holds the
# vehicle; by what share of all that four rotors do two of them do more than the others: any two turn the vehicle.
_SWINGS_RAD_S, _AS_HELD, _UNEVEN = 0.03, 0.6, 0.29
# Range of squared commands, over their mean, whose thrust is felt in the air, unless it climbs by so many m; and the
# share of it that is felt where something else holds the vehicle.
_WORKS, _CLIMBS_M, _UNFELT = 1.0, 3.0, 0.12
# Rate, also as a share of that in flight, from which on what idles falls or flips, and does not stand; force in weights
# below which it falls, on the mean over s.
_TURNS_RAD_S, _OF_TURNING, _FALLS, _TURN_S = 0.2, 0.3, 0.3, 0.2
# Slow force in weights that nothing but rotors gives, and share of the hover level by others below which it counts.
_LIFTS, _OF_CLIMB = 1.15, 0.8
_LONGEST_CUT_S = 3.0  # Longer than that no throttle is cut in flight: a fall of 44 m.
_MOST_CLOCK_HZ = 50.0  # Rate that is enough to find a flight.
_STAND = "the rotors stand still or idle"  # Of some logs no command is both.
_FEWEST_ROWS = 10  # Of which it can be seen.
SHORTEST_FLIGHT_S = 2.0  # Below which nothing is a flight.


def too_short(span_s: float) -> str:
    """Say that so many s are no flight."""
    return f"only {span_s:.2g} s; a flight to learn from has at least ten"


@dataclass(frozen=True)
class FlownPart:
    """What of a log is a flight."""

    # Begin and end of the longest stretch that flies, s from the log's first stamp; None where all of it flies.
    span_s: tuple[float, float] | None
    reasons: tuple[str, ...]  # What was cut, where, and how that is known; what else flies and is left out.
    flies: bool = True  # False where nothing in it flies.
    stretches_s: tuple[tuple[float, float], ...] = ()  # Begin and end of each stretch that flies, in order,
    air_s: tuple[tuple[float, float], ...] = ()  # and with what is close to the ground.
    ended: str = ""  # How flight ended before its time, and what is used; empty where nothing ended it.
    used: str = ""
    # What ended flights before their time, of all stretches, by the names of `crash.MOMENTS`, s.
    moments: tuple[tuple[str, float], ...] = ()

    def within(self, ended: str, looked_at: tuple[float, float]) -> Self:
        """Say that a part, from and to s, was looked at alone, since sources of the log ended there."""
        if not ended or not self.flies:
            return self
        span = self.span_s or (round(looked_at[0], 2), round(looked_at[1], 2))
        words = f"the {span[1] - span[0]:.0f} s of flight in between are used"
        return replace(
            self,
            span_s=span,
            ended="; ".join(filter(None, (ended, self.ended))),
            used=self.used if self.ended else words,
        )

    @property
    def cut(self) -> tuple[str, ...]:
        """What ended the flight, and what else was cut."""
        return (*([f"{self.ended}; {self.used}"] if self.ended else []), *self.reasons)


def rotor_shares(speeds: Array, *, shares: bool) -> Array:
    """Give speeds or commands of rotors, shape (time, rotor), as shares of the largest mean unless they are so."""
    return np.asarray(speeds if shares else speeds / max(1.0, float(np.quantile(speeds.mean(axis=1), 0.98))))


def flown_crop(table: SignalTable, settings: ImportSettings) -> tuple[tuple[float, float] | None, tuple[str, ...]]:
    """Find the longest stretch of a log that is flown, by the signals that a config maps, and say what that cuts."""
    flown = _flown_of(table, settings)
    if not flown.flies:
        raise SettingError("crop_s", f"flown: {flown.reasons[0]}")
    return flown.span_s, flown.cut


def warn_of_end(table: SignalTable, settings: ImportSettings) -> tuple[str, ...]:
    """Say how flight ends early in what a crop keeps."""
    flown = _flown_of(table, settings)
    begin, end = flown.span_s or (-np.inf, np.inf)
    if not flown.ended or max(begin - table.time[0], table.time[-1] - end) < _MARGIN_S:
        return ()
    return (f"{flown.ended}, and import.crop_s keeps what comes after; import.crop_s: flown cuts it",)


def _flown_of(table: SignalTable, settings: ImportSettings) -> FlownPart:
    """Find what flies by the signals that a config maps, on the clock of the log."""
    table = table.rows(increasing_rows(table.time)[0])
    live, ended = live_rows(table, 0.0)
    table = table.rows(live)
    if len(table.time) < _FEWEST_ROWS:
        return FlownPart(None, ())
    step = max(float(np.median(np.diff(table.time))), 1 / _MOST_CLOCK_HZ)
    clock = np.arange(table.time[0], table.time[-1], step)
    if len(clock) < _FEWEST_ROWS:
        return FlownPart(None, ())
    known = {
        name: fill(table.time, table.signals[name], clock)
        for name in ("rotor_command", "rotor_speed", "position", "body_rate", "acceleration", "quaternion", "attitude")
        if name in table.signals and np.isfinite(table.signals[name]).any(axis=0).all()
    }
    name = next((name for name in ROTORS if name in known), None)
    up = 1.0 if settings.world_frame == "ENU" else -1.0
    signs = Signs(
        time=clock,
        rotors=rotor_shares(known[name], shares=settings.signals[name].unit == "1") if name else None,
        height=up * known["position"][:, 2] if "position" in known else None,
        body_rate=known.get("body_rate"),
        upright=crash.upright_of(known.get("attitude"), known.get("quaternion"), settings.quaternion_order),
        force=known.get("acceleration") if settings.acceleration_frame == "body-specific-force" else None,
    )
    flown = find_flown(signs)
    return flown.within(ended, (float(clock[0]), float(clock[-1])))


def find_flown(signs: Signs) -> FlownPart:
    """Find the stretches of a log that are flown, and the longest of them."""
    signs = signs.slower(_MOST_CLOCK_HZ)
    active, how = _active(signs)
    if active is None:
        return FlownPart(None, (how,), flies=False)
    if crash.turns_over(signs, active):
        why = "by its attitude it lies on its back for seconds, and it feels its weight along its rotors all the while"
        return _no_flight(f"{why}: it stands, and the attitude is wrong")
    rests = crash.resting(signs, active)
    active = _lifted(signs, smoothed(active & ~rests.carried, signs.period, _SHORT_S))
    if not active.any():
        return _no_flight(f"{how} throughout")
    if held := _held(signs, active):
        flies = _before_hits(signs, active)
        if not flies.any():
            return _no_flight(f"{held}, as on a test stand")
        active, rests = flies, rests._replace(carried=rests.carried | (active & ~flies))
    if _still(signs, active):
        return _no_flight("the vehicle neither turns nor moves")
    return _longest(signs, active, rests, how)


def _no_flight(why: str) -> FlownPart:
    return FlownPart(None, (f"no flight in it: {why}",), flies=False)


def _active(signs: Signs) -> tuple[BoolArray | None, str]:
    """Mark the samples in which the vehicle flies, and say how that is known."""
    level, height, rate, period = signs.level, signs.height, signs.turning, signs.period
    if level is not None:
        largest = float(np.quantile(level, 0.98))
        if largest < ALIVE:
            moved = rate is not None and float(np.quantile(rate, 0.9)) > _TURNS_RAD_S
            by_hand = ", and it is turned by hand" if moved else ""
            return None, f"no flight in it: {_STAND} throughout{by_hand}"
        turning = _carried(signs, largest)
        how = f"the rotors are below {100 * _OF_HOVER:.0f} % of their hover level"
        how += "" if rate is None else ", with hardly any rotation"
        if height is None or not turning.any() or turning.all():
            return turning, how
        return _off_the_ground(turning, height, period), how + ", or it is on the ground"
    if height is not None and (rate is None or float(np.ptp(height)) > 2 * _LEAST_HEIGHT):
        ground, ranges = float(np.quantile(height, 0.02)), float(np.ptp(height))
        above = height - ground > max(_LEAST_HEIGHT, _OF_HEIGHT * ranges)
        starts_there = abs(float(np.median(height[: max(1, round(_SHORT_S / period))])) - ground) < _LEAST_HEIGHT
        stood = starts_there and ranges > 2 * _LEAST_HEIGHT
        return smoothed(above, period, _SHORT_S) if stood else np.ones(len(height), dtype=bool), "it is on the ground"
    if rate is None:
        why = "no rotors, no height and no rates are recognised, so flight cannot be distinguished from standing"
        return None, f"{why}: {BY_HAND}"
    spread = np.sqrt(averaged(rate**2, period, _SHORT_S))
    quiet = spread < max(_STILL_RAD_S, 0.05 * float(np.quantile(spread, 0.9)))
    return np.asarray(~quiet, dtype=bool), "it does not turn at all"


def _carried(signs: Signs, largest: float) -> BoolArray:
    """Mark where the rotors carry the vehicle, or idle in free fall and in flips: then it turns, and not for long."""
    level = signs.level
    assert level is not None, "asked for"
    # Thrust goes as the square of the level, or with it: who mostly climbs hovers at less than his usual level.
    felt, of_hover = None, level
    if signs.felt is not None:
        felt = averaged(np.linalg.norm(signs.felt, axis=1), signs.period, _TURN_S)
        # By the mean force, in which vibration is none.
        of_hover = level / np.sqrt(np.maximum(np.linalg.norm(averaged(signs.felt, signs.period, _TURN_S), axis=1), 1.0))
    hover = float(np.median(of_hover[level > _OF_LARGEST * largest]))
    if signs.felt is not None and signs.slow is not None:
        # In a fast climb rotors give less thrust: it hovers at no more than the level at which it is lifted, and turns,
        # as it does not on the ground, where an accelerometer may read too much.
        hits = np.linalg.norm(signs.felt, axis=1) > HARD
        lifted = np.linalg.norm(averaged(signs.felt, signs.period, SLOW_S), axis=1) > _LIFTS
        lifted &= (
            (level > ALIVE)
            & (signs.slow > LIVELY_RAD_S)
            & ~binary_dilation(hits, np.ones(2 * max(1, round(SLOW_S / signs.period)) + 1, dtype=np.bool_))
        )
        least = float(np.quantile(of_hover[lifted], 0.25)) if lifted.sum() * signs.period > _SHORT_S else hover
        hover = least if least < _OF_CLIMB * hover else hover
    carrying = np.asarray(level > _OF_HOVER * hover, dtype=bool)
    if signs.rate is not None and carrying.any():
        # Idling rotors shake what stands on the ground, and do not turn it.
        slow = np.linalg.norm(averaged(signs.rate, signs.period, _TURN_S), axis=1)
        lively = _lively(slow, carrying, signs.period)
        if felt is not None:
            lively |= felt < _FALLS
        # A throttle that is cut, and not a vehicle that is carried back to where it takes off.
        lively &= smoothed(level > ALIVE, signs.period, _LONGEST_CUT_S)
        first, last = np.flatnonzero(carrying)[[0, -1]]
        carrying[first:last] |= lively[first:last]
        if felt is None:
            # Once off the ground it hovers at the usual level of a flight, which its flips and climbs are above.
            flight = smoothed(carrying, signs.period, _LONGEST_CUT_S)
            flight &= level > _ABOVE_IDLE * (np.quantile(level[flight], 0.05) if flight.any() else np.inf)
            carrying[first:] |= level[first:] > _OF_HOVER * (np.median(level[flight]) if flight.any() else hover)
    return smoothed(carrying, signs.period, _SHORT_S)


def _lively(turning: Array, flies: BoolArray, period: float) -> BoolArray:
    """Mark where it turns, shape (time,), rad/s, at least by itself and against what it does in flight."""
    turns = np.sqrt(averaged(turning**2, period, _SHORT_S))
    return np.asarray(turns > max(_TURNS_RAD_S, _OF_TURNING * float(np.median(turns[flies]))), dtype=bool)


def _lifted(signs: Signs, active: BoolArray) -> BoolArray:
    """Begin stretches with their first motion, where no height shows that rotors turn on the ground before it."""
    if signs.height is not None or signs.slow is None:
        return active
    lifted = active.copy()
    for first, after in runs(active):
        moves = np.flatnonzero(signs.slow[first:after] > LIVELY_RAD_S)
        if first > 0 and len(moves):
            lifted[first : first + moves[0]] = False
    return lifted


def _off_the_ground(turning: BoolArray, height: Array, period: float) -> BoolArray:
    """Take away what turns its rotors on the ground that it stands on before."""
    first = int(np.argmax(turning))
    if first < _SHORT_S / period:
        return turning
    ground = float(np.median(height[max(0, first - max(1, round(1 / period))) : first]))
    highest = float(np.quantile(np.abs(height - ground)[turning], 0.95))
    if highest < 2 * _LEAST_HEIGHT:
        return turning
    risen = np.abs(height - ground) > max(_LEAST_HEIGHT, _OF_HEIGHT * highest)
    off, step, rows = np.zeros_like(turning), max(1, round(SLOW_S / period)), np.arange(len(height))
    least = _CLIMBS_M_S * step * period
    rises = height - height[np.maximum(rows - step, 0)] > least
    sinks = height - height[np.minimum(rows + step, rows[-1])] > least
    # Between the first and the last moment above it a flight may well come down to the height of its ground.
    for first, after in runs(turning):
        high = first + np.flatnonzero(risen[first:after])
        if len(high):
            # What climbs or sinks without a pause from or to there flies as well.
            still = np.append(-1, np.flatnonzero(~rises[first : high[0]]))[-1]
            lands = np.append(np.flatnonzero(~sinks[high[-1] : after]), after - high[-1] - 1)[0]
            off[first + still + 1 : high[-1] + lands + 1] = True
    return smoothed(off, period, _SHORT_S)


def _still(signs: Signs, active: BoolArray) -> bool:
    """Tell whether a vehicle whose rotors turn stands on the ground or is bound to a bench.

    Its rates and forces are those of vibration, and its height changes no faster than an estimate drifts, or so fast
    that it would be felt.
    """
    if signs.rate is None:
        rises = np.inf if signs.height is None else float(np.ptp(signs.height[active]))
        level = signs.upright is not None and _leans(signs, active) < _UNMOVED
        return rises < (_STILL_M if level else _UNMOVED)
    if _moves(signs.rate, active, signs.period, (_SOFT_RAD_S, LIVELY_RAD_S)) or _climbs(signs, active):
        return False
    # Leans say more than a gyroscope that reads next to nothing.
    dead = np.sqrt((signs.rate[active] ** 2).sum(axis=1).mean()) < _STILL_RAD_S
    if (dead or signs.felt is None) and _leans(signs, active) >= _FAR_RAD:
        return False
    return signs.felt is None or not _moves(signs.felt, active, signs.period, (_PUSHED, np.inf))


def _moves(values: Array, active: BoolArray, period: float, sizes: tuple[float, float]) -> bool:
    """Tell whether slow means of what a sensor reads are above the first size and the mean of noise, or the second."""
    values = np.where(active[:, None], values - np.median(values[active], axis=0), 0.0)
    shakes, slow = (
        np.sqrt((each[active] ** 2).sum(axis=1).mean()) for each in (values, averaged(values, period, SLOW_S))
    )
    return bool(slow > np.clip(_OF_NOISE * shakes / np.sqrt(max(1, round(SLOW_S / period))), *sizes))


def _climbs(signs: Signs, active: BoolArray) -> bool:
    """Tell whether a height changes faster and farther than it drifts, by accelerations that are felt."""
    second, edge = (max(1, round(seconds / signs.period)) for seconds in (1.0, SLOW_S))
    if signs.height is None or len(active) <= 2 * (second + edge):
        return False
    # A height in steps is known where it changes.
    known = np.flatnonzero(np.diff(signs.height, prepend=np.nan) != 0)
    height = np.interp(signs.time, signs.time[known], signs.height[known])
    # Means at the ends of a log would bend a steady climb.
    span, height = second * signs.period, averaged(height, signs.period, SLOW_S)[edge:-edge]
    there = (active & (signs.time <= signs.time[known[-1]]))[edge:-edge]
    rates = np.where(there[second:] & there[:-second], height[second:] - height[:-second], np.nan) / span
    needed = np.nanmax(np.abs(rates[second:] - rates[:-second]), initial=0.0) / span / STANDARD_GRAVITY
    pushed = np.inf
    if signs.felt is not None:
        slow = averaged(signs.felt, signs.period, SLOW_S)
        shakes = (signs.felt - slow)[active].std(axis=0) / np.sqrt(edge)
        pushed = float((np.ptp(slow[active], axis=0) - _RANGE * shakes).max())
    far = pushed > _PUSHED or (there.any() and np.ptp(height[there]) > _DRIFTS_M)
    return bool(far and needed < max(pushed, _PUSHED) and np.nanmax(np.abs(rates), initial=0.0) > _DRIFTS_M_S)


def _held(signs: Signs, active: BoolArray) -> str:
    """Say by what something else than rotors is seen to hold a vehicle whose rotors turn; empty where nothing is."""
    if signs.rotors is None:
        return ""
    if signs.rotors.shape[1] == 4 and signs.slow is not None:
        shares = np.nan_to_num(signs.rotors)[active]
        third = np.sort(shares[shares.mean(axis=1) > ALIVE], axis=1)[:, 1]
        if len(third) and float(np.median(third)) < ALIVE:
            return "no more than two of its four rotors work at a time"
        works = np.median(shares, axis=0)
        apart = np.abs(2 * (works[0] + works[1:]) - works.sum()).max()
        if apart > _UNEVEN * works.sum() and float(np.median(signs.slow[active])) < _TURNS_RAD_S:
            return f"rotor {np.argmin(works) + 1} works far less than the others, and it does not spin"
    if _unfelt(signs, active):
        return "what it feels does not grow with its thrust"
    if signs.body_rate is None or signs.felt is None:
        return ""
    # At rest the weight turns through the body as the body turns; in the air it stays along the rotors' axis. Where an
    # accelerometer sits off the centre of a vehicle that vibrates, forces and turning are alike too, but not slowly.
    for over_s in (_TURN_S, SLOW_S):
        turns, felt = (averaged(each, signs.period, over_s) for each in (signs.body_rate, signs.felt))
        turned = -np.cross(turns - np.median(turns, axis=0), felt)[active, :2]
        moved = np.gradient(felt, signs.period, axis=0)[active, :2]
        power, both = float((turned**2).mean()), float((turned * moved).mean())
        alike = both / np.sqrt(power * float((moved**2).mean()) + 1e-12)
        swings = power > _SWINGS_RAD_S**2
        # What does not swing slowly, as its mean does not at 2 Hz, is judged as it swings fast.
        if (swings and min(both / power, alike) < _AS_HELD) or not (swings or over_s == SLOW_S):
            return ""
    return "the weight turns through it as it turns"


def _before_hits(signs: Signs, active: BoolArray) -> BoolArray:
    """Mark what feels its thrust, of the parts between hits: what stands or lies since a hit has flown before."""
    flies = np.zeros_like(active)
    if signs.felt is None or signs.level is None:
        return flies
    hits = np.linalg.norm(signs.felt, axis=1) > HARD
    if not hits.any():
        return flies
    step = max(1, round(SLOW_S / signs.period))
    squares, felt = (averaged(each, signs.period, SLOW_S) for each in (signs.level**2, signs.felt))
    # Means reach into what is before and after.
    for first, after in runs(~binary_dilation(hits | ~active, np.ones(2 * step + 1, dtype=np.bool_))):
        now, before = slice(first + step, max(first + step, after)), slice(first, max(first, after - step))
        thrust = np.median(felt[first:after], axis=0)
        # Over half a second neither a battery nor the air changes.
        works, feels = squares[now] - squares[before], (felt[now] - felt[before]) @ thrust
        both, power = float(works @ feels), float(works @ works)
        alike = both / np.sqrt(power * float(feels @ feels) + 1e-12)
        share = _UNFELT * float(thrust @ thrust) / float(squares[first:after].mean())
        flies[max(0, first - step) : after + step] = alike > _AS_HELD and both > share * power
    return smoothed(flies & active, signs.period, _SHORT_S)


def _unfelt(signs: Signs, active: BoolArray) -> bool:
    """Tell whether a vehicle feels no more where its rotors work much more."""
    climbs = signs.height is not None and float(np.ptp(signs.height[active])) > _CLIMBS_M
    if signs.level is None or signs.felt is None or climbs:
        return False
    judged = active.copy()
    if signs.turning is not None:
        # What is held feels the same where it idles, and mostly shakes then too.
        first, last = np.flatnonzero(active)[[0, -1]]
        shakes = _lively(signs.turning, active, signs.period) & smoothed(
            signs.level > ALIVE, signs.period, _LONGEST_CUT_S
        )
        judged[first:last] |= shakes[first:last]
    squares, felt = (averaged(each, signs.period, SLOW_S)[judged] for each in (signs.level**2, signs.felt))
    thrust = np.median(felt, axis=0)
    ranges = (np.ptp(np.quantile(each, [0.05, 0.95])) for each in (squares / squares.mean(), felt @ thrust))
    works, feels = map(float, ranges)
    return works > _WORKS and feels < _UNFELT * works * float(thrust @ thrust)


def _leans(signs: Signs, active: BoolArray) -> float:
    """Give the range of leans, rad, without their vibration; 0 where none are known."""
    if signs.upright is None:
        return 0.0
    upright = np.clip(np.abs(averaged(signs.upright, signs.period, SLOW_S)[active]), 0.0, 1.0)
    return float(np.ptp(np.quantile(np.arccos(upright), [0.05, 0.95])))


def _longest(signs: Signs, active: BoolArray, rests: Resting, how: str) -> FlownPart:
    time, stretches = signs.time, runs(active)
    ends = [crash.ended_early(signs, rests, part) for part in stretches]
    # The first sample that flies no more.
    stops = [min(after, *own.values()) if own else after for (_, after), own in zip(stretches, ends, strict=True)]
    air = tuple((float(time[first]), float(time[stop - 1])) for (first, _), stop in zip(stretches, stops, strict=True))
    cut = []
    for (first, _), stop, early_end, (begin, end) in zip(stretches, stops, ends, air, strict=True):
        # What is close to the ground at either end is left out, but where the log begins or ends in flight.
        margin = min(_MARGIN_S, (end - begin) / 10)
        free = stop == len(time) or early_end
        cut.append((begin + (margin if first > 0 else 0.0), end - (0.0 if free else margin)))
    chosen = max(range(len(cut)), key=lambda index: cut[index][1] - cut[index][0])
    (first, after), (begin, end) = stretches[chosen], cut[chosen]
    early = [index for index, own in enumerate(ends) if own]
    # How the stretch that is used ended matters more than how another one did.
    index = chosen if ends[chosen] else early[0] if early else chosen
    ended = ", ".join(crash.MOMENTS[what].format(time[at]) for what, at in ends[index].items())
    if end - begin < SHORTEST_FLIGHT_S:
        return FlownPart(None, ("; ".join(filter(None, (f"flies for {too_short(end - begin)}", ended))),), flies=False)
    reasons = []
    ground, landed = stretches[0][0], stretches[-1][1]
    if ground > 0 and not any(index < chosen for index in early):
        reasons.append(f"the first {cut[0][0] - time[0]:.1f} s are cut: {_how(signs, slice(0, ground), how)}")
    if landed < len(time) and not ends[-1]:
        last = float(time[-1]) - cut[-1][1]
        reasons.append(f"the last {last:.1f} s are cut: {_how(signs, slice(landed, None), how)}")
    others = [f"{time[a]:.1f} to {time[b - 1]:.1f} s" for (a, _), b in zip(stretches, stops, strict=True) if a != first]
    if others:
        reasons.append(f"it also flies at {', '.join(others)}; import.crop_s takes one stretch, the longest")
    whole = first == 0 and after == len(time) and not ends[chosen]
    used = f"the {end - begin:.0f} s before it are used" if index == chosen else f"{begin:.1f} to {end:.1f} s are used"
    span = None if whole else (round(begin, 2), round(end, 2))
    moments = tuple((what, float(time[at])) for own in ends for what, at in own.items())
    return FlownPart(span, tuple(reasons), True, tuple(cut), air, ended, used, moments)


def _how(signs: Signs, part: slice, how: str) -> str:
    if signs.level is None or float(np.quantile(signs.level[part], 0.9)) >= ALIVE:
        return how
    by_hand = signs.slow is not None and float(np.quantile(signs.slow[part], 0.9)) > _TURNS_RAD_S
    return _STAND + (" while it is moved by hand" if by_hand else "")
