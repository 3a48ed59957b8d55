"""Artifacts: the HDF5 files between the stages, one record a format, and how they are read, written and checked."""
