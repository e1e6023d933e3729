"""Highest sound level anywhere in a cube around an ear, for every frame of a drive."""

from midair.physics.exposure_search.exposure_airs import airs_of_room
from midair.physics.exposure_search.exposure_drive import drive_parts
from midair.physics.exposure_search.exposure_products import Workspace
from midair.physics.exposure_search.exposure_search import Searches, ceiling, point_search, searched_points, searches_of

__all__ = [
    "Searches",
    "Workspace",
    "airs_of_room",
    "ceiling",
    "drive_parts",
    "point_search",
    "searched_points",
    "searches_of",
]
