"""Rotational dynamics: the rigid body, models in Euler coordinates, and the integration of both."""
