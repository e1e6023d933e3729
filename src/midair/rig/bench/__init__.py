"""Measure calibrations of sensors and arrays, and identify which channel belongs to which cell."""
