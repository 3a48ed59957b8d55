"""Where a residual lives: signals, frequencies, stretches of time."""
