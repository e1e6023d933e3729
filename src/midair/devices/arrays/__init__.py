"""Phased arrays: AUTD3 by both of its SDKs, how frames reach them, and the gate before any sound."""
