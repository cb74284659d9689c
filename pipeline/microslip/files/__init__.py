"""Files that are complete or absent, locked and hashed; of unknown origin; HDF5 with the same bytes at every run."""
