"""Statistics of choices, ratings and thresholds as pure functions of arrays and tables."""
