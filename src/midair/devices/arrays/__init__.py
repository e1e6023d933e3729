"""Phased arrays: AUTD3 through both of its SDKs, and the transmission of frames."""
