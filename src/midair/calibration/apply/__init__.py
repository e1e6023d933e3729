"""Apply a calibration: whole recordings, or block by block while they are made."""
