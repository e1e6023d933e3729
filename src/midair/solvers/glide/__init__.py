"""Solve whole recordings by bisection in time."""

from .blocks import Piece as Piece
from .blocks import frames_in_block as frames_in_block
from .blocks import pieces as pieces
from .glide import Glide as Glide
from .glide import evenly_spread as evenly_spread
