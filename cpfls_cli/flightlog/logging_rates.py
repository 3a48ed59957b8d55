"""How to make an autopilot log faster: its own parameters and their values, as far as its version has them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

from cpfls_cli.flightlog.layouts import Parameters
from cpfls_cli.words import joined

FAST_HZ = 100.0  # At which motors are to be logged, which respond within some 50 ms.
# Below which they are logged too slowly for what they drive to be told from what drives them: two samples in the 50 ms
# within which they follow, and a half.
SLOW_HZ = 25.0
_DEVICE = "and blackbox_device = SDCARD or SPIFLASH"
# By the beginning of what a log names as its writer: from which version on what is to be set, the newest first.
_SETTINGS: Final[Mapping[str, tuple[tuple[tuple[int, int], str], ...]]] = {
    "PX4": (((0, 0), "SDLOG_PROFILE = 17 (bits 0 and 4: default and high rate), then restart"),),
    "Betaflight": (
        ((4, 3), f"blackbox_sample_rate = 1/4 {_DEVICE}"),
        ((3, 2), f"blackbox_p_ratio = 32 {_DEVICE}"),
        ((0, 0), f"blackbox_rate_num = 1, blackbox_rate_denom = 4 {_DEVICE}"),
    ),
    "INAV": (((0, 0), "blackbox_rate_num = 1 and blackbox_rate_denom = 4"),),
    "ArduPlane": (((0, 0), "LOG_BITMASK with bit 0 (fast attitude)"),),
    "Crazyflie": (((0, 0), "period_in_ms = 10 of the LogConfig, or a frequency of 100 or more on the card"),),
}
_COPTER = ("ArduCopter", "ArduPilot")
_FAST_IMU, _WITH_FAST_IMU = 18, (3, 3)
_WITH_DSHOT = (4, 0)
# Of LOG_BITMASK of ArduCopter; the last is newer than others.
_BITS: Final[Mapping[int, str]] = {0: "fast attitude", 10: "outputs", _FAST_IMU: "fast IMU, from 3.3 on"}
_USUAL_BITS = 176126  # LOG_BITMASK of ArduCopter 4 by default.
_NONE: Final[Parameters] = MappingProxyType({})


def log_faster(what: str, least_hz: float, *systems: str, parameters: Parameters = _NONE) -> str:
    """Ask for faster logs, and say what to set in the autopilots that wrote them, where the logs name them.

    Parameters
    ----------
    what : str
        What is logged too slowly.
    least_hz : float, Hz
    *systems : str
        What the logs name as their writers, with versions.
    parameters : mapping
        Of the autopilot.
    """
    asked = f"log {what} at {least_hz:g} Hz or more"
    known = dict.fromkeys(cure for system in systems for cure in _cures(system))
    said = [f"{asked} ({joined(known)})"] if known else []
    ours = (system for system in systems if system.startswith(_COPTER))
    said += dict.fromkeys(_of_copter(system, parameters) for system in ours)
    return "; ".join(said) or asked


def _cures(system: str) -> Iterator[str]:
    version = _version(system)
    for begin, cures in _SETTINGS.items():
        if system.startswith(begin):
            yield f"{begin}: {next(cure for since, cure in cures if version is None or version >= since)}"


def _version(system: str) -> tuple[int, int] | None:
    """Read the version that a log names, None where it names none."""
    found = re.search(r" v?(\d+)\.(\d+)", system)
    return None if found is None else (int(found[1]), int(found[2]))


def _of_copter(system: str, parameters: Parameters) -> str:
    """Say what ArduPilot's copters can log: outputs are slow, whatever is set; what came later is asked of no other."""
    version, has = _version(system), parameters.get("LOG_BITMASK")
    new = version is not None and version >= _WITH_DSHOT
    bits = [bit for bit in _BITS if bit != _FAST_IMU or version is None or version >= _WITH_FAST_IMU]
    if has is None and new:
        has = _USUAL_BITS
    if isinstance(has, int | float) and has >= 0:
        own = int(has)
        named = f"= {own | sum(1 << bit for bit in bits)}, which is {own} with"
    else:
        named = "with"
    names = joined(f"{bit} ({_BITS[bit]})" for bit in bits)
    return (
        f"log motor speeds with bidirectional DShot ({'' if new else 'ArduPilot 4: '}SERVO_BLH_BDMASK), for {system} "
        f"logs outputs (RCOU) 10 times a second at most; body rates, and RATE from which outputs are rebuilt, come"
        f" faster with "
        f"{'LOG_FILE_RATEMAX = 0 and ' if new else ''}LOG_BITMASK {named} bits {names}"
    )
