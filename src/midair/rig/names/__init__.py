"""Make devices from the names that users type, their calibrations, and the virtual rig."""
