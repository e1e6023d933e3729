"""The commands around a sweep."""
