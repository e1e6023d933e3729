"""Play cleared drives with a log entry, stop them on request, and re-record them."""
