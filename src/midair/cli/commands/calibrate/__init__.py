"""The commands around a calibration."""
