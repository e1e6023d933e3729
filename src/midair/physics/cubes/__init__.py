"""The loudest sound anywhere in a cube around an ear, for every frame of a drive."""

from midair.physics.cubes.exposure_products import Workspace
from midair.physics.cubes.exposure_search import Searches, cube_search, point_search, searched_points, searches_of

__all__ = ["Searches", "Workspace", "cube_search", "point_search", "searched_points", "searches_of"]
