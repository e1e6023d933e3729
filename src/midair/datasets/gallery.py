"""A gallery of touches to start from, and larger public sets of recordings with what their owners permit."""

import hashlib
import urllib.error
import urllib.request
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from midair.array_types import Array
from midair.datasets.strokes import SAMPLES, STORED, sample
from midair.errors import BrokenFileError, FileError, InputError
from midair.files import atomic_file, save, write_file
from midair.model import Acoustics, Palm, TransducerArray
from midair.patterns import PALETTE, Pattern, palm_pressure
from midair.view import Channels, Film, Tile, ViewData, channel_sound, colour_table, write_gif

PICTURES = 50
"""Pictures of a film for each second of a touch; each is the rms of 20 ms."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchView:
    """A touch as pictures and sound."""

    title: str
    simulated: bool
    """Whether it is a model; a pattern is shown as ideal foci."""
    pictures: Array
    """Pressure, rms of each 20 ms, shape (picture, row, column), in Pa; the first row is at the top."""
    pitch: float
    """Distance of the points in m."""
    sound: bytes
    """WAV file of the place that vibrates most."""

    def write(self, folder: Path) -> None:
        """Write ``TITLE.png`` (rms), ``TITLE.gif`` (a film in real time) and ``TITLE.wav`` into a folder."""
        from PIL import Image

        side, top = 192, float(self.pictures.max())
        rms = np.sqrt((self.pictures**2).mean(axis=0))
        colours = colour_table("inferno")[np.rint(255 * rms / max(float(rms.max()), 1e-12)).astype(int)]
        picture = Image.fromarray(colours).resize((side, side), Image.Resampling.NEAREST)
        facts = ViewData(title=self.title, rate=PICTURES, frames=len(self.pictures), simulated=self.simulated)
        width = self.pitch * self.pictures.shape[1]
        tile = Tile(title=self.title, values=self.pictures.__getitem__, top=top, unit="Pa", width=width)
        with atomic_file(folder / f"{self.title}.png") as file:
            picture.save(file, format="PNG")
        with atomic_file(folder / f"{self.title}.gif") as file:
            write_gif(Film(facts, side=side, groups=[[tile]]), file)
        write_file(folder / f"{self.title}.wav", self.sound)


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """A touch of the gallery: a recording, or a pattern of `midair draw`."""

    name: str
    says: str
    """Description in one or two sentences."""
    licence: str
    """SPDX identifier."""
    pattern: Mapping[str, Any] | None = None
    """The pattern as the dicts of its file; None for a recording."""

    @property
    def ending(self) -> str:
        """Ending of the file that `write` makes."""
        return ".h5" if self.pattern is None else ".toml"

    def write(self, path: Path) -> None:
        """Write it as a recording or as a pattern. Raises FileError if the file cannot be written."""
        if self.pattern is None:
            save(sample(self.name), path)
            return
        write_file(path, tomli_w.dumps(self.pattern))

    def view(self) -> TouchView:
        """Pictures and sound: pressure on the cells of a recording, or of ideal foci of a pattern on a palm."""
        if self.pattern is None:
            recording = sample(self.name)
            pressure, rate, pitch = np.asarray(recording.samples), recording.rate, recording.sensor.pitch
            simulated = recording.provenance.simulated
        else:
            foci, palm = Pattern.from_plain(self.pattern).foci(), Palm.disc()
            pressure, rate = palm_pressure(foci, TransducerArray.autd3(), palm, acoustics=Acoustics())
            pressure, pitch, simulated = pressure[:, ::-1], palm.pitch, True  # upwards is towards the fingers
        every = round(rate / PICTURES)
        whole = pressure[: len(pressure) // every * every].reshape(-1, every, *pressure.shape[1:])
        place = np.unravel_index(int(pressure.var(axis=0).argmax()), pressure.shape[1:])
        heard = Channels(values=pressure[:, place[0], place[1], None], unit="Pa", label=self.name)
        sound = channel_sound(heard, 0, rate, sound_rate=8000.0).data
        pictures = np.sqrt((whole**2).mean(axis=1))
        return TouchView(title=self.name, simulated=simulated, pictures=pictures, pitch=pitch, sound=sound)


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicSet:
    """Recordings that others publish; midair contains none of them."""

    title: str
    holds: str
    licence: str
    """Licence of the data, and how far it is known."""
    reader: str
    """Command that reads one of its files."""
    doi: str = ""
    size_mb: int = 0
    """Size of the download in MB; 0 if its owners do not state it."""
    archive: str = ""
    """Address of a ZIP file; empty if the licence was not read, so that it is not fetched."""
    licence_sha256: str = field(default="", repr=False)
    """SHA-256 of the file LICENSE in it."""

    @property
    def size(self) -> str:
        """Size with its unit, for people."""
        return f"{self.size_mb} MB" if self.size_mb else "not stated"

    def fetch(self, target: Path) -> None:
        """Write the archive to a file, after its licence was compared with the one that was read.

        Raises InputError if it is not to be fetched; BrokenFileError if the archive is too large, damaged, or has
        another licence; FileError if there is no answer.
        """
        if not self.archive:
            raise InputError(f"{self.title}: expected a licence that was read, got: {self.licence}; see {self.place}")
        most = 2 * self.size_mb * 1_000_000
        with atomic_file(target) as partial:
            try:
                with urllib.request.urlopen(self.archive, timeout=30) as answer, partial.open("wb") as file:
                    while (block := answer.read(1 << 16)) and file.tell() <= most:
                        file.write(block)
            except (urllib.error.URLError, OSError) as wrong:
                raise FileError(f"{self.archive}: expected an archive, got: {wrong}; try again later") from wrong
            if partial.stat().st_size > most:
                raise BrokenFileError(f"{self.archive}: expected about {self.size}, got more; it was not kept")
            try:
                with zipfile.ZipFile(partial) as archive:
                    name = next(one for one in archive.namelist() if one.count("/") == 1 and one.endswith("/LICENSE"))
                    found = hashlib.sha256(archive.read(name)).hexdigest()
            except (zipfile.BadZipFile, StopIteration) as wrong:
                raise BrokenFileError(f"{self.archive}: expected a ZIP file with a LICENSE, got none") from wrong
            if found != self.licence_sha256:
                raise BrokenFileError(
                    f"{self.archive}: expected the licence that was read, got another; it was not kept"
                )

    @property
    def place(self) -> str:
        """Address of the publication."""
        return f"https://doi.org/{self.doi}" if self.doi else self.archive.partition("/zip/")[0]


TOUCHES: Mapping[str, Touch] = {
    name: Touch(name=name, says=says, licence=SAMPLES[name].licence)
    if name in SAMPLES
    else Touch(name=name, says=says, licence="MIT", pattern=PALETTE[name])
    for name, says in STORED["touch"].items()
}
"""Touches by name, in the order in which they are shown."""

PUBLIC_SETS: Mapping[str, PublicSet] = {name: PublicSet(**about) for name, about in STORED["set"].items()}
"""Public sets by name."""
