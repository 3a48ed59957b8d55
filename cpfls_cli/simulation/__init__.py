"""Simulation: the exact vehicle along a planned motion, or a closed loop with effects that its model lacks."""
