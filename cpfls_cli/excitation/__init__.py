"""Paths that excite all parameters of a model, by optimal design of the experiment."""
