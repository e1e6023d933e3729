"""Measure a calibration against a reference or with a focused beam, and the scale of a microphone."""
