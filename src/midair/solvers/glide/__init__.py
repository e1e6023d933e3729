"""Whole recordings by bisection in time: few frames cold, all others from both neighbours."""

from midair.solvers.glide.cutting import Piece, pieces
from midair.solvers.glide.glide import Glide

__all__ = ["Glide", "Piece", "pieces"]
