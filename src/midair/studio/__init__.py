"""The studio: a web application that records, solves, plays and compares takes (extra `studio`)."""

from .application import Studio as Studio
from .application import StudioPlan as StudioPlan
from .panels import Panel as Panel
from .panels import PanelContext as PanelContext
from .server import open_studio as open_studio
