"""Recordings: edit them, spread one channel over a patch of contact, judge their channels."""
