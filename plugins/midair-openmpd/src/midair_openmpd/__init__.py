"""Arrays of OpenMPD boards for midair: ``midair play x.drive.h5 --device openmpd:PORT?board=FILE``."""

from .boards import Board as Board
from .boards import array_of_boards as array_of_boards
from .boards import load_board as load_board
from .driver import OpenMpdArray as OpenMpdArray
from .driver import open_openmpd as open_openmpd
