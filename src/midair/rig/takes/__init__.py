"""Record: takes of a sensor, watched while they run."""
