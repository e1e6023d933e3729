"""Open: from the names that people type to devices, and the virtual rig."""
