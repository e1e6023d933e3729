"""Highest sound level anywhere in a cube around an ear, for every frame of a drive."""

from .exposure_products import Workspace as Workspace
from .exposure_products import drive_parts as drive_parts
from .exposure_search import Searches as Searches
from .exposure_search import airs_of_room as airs_of_room
from .exposure_search import ceiling as ceiling
from .exposure_search import point_search as point_search
from .exposure_search import searched_points as searched_points
from .exposure_search import searches_of as searches_of
