"""The effects, one module each with its `EFFECT`; a module that is here is in the catalogue."""
