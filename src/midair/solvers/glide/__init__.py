"""Solve whole recordings by bisection in time."""

from midair.solvers.glide.glide import Glide
from midair.solvers.glide.recording_pieces import Piece, pieces

__all__ = ["Glide", "Piece", "pieces"]
