"""The virtual rig: a simulated array, a simulated sensor and the simulated skin between them."""
