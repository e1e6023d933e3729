"""Default values that several stages share: those of the paper's set-up."""

HEIGHT = 0.2
"""Height of the palm or the sensor above the array, in m."""

HEIGHTS = (20e-3, 1.0)
"""Allowed heights, in m."""

BAND = (20.0, 470.0)
"""(low, high) of the frequency band that is reproduced, in Hz."""

RATE = 1000.0
"""Frame rate of sensors and drives in Hz."""
