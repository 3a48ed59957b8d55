"""One module per command: read artifacts, call the numerics, write an artifact."""
