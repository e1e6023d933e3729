"""Record takes of a sensor, with meters and triggers while they run."""
