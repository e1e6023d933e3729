"""Live touch: the signal of a sensor is played on an array while it is measured."""
