"""Whether a log is right: the channels of a flight held against each other and against its vehicle."""
