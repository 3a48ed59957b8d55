"""Import of flight logs: columns become signals on one clock, aligned, filtered and differentiated."""

from cpfls_cli.flightlog.alignment import align_commands, estimate_delay
from cpfls_cli.flightlog.importing import derive_flight, import_log, read_signals
from cpfls_cli.flightlog.results import DelayEstimate, ImportedFlight, ImportReport, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap, SignalName

__all__ = [
    "DelayEstimate",
    "ImportReport",
    "ImportSettings",
    "ImportedFlight",
    "LogSignals",
    "SignalMap",
    "SignalName",
    "align_commands",
    "derive_flight",
    "estimate_delay",
    "import_log",
    "read_signals",
]
