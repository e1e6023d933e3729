"""Effects of other makers, AHAP and MPEG haptics: recordings written as such, and such rendered to waves."""

from midair.files.effects.ahap_file import write_ahap
from midair.files.effects.ahap_rendering import read_ahap
from midair.files.effects.hjif_file import write_hjif
from midair.files.effects.hjif_rendering import read_hjif

__all__ = ["read_ahap", "read_hjif", "write_ahap", "write_hjif"]
