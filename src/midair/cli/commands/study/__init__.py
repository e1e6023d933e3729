"""The commands around a study."""
