"""midair's own file formats: HDF5 with a documented schema."""
