"""Signals over time."""
