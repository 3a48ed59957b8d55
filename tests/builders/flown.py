"""Flights that nobody flew, as results."""

from cpfls_cli.flights.flight import Imported, Simulated


def simulated(**given):
    """Make a simulated flight of its signals."""
    return Simulated(**({"noise_std": {}, "infeasible": (), "effects": {}} | given))


def imported(**given):
    """Make a flight of a log that nothing is said of."""
    time = given["time"]
    counts = {key: {} for key in ("dropped", "missing", "spikes", "suspected_spikes", "saturated")}
    rate = 1 / (time[1] - time[0])
    said = {
        "samples_read": len(time),
        "samples": len(time),
        "gaps": 0,
        "longest_gap_s": 1 / rate,
        "span_s": (0.0, float(time[-1])),
        "first_stamp_s": 0.0,
        "crop_s": None,
        "log_rate_hz": rate,
        "rate_hz": rate,
        "cut_off_hz": {},
        "updated_hz": {},
        "parameters": {},
        "stated": {},
    }
    return Imported(**(counts | said | given))
