"""Gains of autopilots with margins that are asked for, over all vehicles that flights leave possible."""
