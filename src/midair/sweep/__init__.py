"""Sweeps: many patterns or recordings on many processes, and what came out."""
