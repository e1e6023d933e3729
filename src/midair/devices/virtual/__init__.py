"""The virtual rig: an array, a sensor and the place where they meet, drivers like any other."""
