"""Files of flight logs: a table of their formats, and one reader for each."""

from cpfls_cli.logs.formats import LOG_FORMATS, LogColumns, LogContents, LogFormat, is_log, log_contents, read_log

__all__ = [
    "LOG_FORMATS",
    "LogColumns",
    "LogContents",
    "LogFormat",
    "is_log",
    "log_contents",
    "read_log",
]
