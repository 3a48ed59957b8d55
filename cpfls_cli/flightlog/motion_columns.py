"""What the columns of motion are: gyroscope, position, velocity and accelerometer, each held against all others."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.agreement import (
    AS_NAMED,
    AxisFit,
    body_rate_from,
    first_derivative,
    fit_axes,
    second_derivative,
    slow,
)
from cpfls_cli.flightlog.airframe import explained_by_rotors
from cpfls_cli.flightlog.attitude_columns import CLEAR, GOOD, NEAR_GRAVITY, SENSED, Reading, angle_unit, nearest
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import DEGREES_FROM, RADIANS_UP_TO, Guess, LogTable, Rival, Seen, Sure, called
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.flightlog.stretches import stands_still
from cpfls_cli.flightlog.vocabulary import Row, sizes
from cpfls_cli.rotations import body_rate
from cpfls_cli.rounding import largest
from cpfls_cli.units import STANDARD_GRAVITY, UnitName, known_unit

# Wind and clocks change a size by less than the first, and never from one unit of length to the next.
_TOLERANCE, _TEN = 1.4, 10.0
_FASTEST_M_S = 100.0  # Speed over a second that no multirotor flies.
# Rate beyond which no gyroscope reads, deg/s, and the counts that one deg/s is to those of 16 bits for 2000 deg/s.
_FASTEST_DEG_S, _COUNTS, _THOUSANDTHS = 4100.0, 16.4, 1000.0
_USUAL = 0.999  # Share of a flight in which no sample is damaged.
# Ratios to gravity of columns that are known to hold it, also where the sensor reads wrong; and of what is no more.
_BY_NAME, _WEIGHT = 2.0, 1.15
# Up to where a rate is compared with the attitude's derivative, and the share from which on it may be nothing else: of
# a gyroscope with motion capture it is 0.1 to 0.4.
_FAST_HZ, _DERIVED = 10.0, 0.8
# Residual of a velocity in body axes, as a share of that in those of the world, that shows the former.
_CLOSER = 0.4
# Difference of Euler and body rates, as a share of them, that matters to nothing; and what is
# left of rates by the ones, as a share of what is left by the others, that shows the former.
_ALIKE, _CLEARLY = 0.02, 0.8
_TUMBLES = 3.0  # Times the rate that 95 % of a log stay below.
# Correlations of one axis: below the first a column follows nothing, below the second it runs the other way.
_ALONG, _AGAINST = 0.3, -0.6


# The gyroscope.


def gyroscope_first(seen: Seen, reading: Reading, rotors: Guess | None) -> bool:
    """Put a gyroscope before a rate that is the attitude's own derivative, where the rotors explain more of it.

    Both are one motion where that is slow. Above, a derivative holds what noise and filter of the attitude make of it,
    and a gyroscope what the rotors do.
    """
    first, *others = seen.candidates.get("body_rate", ()) or (None,)
    fit = reading.rates
    if first is None or first.known or rotors is None or fit is None or fit.explained < CLEAR:
        return False
    derived, rate_hz, speeds = (
        body_rate_from(reading.attitude.rotation, seen.rate_hz),
        seen.rate_hz,
        seen.mapped(rotors),
    )

    def fast_share(named: Named) -> float:
        """Give the share of what is fast of a rate that the derivative of the attitude explains."""
        fast = [slow(own, rate_hz, _FAST_HZ) - slow(own, rate_hz) for own in (derived, seen.grid(named))]
        return fit_axes(*fast).explained

    if fast_share(first) < _DERIVED:
        return False
    turning = slow(derived, rate_hz)
    own_motion = (own for own in others if fit_axes(turning, slow(seen.grid(own), rate_hz)).explained > GOOD)
    driven = {
        named: explained_by_rotors(seen.grid(named), speeds, rate_hz, rotors.signal == "rotor_command")
        for named in (first, *(own for own in own_motion if fast_share(own) < _DERIVED))
    }
    best = largest(driven, lambda named: driven[named])
    if best is first:
        return False
    seen.candidates = {**seen.candidates, "body_rate": (best, *(own for own in (first, *others) if own is not best))}
    seen.left_out.append(
        f"{', '.join(first.group.columns)}: also a body rate, but the derivative of the attitude, of which the rotors"
        f" explain {100 * driven[first]:.0f} % where they explain {100 * driven[best]:.0f} % of"
        f" {', '.join(best.group.columns)}"
    )
    return True


def take_body_rate(seen: Seen, reading: Reading | None) -> None:
    """Take the gyroscope as the derivative of the attitude has it, or else by its name and its spread."""
    named = seen.first("body_rate")
    if named is None:
        return
    fit, stated = None if reading is None else reading.rates, named.unit
    if fit is not None and fit.explained > CLEAR:
        near = sorted(sizes("body_rate"), key=lambda row: abs(np.log(fit.gain / row.size)))
        size, unit, scale = near[0]
        near = [row for row in near if abs(np.log(fit.gain / row.size)) < np.log(_TOLERANCE)]
        agrees = bool(near)
        if stated is not None and known_unit(stated).factor != known_unit(unit).factor * scale:
            if agrees:
                seen.disagree(named, unit)
            else:
                unit, scale = stated, 1.0
        if not agrees:
            seen.warnings.append(
                f"{named.group.pattern} is {fit.gain:.3g} times as large as the attitude's derivative, which no unit"
                " explains: is the unit of the stamps right?"
            )
        # Attitudes are filtered by more than what these two are apart.
        counts = Rival(f"unit: deg/s, scale: {1 / _COUNTS:.4g}", "if it is counts of 16 bits, which are 6 % more")
        others = [Rival(f"unit: {row.unit}, scale: {row.scale:.4g}", f"{row.size:.4g} is near too") for row in near[1:]]
        rivals = (
            (*([counts] if size == _THOUSANDTHS else ()), *others) if agrees and scale < 1.0 and stated is None else ()
        )
        sure: Sure = "data" if agrees and not rivals else "guess"
        words = _rates_in_words(named, fit, unit, scale)
        seen.take(named, unit, words, sure, scale, fit.order, fit.sign, rivals)
        _doubt_rates(seen, named, fit)
        return
    values = seen.grid(named)
    spread = float(np.sqrt(values.var(axis=0).sum()))
    between = RADIANS_UP_TO <= spread <= DEGREES_FROM
    unit = stated or ("deg/s" if spread > DEGREES_FROM else "rad/s")
    rivals = (Rival("unit: deg/s", f"a spread of {spread:.2g} fits both"),) if between and not stated else ()
    size_in_words = f"a spread of {spread:.2g} in flight" if stated is None else f"which is in {stated}"
    # A few samples may be damaged.
    fastest, scale = float(np.quantile(np.abs(values).max(axis=1), _USUAL)), 1.0
    of_log = seen.log.stated_unit(named.group.columns[0], "body_rate")
    if of_log is None and unit == "deg/s" and fastest > _FASTEST_DEG_S:
        # Firmwares before Betaflight, and loggers of students, write what the sensor gives.
        scale, size_in_words = 1 / _COUNTS, f"up to {fastest:.4g}, which no gyroscope reads in deg/s: counts of 16 bits"
        rivals = (Rival(f"scale: {1 / 14.29:.4g}", "if it is an L3G4200D, whose deg/s has 14.3 counts"),)
    turned = "" if named.sign is None else "; signs as in such logs"
    against = "there is no changing attitude to compare it with"
    if fit is not None:
        against = f"the derivative of the attitude explains only {100 * fit.explained:.0f} % of it"
        seen.warnings.append(
            f"{named.group.pattern}: {against}; one of the two is late, noisy or in other axes; the axes"
            " are taken as named"
        )
    sure = "guess" if rivals or fit is not None else "named"
    reason = f"{called(named)}, {size_in_words}{turned}; {against}"
    seen.take(named, unit, reason, sure, scale, sign=named.sign, rivals=rivals)


def size_by_angles(rates: Array, angles: Array, rate_hz: float) -> float | None:
    """Give what rates are over those in rad/s, by derivatives of angles in rad; None where these do not say it."""
    fit = fit_axes(slow(first_derivative(np.unwrap(angles, axis=0), rate_hz), rate_hz), slow(rates, rate_hz))
    return nearest(fit.gain, sizes("body_rate")).size if fit.explained > GOOD else None


def _rates_in_words(named: Named, fit: AxisFit, unit: str, scale: float) -> str:
    axes = "" if fit.is_as_named else ", with its axes in this order and with these signs"
    better = f"{fit.times_better:.1f} times better than in any other order or with other signs"
    large = "as large" if f"{fit.gain:.3g}" == "1" else f"{fit.gain:.3g} times as large"
    size = f" and is {large}, so it is in {unit}" if scale == 1.0 else f", in parts of {scale:.4g} {unit}"
    return f"{called(named)}; follows the attitude's derivative{axes} ({100 * fit.explained:.0f} %, {better}){size}"


def _doubt_rates(seen: Seen, named: Named, fit: AxisFit) -> None:
    columns = [named.group.columns[index] for index in fit.order]
    seen.warn_of_mirrored(named, fit.order, fit.sign, "the attitude")
    loose = [c for c, own in zip(columns, fit.along, strict=True) if not own > _ALONG]
    if loose and max(fit.along) > GOOD:
        seen.warnings.append(f"{', '.join(loose)}: does not follow the attitude's derivative, unlike the other axes")
        seen.doubt("body_rate", Rival("leave body_rate out", f"{', '.join(loose)} follows nothing in the log"))


# Position and velocity.


def without_other_axes(log: LogTable, candidates: Mapping[SignalName, list[Named]]) -> dict[SignalName, list[Named]]:
    """Leave out places that only their axes make one, but where the velocity is their derivative."""
    velocity = next(iter(candidates.get("velocity", ())), None)
    rate_hz = 1 / float(log.grid[1] - log.grid[0])

    def moves(named: Named) -> bool:
        if velocity is None:
            return False
        derived = first_derivative(log.on_grid(named.group.columns), rate_hz)
        return fit_axes(slow(derived, rate_hz), slow(log.on_grid(velocity.group.columns), rate_hz)).as_named > GOOD

    places = [own for own in candidates.get("position", ()) if not own.by_axes or moves(own)]
    return {name: found for name, own in candidates.items() if (found := places if name == "position" else own)}


def without_euler_rates(log: LogTable, candidates: Mapping[SignalName, list[Named]]) -> dict[SignalName, list[Named]]:
    """Leave out derivatives of roll, pitch and yaw, but where they follow the attitude as rates of the body do.

    What is called by another name comes first.
    """
    angles = next(iter(candidates.get("attitude", ())), None)
    others, derivatives = (
        [own for own in candidates.get("body_rate", ()) if own.group.derivative is derived] for derived in (False, True)
    )
    rates = others + [own for own in derivatives if angles is not None and _turns_as_body(log, angles, own)]
    kept = {name: own for name, own in candidates.items() if name != "body_rate"}
    return kept | ({"body_rate": rates} if rates else {})


def _turns_as_body(log: LogTable, angles: Named, rates: Named) -> bool:
    rate_hz = 1 / float(log.grid[1] - log.grid[0])
    time, values = log.values(angles.group.columns)
    unit = known_unit(angle_unit(angles, angles.scale * values, time)[0])
    # Between two samples on either side of a full turn lies no angle.
    turned = np.unwrap(unit.factor * angles.scale * values, axis=0)
    attitude = np.column_stack([np.interp(log.grid, time, column) for column in turned.T])
    read, derived = log.on_grid(rates.group.columns), first_derivative(attitude, rate_hz)
    live = ~stands_still(log.grid, read)
    speed = np.linalg.norm(read - np.median(read, axis=0), axis=1)
    # In a tumble an estimator is lost, and what repeats its last value measures nothing.
    calm = live & (speed < _TUMBLES * np.quantile(speed, 0.95))
    return any(rows.any() and _nearer_body(attitude[rows], derived[rows], read[rows], rate_hz) for rows in (live, calm))


def _nearer_body(attitude: Array, derived: Array, read: Array, rate_hz: float) -> bool:
    """Tell whether rates are nearer to those of the body than to the derivatives of angles, or both are alike."""
    # A pitch may count the other way than roll and yaw do.
    ways = np.array([1.0, 1.0, 1.0]), np.array([1.0, -1.0, 1.0])
    measured, euler, *bodies = (
        slow(own, rate_hz) for own in (read, derived, *(body_rate(attitude * way, derived * way) * way for way in ways))
    )

    def left(turning: Array) -> float:
        # An offset, a wrong sign or swapped axes of a gyroscope make no derivative of it.
        return 1 - fit_axes(turning, measured).explained

    body = min(bodies, key=left)
    alike = float(((body - euler) ** 2).sum()) < _ALIKE**2 * float((euler**2).sum())
    return alike or left(body) < _CLEARLY * left(euler)


def position_by_velocity(seen: Seen) -> None:
    """Put the position first whose derivative is the velocity, where that of the first by name is clearly not."""
    velocity, positions = seen.first("velocity"), seen.candidates.get("position", ())
    if velocity is None or len(positions) < 2:
        return
    measured = slow(seen.grid(velocity), seen.rate_hz)
    left = [
        1 - fit_axes(slow(first_derivative(seen.grid(own), seen.rate_hz), seen.rate_hz), measured).explained
        for own in positions
    ]
    best = int(np.argmin(left))
    if best and left[best] < min(1 - GOOD, _CLOSER * left[0]):
        chosen, first = positions[best], positions[0]
        others = [own for own in positions if own is not chosen]
        seen.candidates = {**seen.candidates, "position": (chosen, *others)}
        seen.left_out.append(
            f"{', '.join(first.group.columns)}: also a position; its derivative explains {100 * (1 - left[0]):.0f} %"
            f" of the velocity, that of {', '.join(chosen.group.columns)} {100 * (1 - left[best]):.0f} %"
        )


def length_unit(position: Array, rate_hz: float) -> UnitName:
    """Give the unit of a position, shape (time, axis), whose name states none: m, or mm where no m could be flown."""
    second = max(1, round(rate_hz))
    speeds = np.linalg.norm(position[second:] - position[:-second], axis=1)
    return "mm" if len(speeds) and float(np.quantile(speeds, 0.9)) > _FASTEST_M_S else "m"


def take_places(seen: Seen, reading: Reading | None) -> None:
    """Take position and velocity in the axes in which the lean explains the motion, and the one derives the other."""
    position, velocity = seen.first("position"), seen.first("velocity")
    relative = None
    if velocity is not None and position is not None:
        derived = first_derivative(seen.grid(position), seen.rate_hz)
        measured = slow(seen.grid(velocity), seen.rate_hz)
        relative = fit_axes(slow(derived, seen.rate_hz), measured)
        if reading is not None:
            in_body = reading.attitude.rotation.inv().apply(derived)
            body = fit_axes(slow(in_body, seen.rate_hz), measured)
            if body.explained > GOOD and 1 - body.explained < _CLOSER * (1 - relative.explained):
                seen.left_out.append(
                    f"{velocity.group.pattern}: a velocity in body axes (the position's derivative explains"
                    f" {100 * body.explained:.0f} % there, {100 * relative.explained:.0f} % in the world);"
                    " import.signals takes velocities in world axes"
                )
                velocity = None
    tilt = None if reading is None or reading.lean is None else reading
    if position is not None:
        _take_place(seen, position, ("m", "mm"), tilt, None)
    if velocity is not None:
        _take_place(seen, velocity, ("m/s", "mm/s"), tilt, relative)


def _take_place(
    seen: Seen, named: Named, units: tuple[UnitName, UnitName], tilt: Reading | None, relative: AxisFit | None
) -> None:
    stated, place, reason = named.unit, seen.guesses.get("position"), called(named)
    unit: UnitName = stated or units[0]
    sure: Sure = "named"
    scale = 1.0
    rivals: tuple[Rival, ...] = ()
    relative = relative if relative is not None and relative.explained > CLEAR else None
    gain = float("nan") if tilt is None or tilt.lean is None else tilt.lean.gain
    leaning = (
        "" if tilt is None else f"; tilt and gravity explain {100 * tilt.place_share:.0f} % of the acceleration in"
    )
    if relative is not None and stated is None and place is not None:
        # What it is in follows from the position, whatever else is logged in other units.
        size = known_unit(place.columns.unit).factor / relative.gain
        ways: tuple[tuple[UnitName, float], ...] = ((units[0], 1.0), (units[0], 0.01), (units[1], 1.0))
        unit, scale = min(ways, key=lambda own: abs(np.log(size / (known_unit(own[0]).factor * own[1]))))
        sure = place.sure
    elif tilt is not None and stated is None:
        unit = units[gain > 100]
        sure = "data" if 1 / _TEN < gain / (1000 if gain > 100 else 1) < _TEN else "guess"
        reason += f"{leaning} {unit.split('/')[0]}"
    elif stated is None:
        spread = float(np.ptp(seen.grid(named), axis=0).max())
        sure = "data" if spread < 50 else "guess"
        unit = units[named.signal == "position" and length_unit(seen.grid(named), seen.rate_hz) == "mm"]
        reason += f"; ranges over {spread:.3g}"
        other = units[unit == units[0]]
        rivals = () if sure == "data" else (Rival(f"unit: {other}", "no leaning attitude speaks against it"),)
        if relative is None and named.is_of_unknown_place:
            sure, rivals = "guess", (*rivals, Rival("leave position out", "its name does not say that it is a place"))
    else:
        reason += f", which is in {stated}"
        # The lean was held against the velocity only where there is no position.
        leans = tilt is not None and tilt.place_share > GOOD and (named.signal == "position" or place is None)
        if leans and not 1 / _TEN < gain * known_unit(stated).factor < _TEN:
            unit, sure = units[gain > 100], "data" if gain > 100 else "guess"
            reason += f"{leaning} {unit}"
            seen.disagree(named, unit, "judged by tilt and gravity, it is in")
    # The kind of log states its axes.
    free = named.frame is None
    order, sign = (tilt.place_order, tilt.place_sign) if free and tilt is not None else AS_NAMED
    if named.signal == "velocity" and relative is not None:
        reason += f"; the position's derivative explains {100 * relative.explained:.0f} % of it"
        if free:
            # Its axes, as they lie to those of the position, behind those of the position.
            own = [-1 if along < _AGAINST else one for one, along in zip(relative.sign, relative.along, strict=True)]
            sign = tuple(own[index] * one for index, one in zip(order, sign, strict=True))
            order = tuple(relative.order[index] for index in order)
    if (order, sign) != AS_NAMED:
        reason += "; rotated into the axes of the attitude, as the tilt requires"
    seen.take(named, unit, reason, sure, scale, order, sign, rivals)
    seen.warn_of_mirrored(named, order, sign, "the rest of the log")


# The accelerometer.


def take_acceleration(seen: Seen, named: Named, reading: Reading | None) -> bool:
    """Take a candidate that holds gravity, or follows the motion over ground; tell whether it does."""
    values, stated = seen.grid(named), named.unit
    vertical = float(np.median(values[:, 2]))
    carried = _carried(seen, reading)
    near = _BY_NAME if named.known and stated else NEAR_GRAVITY
    fitting, at_hover = (
        [row for row in SENSED if 1 / near < abs(vertical) / (weight * row.size) < near] for weight in (carried, 1.0)
    )
    sensed = next((row for row in fitting if row.unit == (stated or row.unit)), fitting[0] if fitting else None)
    place, derived = seen.guesses.get("velocity"), first_derivative
    if place is None:
        place, derived = seen.guesses.get("position"), second_derivative
    along_world = None
    if place is not None:
        # The acceleration of the world, m/s^2, in the axes of what is taken for velocity or position.
        size = known_unit(place.columns.unit).factor * place.columns.scale
        world = derived(size * seen.log.on_grid(place.columns.columns)[seen.part], seen.rate_hz)
        ground = np.array([1.0, 1.0, 0.0 if sensed else 1.0])
        along_world = fit_axes(slow(ground * world, seen.rate_hz, 1.0), slow(ground * values, seen.rate_hz, 1.0))
    # In body axes next to nothing is sensed along x and y in flight; over ground the world's axes have it all.
    follows = along_world is not None and along_world.as_named > GOOD and named.frame not in ("FLU", "FRD")
    if sensed is not None and follows and along_world is not None:
        size = known_unit(sensed.unit).factor * sensed.scale * along_world.gain
        if 0.5 < size < _TEN:
            _leave_gravity_out(seen, named, along_world)
            return False
        # By chance the middle of what moves in a far smaller unit is as large as gravity.
        sensed = sensed if size < _TEN else None
    if sensed is not None:
        _take_sensed(seen, named, vertical, carried, sensed, reading)
        if at_hover and sensed not in at_hover:
            other = at_hover[0].unit
            seen.doubt(
                "acceleration", Rival(f"unit: {other}", f"at hover it would be {other}; is import.time_unit right?")
            )
        return True
    if along_world is None or along_world.explained < CLEAR:
        seen.left_out.append(
            f"{named.group.pattern}: it does not include gravity (z has a median of {vertical:.3g}), and the motion"
            " over ground does not explain it"
        )
        return False
    size, unit, scale = nearest(along_world.gain, sizes("over_ground"))
    if abs(vertical) > GOOD * size * STANDARD_GRAVITY:
        _leave_gravity_out(seen, named, along_world)
        return False
    unit, scale = (unit, scale) if stated is None else (stated, 1.0)
    reason = (
        f"{called(named)}; the motion over ground explains {100 * along_world.explained:.0f} %, in"
        f" {'thousandths of ' if scale != 1.0 else ''}{unit}, and it does not include gravity"
    )
    seen.take(named, unit, reason, "data", scale=scale)
    words = "the acceleration does not include gravity and follows the motion"
    seen.choose("acceleration_frame", "world", words, "data")
    return True


def _leave_gravity_out(seen: Seen, named: Named, fit: AxisFit) -> None:
    seen.left_out.append(
        f"{named.group.pattern}: an acceleration in world axes that includes gravity (the motion explains"
        f" {100 * fit.as_named:.0f} %), which import.signals cannot express"
    )


def _carried(seen: Seen, reading: Reading | None) -> float:
    """Give how many times its weight the rotors carry, by the motion; 1 where that says nothing."""
    position = seen.first("position")
    if position is None or reading is None or reading.lean is None:
        return 1.0
    moving = second_derivative(seen.grid(position), seen.rate_hz) / (1000.0 if reading.lean.gain > 100 else 1.0)
    up = reading.place_sign[2] * (1.0 if reading.world == "ENU" else -1.0)
    size = np.linalg.norm(moving + np.array([0.0, 0.0, up * STANDARD_GRAVITY]), axis=1)
    return float(np.median(size)) / STANDARD_GRAVITY


def _take_sensed(
    seen: Seen, named: Named, vertical: float, carried: float, sensed: Row, reading: Reading | None
) -> None:
    _, unit, scale = sensed
    up = "FLU" if vertical > 0 else "FRD"
    by_lean = None if reading is None or reading.lean is None else reading.body
    body = by_lean or (named.frame if named.frame in ("FLU", "FRD") else None)
    weight = "gravity" if 1 / _WEIGHT < carried < _WEIGHT else f"{carried:.2g} times gravity, as it moves"
    reason = f"{called(named)}; z has a median of {vertical:.3g} in flight: {weight}, in {unit}"
    if named.unit not in (None, unit):
        seen.disagree(named, unit)
    if body is None or body == up:
        seen.take(named, unit, reason, "data", scale=scale)
    else:
        reason += f", and points the wrong way for {body}, so gravity is logged, not the force that carries it"
        others = (
            Rival("sign: [1, -1, -1]", "if its y and z are opposite to those of all others"),
            Rival("sign: [1, 1, -1]", "if only its z is; a push, or a lean on the ground, along x and y decides"),
        )
        seen.take(named, unit, reason, "guess", scale=scale, sign=(-1.0, -1.0, -1.0), rivals=others)
    words = f"gravity stays in z (median {vertical:.3g}) in flight"
    seen.choose("acceleration_frame", "body-specific-force", words, "data")
    if body is None:
        points = "up" if up == "FLU" else "down"
        words = f"the accelerometer reads {vertical:.3g} along z, so z points {points}"
        # Some log gravity itself, which points down.
        why = "if the accelerometer logs gravity, not the force that carries the vehicle, or its z is reversed"
        other = Rival("body_frame: FLU", why)
        seen.choose("body_frame", up, words, *(("data",) if up == "FLU" else ("guess", other)))
