"""A model as source code and data that a controller or a simulator takes."""
