"""Physical effects that a model can miss: a catalogue, one file an effect."""
