"""Sensors: network streams, sound cards, converters, serial ports, and replayed files."""
