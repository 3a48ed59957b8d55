"""Checks of the sensors of a flight against each other, without any torque."""
