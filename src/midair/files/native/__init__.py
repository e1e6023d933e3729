"""midair's own files: HDF5 by one table of names, and NetCDF."""
