"""Solve whole recordings by bisection in time."""

from .glide import Glide as Glide
from .recording_pieces import Piece as Piece
from .recording_pieces import pieces as pieces
