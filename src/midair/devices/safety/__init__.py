"""Safety: locks, the stop channel, hardware stop, the STOP of pages, leases, signals and the log of playback."""
