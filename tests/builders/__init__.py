"""What tests of several packages build: flights, models, artifacts, programs and workers. No tests."""
