"""The regressor Q(q, qd, qdd) of a model structure: torque is linear in the coefficients of the inertia functions."""
