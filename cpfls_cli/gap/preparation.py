"""What all flights of a diagnosis share: windows, model, settings and the repair of their sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpfls_cli.consistency.audit import Audit
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import WeakFlight, weak_flight
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.weak_form.windows import Recording, Windows


@dataclass(frozen=True)
class Preparation:
    """Windows, model, settings and sensor repair that all flights of a diagnosis share.

    Attributes
    ----------
    model : InertiaModel or None
        None for the rigid body of the vehicle.
    audit : Audit
        Faults that are repaired.
    """

    windows: Windows
    model: InertiaModel | None
    settings: GapSettings
    audit: Audit

    def logged(self, recordings: Sequence[Recording]) -> list[WeakFlight]:
        """Prepare flights with the faults of their sensors, but with channels that belong together."""
        return [self._weak(recording.name, self.audit.consistent(recording.signals)) for recording in recordings]

    def repaired(self, recordings: Sequence[Recording]) -> list[WeakFlight]:
        """Prepare flights with the named faults of their sensors repaired."""
        return [self._weak(recording.name, self.audit.repaired(recording.signals)) for recording in recordings]

    def _weak(self, name: str, signals: Signals) -> WeakFlight:
        return weak_flight(name, signals, self.windows, self.model, self.settings.force, self.settings.axes)
