"""The studio: what the command line does, to be seen and touched in the browser. Needs the extra `studio`."""

from midair.studio.application import Studio, StudioPlan
from midair.studio.server import open_studio

__all__ = ["Studio", "StudioPlan", "open_studio"]
