"""Vehicle models of simulators: what their own files state, where it stands there, and the same file corrected."""
