"""The result of `compare`: where a model and flights disagree, with the flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.gap.compare import Comparison
from cpfls_cli.gap.recorded import GIVEN, RecordedFlight, names_of, recorded
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import Recording


@result
class Disagreement(Comparison):
    """Where a model and flights disagree, with the flights."""

    FORMAT: ClassVar = "cpfls/disagreement"
    SHOWN: ClassVar = ("flights", "gap", "stretches")

    warnings: tuple[str, ...] = about("what to know about the flights", "flight_note")
    base: VehicleModel = part(brief=False)
    recorded: Mapping[str, RecordedFlight] = part(brief=False)
    learned: tuple[LearnedFlight, ...] = part((), brief=False)
    """Flights that its base learned from."""

    @classmethod
    def of(
        cls, found: Comparison, recordings: Sequence[Recording], warnings: tuple[str, ...], base: VehicleModel
    ) -> Disagreement:
        """Put a comparison together with the model and the flights."""
        return cls(
            **vars(found),
            warnings=(*found.audit.filtered, *warnings),
            base=base,
            recorded=recorded(recordings, [GIVEN] * len(recordings)),
        )

    @property
    def flights(self) -> list[str]:
        """Names of the flights."""
        return names_of(self.recorded)

    @property
    def stretches(self) -> list[dict[str, Any]]:
        """Stretches of time with the largest gap, for machines."""
        return [each._asdict() | {"flight": self.flights[each.flight]} for each in self.worst]

    def is_base(self, stated: VehicleSettings) -> bool:
        """Tell whether it was made with the vehicle of a config and no effects, which `cpfls diagnose` starts from."""
        # Guesses of the config, once they stand in a model, are numbers like others.
        own, wanted = ({**vars(each), "unknown": ()} for each in (self.base.vehicle, stated))
        return self.base.is_rigid_body and own == wanted
