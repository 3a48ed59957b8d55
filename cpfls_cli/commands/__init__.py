"""One module per command: open records, call the numerics, write a record, hand over its page."""
