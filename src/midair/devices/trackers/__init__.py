"""Trackers of the palm: the interface, its checks, prediction, and replayed poses."""
