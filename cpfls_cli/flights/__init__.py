"""Flights from artifacts and logs: opened, split, of the same vehicle."""
