"""Files of flight logs: a table of their formats, and one reader for each."""
