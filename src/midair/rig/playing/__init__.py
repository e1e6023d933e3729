"""Play: admitted drives, logged, stopped on demand, and re-recorded."""
