"""An identified model as source code and data that a controller takes."""
