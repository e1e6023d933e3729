"""The studio: a web application that records, solves, plays and compares takes (extra `studio`)."""

from midair.studio.application import Studio, StudioPlan
from midair.studio.server import open_studio

__all__ = ["Studio", "StudioPlan", "open_studio"]
