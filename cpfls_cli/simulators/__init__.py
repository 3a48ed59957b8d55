"""Vehicle models of simulators: what their own files state, where it is there, and the same file corrected."""
