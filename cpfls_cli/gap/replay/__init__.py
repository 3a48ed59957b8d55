"""Flights simulated again from their own actuation."""
