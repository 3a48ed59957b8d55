"""How to make an autopilot log faster: its own parameters and their values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from cpfls_cli.words import joined

_SETTINGS: Final[Mapping[str, tuple[str, str]]] = {
    "PX4": ("PX4", "SDLOG_PROFILE = 17 (bits 0 and 4: default and high rate), then restart"),
    "Ardu": (
        "ArduPilot",
        "LOG_BITMASK = 438271 (its default with bits 0 and 18, fast attitude and IMU) and LOG_FILE_RATEMAX = 0; RCOU "
        "comes 10 times a second even so, and motor speeds faster from bidirectional DShot (SERVO_BLH_BDMASK)",
    ),
    "Betaflight": ("Betaflight", "blackbox_sample_rate = 1/4 and blackbox_device = SDCARD or SPIFLASH"),
    "INAV": ("INAV", "blackbox_rate_num = 1 and blackbox_rate_denom = 4"),
    "Crazyflie": ("Crazyflie", "period_in_ms = 10 of the LogConfig, or a frequency of 100 or more on the card"),
}
"""By the beginning of what a log names as its writer: the autopilot, and what to set."""


def log_faster(*systems: str) -> str:
    """Say what to set in the autopilots that wrote logs, in all that are known where the logs do not say."""
    own = {begin for begin in _SETTINGS for system in systems if system.startswith(begin)}
    return joined(f"{title}: {what}" for begin, (title, what) in _SETTINGS.items() if begin in (own or _SETTINGS))
