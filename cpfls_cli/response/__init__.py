"""Frequency responses of a vehicle, measured in flights and of a model, and how far they are apart."""
