"""Smooth paths in space, the attitude that they require of a multirotor, and attitude paths of full rotations."""
