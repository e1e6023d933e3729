"""Filters and spectra."""
