"""Attitude control by a model of the vehicle, and how well a motion is tracked with it."""
