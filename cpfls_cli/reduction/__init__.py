"""Reduction of a training set to the samples worth learning from."""
