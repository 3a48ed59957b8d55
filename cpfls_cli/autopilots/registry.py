"""The autopilots whose control laws are known."""

from __future__ import annotations

from typing import Literal

from cpfls_cli.autopilots.catalogue.ardupilot import ARDUPILOT
from cpfls_cli.autopilots.catalogue.betaflight import BETAFLIGHT
from cpfls_cli.autopilots.catalogue.crazyflie import CRAZYFLIE
from cpfls_cli.autopilots.catalogue.px4 import PX4
from cpfls_cli.autopilots.parameters import Autopilot

AutopilotName = Literal["px4", "ardupilot", "betaflight", "crazyflie"]
AUTOPILOTS: dict[str, Autopilot] = {each.name: each for each in (PX4, ARDUPILOT, BETAFLIGHT, CRAZYFLIE)}
