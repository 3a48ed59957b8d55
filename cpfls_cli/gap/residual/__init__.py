"""Analysis of a residual by signals, frequencies and time."""
