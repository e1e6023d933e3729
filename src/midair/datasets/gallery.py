"""A gallery of touches to start from."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from midair.array_types import Array
from midair.datasets.strokes import SAMPLES, STORED, sample
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
    """Pressure, rms of each 20 ms, shape (picture, row, column), in Pa; the first row is towards the fingers."""
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
    felt: int
    """How many of ten people feel it at its own level, by the model of skin."""
    ears: int
    """Level at an ear above its limit without protection, at this level, in dB."""
    licence: str
    """SPDX identifier."""
    pattern: Mapping[str, Any] | None = None
    """The pattern as the dicts of its file; None for a recording."""

    @property
    def facts(self) -> dict[str, Any]:
        """Facts that lists show."""
        return {"says": self.says, "felt": self.felt, "ears": self.ears, "licence": self.licence}

    @property
    def ending(self) -> str:
        """Ending of the file that `write` makes."""
        return ".h5" if self.pattern is None else ".toml"

    def write(self, path: Path) -> None:
        """Write it as a recording or as a pattern. Raises FileError if the file cannot be written."""
        if self.pattern is None:
            save(sample(self.name), path, force=True)
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
            pitch, simulated = palm.pitch, True
        every = round(rate / PICTURES)
        whole = pressure[: len(pressure) // every * every].reshape(-1, every, *pressure.shape[1:])
        place = np.unravel_index(int(pressure.var(axis=0).argmax()), pressure.shape[1:])
        heard = Channels(values=pressure[:, place[0], place[1], None], unit="Pa", label=self.name)
        sound = channel_sound(heard, 0, rate, sound_rate=8000.0).data
        pictures = np.sqrt((whole**2).mean(axis=1))[:, ::-1]  # upwards is towards the fingers
        return TouchView(title=self.name, simulated=simulated, pictures=pictures, pitch=pitch, sound=sound)


TOUCHES: Mapping[str, Touch] = {
    name: Touch(name=name, licence=SAMPLES[name].licence, **about)
    if name in SAMPLES
    else Touch(name=name, licence="MIT", pattern=PALETTE[name], **about)
    for name, about in STORED["touch"].items()
}
"""Touches by name, in the order in which they are shown."""
