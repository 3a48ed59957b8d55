"""Files of flight logs: a table of their formats, and one reader for each."""

from cpfls_cli.logs.formats import LOG_FORMATS, LogColumns, LogFormat, is_log, read_log

__all__ = [
    "LOG_FORMATS",
    "LogColumns",
    "LogFormat",
    "is_log",
    "read_log",
]
