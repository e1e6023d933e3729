"""Effects of other makers, AHAP and MPEG haptics: recordings written as effects, and effects rendered to waves."""

from midair.files.effects.ahap_file import write_ahap
from midair.files.effects.ahap_rendering import read_ahap
from midair.files.effects.hjif_file import write_hjif
from midair.files.effects.hjif_rendering import read_hjif
from midair.files.opened_take import Format

__all__ = ["AHAP", "HJIF"]

HJIF = Format(name="MPEG haptics", read=read_hjif, write=write_hjif, memory=4, effect=True)
AHAP = Format(name="AHAP", read=read_ahap, write=write_ahap, memory=4, effect=True)
