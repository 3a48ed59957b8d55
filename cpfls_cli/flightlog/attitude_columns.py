"""How the attitude of a log is read, and all axes with it: quaternion or angles, held against all that moves."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.motion_columns import GOOD, NEAR_GRAVITY, nearest, over_ground
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.readings import CLEAR, TakenReading, Witnesses, euler_readings, read_axes, read_quaternion
from cpfls_cli.flightlog.recognised import Rival, Seen, Sure, called
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.flightlog.vocabulary import ANGLES, SENSED
from cpfls_cli.units import UnitName, known_unit

_DEGREES = 180 / np.pi
# Angles in rad beyond which numbers are degrees: somewhat more than a full turn, and than a lean of a quarter turn.
_LARGEST_ANGLE, _LARGEST_TILT = 6.6, 1.7
_NEAR: Final = 0.2  # Part of a turn, rad, that an angle moves between two samples where it jumps by a full turn.
# Body axes of logs whose other axes are these.
BODY_OF: Final = {"FLU": "FLU", "ENU": "FLU", "FRD": "FRD", "NED": "FRD"}
_SIGNALS_OF: Final[Mapping[str, tuple[SignalName, ...]]] = {
    "attitude": ("quaternion", "attitude"),
    "body_rate": ("body_rate",),
    "position": ("position", "velocity"),
}
_DECIDES = "a flight with one known lean, turn or climb, or the documentation of the log, decides"


def read_attitude(seen: Seen) -> TakenReading | None:
    """Read the attitude and all axes with it; None without one."""
    euler = seen.first("attitude")
    for named in seen.candidates.get("quaternion", ()):
        if euler is not None and euler.known and not named.known:
            break
        time, values = seen.log.values(named.group.columns)
        if float(np.median(np.abs(np.linalg.norm(values, axis=1) - 1))) < 0.05:
            grid, named_by_axes = seen.log.grid[seen.part], named.group.kind == "wxyz"
            verdict = read_quaternion(values, named_by_axes, time, grid, _witnesses(seen))
            _tell_quaternion(seen, named, verdict)
            return verdict
    return None if euler is None else _read_euler(seen, euler)


def _lift(seen: Seen) -> Array | None:
    """Give what grows with the thrust: the rotors' level squared, or the size of what an accelerometer senses."""
    if seen.level is not None:
        return np.asarray(seen.level[seen.part] ** 2)
    for named in seen.candidates.get("acceleration", ()):
        size = np.linalg.norm(seen.grid(named), axis=1)
        if any(1 / NEAR_GRAVITY < float(np.median(size)) / level < NEAR_GRAVITY for level, _, _ in SENSED):
            return np.asarray(size)
    return None


def _witnesses(seen: Seen) -> Witnesses:
    gyro, sensed = seen.first("body_rate"), 0.0
    for named in seen.candidates.get("acceleration", ()):
        values = seen.grid(named)
        if abs(float(np.median(values[:, 2]))) > GOOD * float(np.median(np.linalg.norm(values, axis=1))):
            sensed = float(np.sign(np.median(values[:, 2])))
            break
    bodies = {BODY_OF[str(named.frame)] for found in seen.candidates.values() for named in found[:1] if named.frame}
    known = bodies.pop() if len(bodies) == 1 else None
    measured = None if gyro is None else seen.grid(gyro)
    return Witnesses(seen.rate_hz, measured, over_ground(seen), _lift(seen), sensed, known)


def _read_euler(seen: Seen, named: Named) -> TakenReading:
    time, values = seen.log.values(named.group.columns)
    grid = seen.log.grid[seen.part]
    flown = (time >= grid[0]) & (time <= grid[-1])
    unit, reason, sure, rivals = _angle_unit(named, named.scale * values[flown if flown.any() else slice(None)])
    if named.unit not in (None, unit):
        seen.disagree(named, unit)
    for _ in range(2):
        angles = named.scale * known_unit(unit).factor * values
        readings = euler_readings(angles, time, grid)
        verdict = read_axes(readings, _witnesses(seen))
        best = verdict.best
        if best.lean is None:
            break
        _, decided, _ = nearest(best.lean.gain * (1 if unit == "rad" else 1 / _DEGREES), ANGLES)
        if rivals:
            # Gravity and the lean make the acceleration.
            reason, sure, rivals = f"{reason}; in {decided} the lean explains the acceleration", "data", ()
        elif named.unit is None or decided == unit or best.place_share < GOOD:
            break
        else:
            seen.warnings.append(f"{named.group.pattern} is said to be in {unit}; by the lean, it is in {decided}")
            reason, sure = f"{reason}; judged by what the lean explains, in {decided}", "data"
        if decided == unit:
            break
        unit = decided
    told = best.rates is not None and best.rates.as_named > CLEAR
    if told and best.rates is not None:
        flipped = [axis for axis, own in zip(("roll", "pitch", "yaw"), best.attitude.sign, strict=True) if own < 0]
        turned = f" with {' and '.join(flipped)} reversed" if flipped else ""
        share = f"; the derivative explains {100 * best.rates.as_named:.0f} % of the gyroscope{turned}"
        at = reason.find("; in ")
        reason = reason + share if at < 0 else reason[:at] + share + reason[at:]
    if not told and best.lean is None and sure == "data":
        # A range tells the unit, and nothing here the axes.
        sure = "named"
    seen.tell(named, unit, reason, sure, order=best.attitude.order, sign=best.attitude.sign, rivals=rivals)
    return verdict


def _angle_unit(named: Named, values: Array) -> tuple[UnitName, str, Sure, tuple[Rival, ...]]:
    largest = np.quantile(np.abs(values), 0.999, axis=0)
    tilt, turn = float(largest[:2].max()), float(largest[2])
    if named.unit == "rad" and tilt > _LARGEST_ANGLE:
        return "deg", f"{called(named)}, which would be rad, but reaches {tilt:.3g}, so these are degrees", "data", ()
    if named.unit is not None:
        return named.unit, f"{called(named)}, which is in {named.unit}", "named", ()
    jumps = np.abs(np.diff(values, axis=0))
    if largest.max() < _LARGEST_ANGLE and (np.abs(jumps - 2 * np.pi) < _NEAR).any():
        return "rad", f"{called(named)}; jumps by a full turn in rad", "data", ()
    if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE:
        return "deg", f"{called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
    rival = Rival("unit: deg", f"a flight that never leans more than {tilt:.2g} degrees would look the same")
    rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
    return "rad", f"{called(named)}; leans {tilt:.2g} at most", "data" if not rivals else "guess", rivals


def _tell_quaternion(seen: Seen, named: Named, verdict: TakenReading) -> None:
    best, own = verdict.best, verdict.best.attitude
    order = "xyzw" if own.scalar_last else "wxyz"
    told = best.explained > CLEAR
    data = f"its derivative explains {100 * best.explained:.0f} % of the gyroscope"
    turned = " when turned from world-to-body, as logged, to body-to-world" if own.inverse else ""
    reason = f"of length 1; {called(named)}" + (f"; {data}{turned}" if told else "")
    if own.order != (0, 1, 2, 3):
        held = ", ".join(named.group.columns[index] for index in own.order)
        reason += f"; judged by their values, {held} are w, x, y, z"
    seen.tell(named, "1", reason, "data" if told else "named", order=own.order, sign=own.sign)
    others = [other for other in verdict.others if other.attitude.scalar_last != own.scalar_last]
    if named.group.kind == "wxyz":
        seen.choose("quaternion_order", order, "the columns are named by w, x, y, z", "named")
        return
    if not others:
        seen.choose("quaternion_order", order, "in the other order, the vehicle would not stay level", "data")
        return
    share = max(other.explained for other in others)
    lean = max(other.place_share for other in others)
    if told and share < best.explained - 0.05:
        seen.choose("quaternion_order", order, f"{data}; in the other order, {100 * share:.0f} %", "data")
    elif best.lean is not None and lean < best.place_share - 0.2:
        share_of_lean = f"({100 * best.place_share:.0f} %)"
        words = f"only in this order does the lean explain the acceleration {share_of_lean}"
        seen.choose("quaternion_order", order, words, "data")
    elif named.known:
        seen.choose("quaternion_order", order, f"a log of {named.known}", "named")
    elif not verdict.tied and min(other.price for other in others) > best.price:
        words = "in the other order, more columns would have to differ from their names"
        seen.choose("quaternion_order", order, words, "data")
    else:
        rival = "xyzw" if order == "wxyz" else "wxyz"
        why = "the vehicle stays level in both, and no gyroscope tells them apart"
        seen.choose("quaternion_order", order, "the more usual one", "guess", Rival(f"quaternion_order: {rival}", why))


def doubt_reading(seen: Seen, verdict: TakenReading) -> None:
    """Say which columns are not what they are named, and make guesses of what other readings take otherwise."""
    best = verdict.best
    if best.attitude.order not in ((0, 1, 2), (0, 1, 2, 3)):
        signal: SignalName = "quaternion" if "quaternion" in seen.guesses else "attitude"
        words = "w, x, y, z" if signal == "quaternion" else "roll, pitch, yaw"
        held = ", ".join(seen.guesses[signal].columns.columns)
        agrees = "this way the log agrees with itself; as named it does not"
        seen.warnings.append(f"{held} are taken for {words}: {agrees}")
    doubted: set[str] = set()
    for other in verdict.tied:
        for name, (order, sign) in other.maps.items():
            if (order, sign) == best.maps[name] or name in doubted:
                continue
            doubted.add(name)
            for signal in _SIGNALS_OF[name]:
                if signal in seen.guesses:
                    columns = [seen.candidates[signal][0].group.columns[index] for index in order]
                    signs = f", sign: {[int(own) for own in sign]}" if min(sign) < 0 else ""
                    text = f"columns: [{', '.join(columns)}]{signs}"
                    seen.doubt(signal, Rival(text, f"the log agrees as well with other columns turned; {_DECIDES}"))
        if other.body != best.body and "body_frame" not in doubted:
            doubted.add("body_frame")
            for key, readings in (("body_frame", (other.body, best.body)), ("world_frame", (other.world, best.world))):
                choice, reason = seen.choices[key], f"the log agrees as well; {_DECIDES}"
                # The accelerometer may have chosen the other reading, and then this one is the rival.
                rivals = [Rival(f"{key}: {value}", reason) for value in readings if value != choice.value][:1]
                known = [rival.text for rival in choice.rivals]
                rivals = [*choice.rivals, *(rival for rival in rivals if rival.text not in known)]
                seen.choose(key, choice.value, choice.reason, "guess" if rivals else choice.sure, *rivals)
