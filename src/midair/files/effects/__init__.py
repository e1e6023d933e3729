"""Effects of other makers (AHAP, .haptic): recordings written as effects, effects rendered to waves."""

from midair.files.opened_take import Format

from .ahap_file import read_ahap, read_haptic, write_ahap, write_haptic

HAPTIC = Format(name=".haptic", read=read_haptic, write=write_haptic, memory=4, effect=True)
AHAP = Format(name="AHAP", read=read_ahap, write=write_ahap, memory=4, effect=True)
