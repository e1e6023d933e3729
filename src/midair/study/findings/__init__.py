"""Findings: the analysis of a study in plain words."""
