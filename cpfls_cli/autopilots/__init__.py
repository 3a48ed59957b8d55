"""Control laws of autopilots that people fly, written out from their documentation."""
