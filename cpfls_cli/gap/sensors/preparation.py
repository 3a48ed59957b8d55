"""How recordings become flights to be balanced: windows, model, settings and the repair of their sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.recording import Recording
from cpfls_cli.gap.balance.weak_flight import WeakFlight, weak_flight
from cpfls_cli.gap.balance.windows import Windows
from cpfls_cli.gap.sensors.audit import Audit
from cpfls_cli.gap.settings import GapSettings


@dataclass(frozen=True)
class Preparation:
    """What all flights of one diagnosis share.

    Attributes
    ----------
    windows : Windows
    model : InertiaModel or None
        None for the rigid body of the vehicle.
    settings : GapSettings
    audit : Audit
        Faults that are repaired.
    """

    windows: Windows
    model: InertiaModel | None
    settings: GapSettings
    audit: Audit

    def logged(self, recordings: Sequence[Recording]) -> list[WeakFlight]:
        """Prepare flights as they were logged."""
        return [self._weak(recording.name, recording.signals) for recording in recordings]

    def repaired(self, recordings: Sequence[Recording]) -> list[WeakFlight]:
        """Prepare flights with the named faults of their sensors repaired."""
        return [self._weak(recording.name, self.audit.repaired(recording.signals)) for recording in recordings]

    def _weak(self, name: str, signals: Signals) -> WeakFlight:
        return weak_flight(name, signals, self.windows, self.model, self.settings.force, self.settings.axes)
