"""Flights in weak form: averages over smooth windows, and blocks of windows that are left out in turn."""
