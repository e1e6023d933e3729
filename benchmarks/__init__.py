"""Solvers side by side on the same targets, in one run: `python -m benchmarks`."""
