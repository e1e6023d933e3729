"""The bench: measure a calibration, and find out which channel is which cell."""
