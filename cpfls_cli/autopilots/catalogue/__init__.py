"""One autopilot each: what is fixed in its law, and its parameters."""
