"""Check the installation and the devices, with advice for each problem."""
