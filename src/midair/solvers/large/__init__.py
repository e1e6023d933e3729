"""Tilted planes, and an estimate of the memory that a problem needs."""

from .memory_need import check_memory as check_memory
from .memory_need import memory_needed as memory_needed
from .planes import multi_plane_problem as multi_plane_problem
from .planes import place_grid as place_grid
