"""Sensors: live ones over a network, a sound card, a converter or a serial line, and replayed files."""
