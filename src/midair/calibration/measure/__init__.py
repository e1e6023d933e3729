"""Measure a calibration: against a reference, with a tone of known pressure, or by a focused beam."""
