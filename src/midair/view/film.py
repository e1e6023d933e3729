"""A slow-motion film of a take: one picture per frame, with scale, units, time, and a mark if simulated."""

import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, MissingExtraError
from midair.model import SensorGrid
from midair.validation import frozen_array
from midair.view.frame_encoding import colour_table
from midair.view.view_data import Channels, Sound, ViewData

if TYPE_CHECKING:
    from PIL import Image

Report = Callable[[int, int], None]

PICTURES_A_SECOND = 50
"""Highest picture rate that every GIF viewer supports; frames at 1 kHz play 20 times slower."""

MOST_OF_A_GIF = 2000
"""Limit of pictures in a GIF, which viewers keep in memory."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tile:
    """A map that changes from frame to frame."""

    title: str
    values: Callable[[int], Array]
    """Takes a frame number and returns an array (row, column); NaN where there is no value."""
    top: float
    """Value of the last colour."""
    unit: str
    width: float
    """Length of the map's longer side in m."""
    share: float = 1.0
    """Share of the map's side that the values cover, around its middle."""
    low: float = 0.0
    """Value of the first colour."""
    square: tuple[float, float] | None = None
    """Half the sides (x, y) of a rectangle to draw around the middle, in m."""


class Film:
    """The pictures of a film, computed one after another: sound fields and cells of the sensor.

    `side` is that of each map in pixels, `table` a name for `colour_table`; `groups` are maps that share a scale, in
    place of those of `showing`.
    """

    def __init__(
        self,
        showing: ViewData,
        *,
        side: int = 256,
        groups: Sequence[Sequence[Tile]] | None = None,
        table: str = "inferno",
    ) -> None:
        self._showing, self._side = showing, side
        self._groups = list(groups or _groups(showing))
        self.table = colour_table(table)
        if not self._groups:
            raise InputError("film: expected frames of a sensor or of sound, got neither")

    def __len__(self) -> int:
        return self._showing.frames

    @property
    def slower(self) -> float:
        """Ratio of playing time to real time."""
        return self._showing.rate / PICTURES_A_SECOND

    @property
    def seconds(self) -> float:
        """Duration of the film in s."""
        return len(self) / PICTURES_A_SECOND

    def __iter__(self) -> "Iterator[Image.Image]":
        return (self.picture(frame) for frame in range(len(self)))

    def picture(self, frame: int) -> "Image.Image":
        """Return the RGB picture of one frame."""
        from PIL import Image, ImageDraw

        picture = self._ground.copy()
        for (left, top), tile in self._places:
            values, high = tile.values(frame), tile.top - tile.low
            part = np.nan_to_num((values - tile.low) * (255 / high if high > 0 else 0))
            colours = self.table[np.clip(np.rint(part), 0, 255).astype(np.intp)]
            colours[np.isnan(values)] = _GROUND
            size = [round(self._side * tile.share * each / max(values.shape)) for each in reversed(values.shape)]
            corner = (left + (self._side - size[0]) // 2, top + (self._side - size[1]) // 2)
            picture.paste(Image.fromarray(colours).resize((size[0], size[1]), Image.Resampling.NEAREST), corner)
            if tile.square is not None:
                half, middle = [each * self._side / tile.width for each in tile.square], self._side / 2
                corners = [(left + middle + sign * half[0], top + middle + sign * half[1]) for sign in (-1, 1)]
                ImageDraw.Draw(picture).rectangle(corners, outline=_LINE)
        said = f"{frame / self._showing.rate:.4f} s, frame {frame}"
        ImageDraw.Draw(picture).text((_EDGE, self._size[1] - 30), said, fill="white", font=self._font)
        return picture

    @cached_property
    def _size(self) -> tuple[int, int]:
        tiles = sum(len(group) for group in self._groups)
        width = _EDGE + tiles * (self._side + _EDGE) + len(self._groups) * (_BAR + _EDGE)
        height = self._side + 90
        # Video codecs need even sizes.
        return width + width % 2, height + height % 2

    @cached_property
    def _font(self) -> Any:
        from matplotlib.font_manager import findfont
        from PIL import ImageFont

        return ImageFont.truetype(findfont("DejaVu Sans"), 14)

    @cached_property
    def _places(self) -> list[tuple[tuple[int, int], Tile]]:
        places, left = list[tuple[tuple[int, int], Tile]](), _EDGE
        for group in self._groups:
            for tile in group:
                places.append(((left, 30), tile))
                left += self._side + _EDGE
            left += _BAR + _EDGE
        return places

    @cached_property
    def _ground(self) -> "Image.Image":
        from PIL import Image, ImageDraw

        picture = Image.new("RGB", self._size, _GROUND)
        draw, left = ImageDraw.Draw(picture), _EDGE
        for group in self._groups:
            for tile in group:
                draw.text((left, 8), tile.title, fill="white", font=self._font)
                # A scale bar below the map, at most a third of its width.
                length = max(each for each in _LENGTHS if each <= tile.width / 3 or each == _LENGTHS[0])
                end, level = left + round(self._side * length / tile.width), 42 + self._side
                draw.line([(left, level - 4), (left, level), (end, level), (end, level - 4)], fill="white")
                draw.text((end + 6, level - 10), f"{_short(1e3 * length)} mm", fill="white", font=self._font)
                left += self._side + _EDGE
            bar = Image.fromarray(self.table[::-1, None]).resize((18, self._side), Image.Resampling.NEAREST)
            picture.paste(bar, (left, 30))
            draw.text((left + 22, 26), _short(group[0].top), fill="white", font=self._font)
            draw.text((left + 22, 46), group[0].unit, fill="#a9b4c0", font=self._font)
            draw.text((left + 22, 14 + self._side), _short(group[0].low), fill="white", font=self._font)
            left += _BAR + _EDGE
        width, height = self._size
        if self.slower != 1:
            draw.text((_EDGE + 190, height - 30), f"{self.slower:.4g} times slower", fill="#a9b4c0", font=self._font)
        if self._showing.simulated:
            draw.text((width - _EDGE, height - 30), "SIMULATED", fill="#ff7b72", font=self._font, anchor="ra")
        return picture


_EDGE, _BAR = 14, 74

_LENGTHS = [figure * 10.0**power for power in range(-4, 1) for figure in (1, 2, 5)]
"""Lengths of scale bars in m."""

_GROUND, _LINE = (13, 17, 23), (110, 115, 120)


def write_gif(film: Film, path: Path, *, progress: Report | None = None) -> None:
    """Write the film as a looping GIF. Raises InputError if it has more than 2000 pictures."""
    if len(film) > MOST_OF_A_GIF:
        raise InputError(
            f"{path.name}: expected at most {MOST_OF_A_GIF} frames in a GIF, got {len(film)}; "
            "show a part (--start-at, --duration), or save an .mp4"
        )
    first, *_ = pictures = [_indexed(picture, film.table) for picture in _with_progress(film, progress)]
    how = {"duration": 1000 // PICTURES_A_SECOND, "loop": 0, "optimize": False}
    first.save(path, format="GIF", save_all=True, append_images=pictures[1:], **how)


def write_mp4(film: Film, path: Path, *, progress: Report | None = None) -> None:
    """Write the film as a video with ffmpeg.

    Raises MissingExtraError if ffmpeg is not installed; InputError if ffmpeg fails, with its message.
    """
    program = ffmpeg()
    wide, high = film.picture(0).size
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{wide}x{high}", "-r", str(PICTURES_A_SECOND), "-i", "-"]
    made = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path)]
    command = [program, "-nostdin", "-loglevel", "error", "-y", *given, *made]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        pipe: Any = running.stdin
        try:
            for picture in _with_progress(film, progress):
                pipe.write(picture.tobytes())
        except BrokenPipeError:
            pass  # ffmpeg ended; its message is read below
        except BaseException:
            running.kill()
            raise
        _, said = running.communicate()
    if running.returncode:
        raise InputError(f"ffmpeg: expected the video {path.name}, got: {said.decode(errors='replace').strip()[:300]}")


def ffmpeg() -> str:
    """Return the path of ffmpeg. Raises MissingExtraError if it is not installed."""
    found = shutil.which("ffmpeg")
    if found is None:
        raise MissingExtraError("an .mp4 file needs ffmpeg, which is not installed: install it, or save a .gif")
    return found


def _with_progress(film: Film, progress: Report | None) -> "Iterator[Image.Image]":
    for done, picture in enumerate(film, 1):
        yield picture
        if progress is not None:
            progress(done, len(film))


def _indexed(picture: "Image.Image", table: NDArray[np.uint8]) -> "Image.Image":
    """Convert a picture to 256 colours: every second one of the table, and those of text and lines."""
    from PIL import Image

    palette = Image.new("P", (1, 1))
    words = [_GROUND, (255, 255, 255), (169, 180, 192), (255, 123, 114), _LINE, (60, 66, 73)]
    shades = [tuple(int(part) for part in colour) for colour in table[::2]]
    palette.putpalette([part for colour in [*shades, *words] for part in colour])
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


def _groups(showing: ViewData) -> Iterator[Sequence[Tile]]:
    if showing.sound is not None and (fields := list(_fields(showing.sound))):
        yield fields
    felt = [each for each in (showing.samples, showing.again) if each is not None]
    if felt and showing.sensor is not None:
        top = max(float(np.abs(each.values).max()) for each in felt)
        yield [_cells(each, showing.sensor, top) for each in felt]


def _fields(sound: Sound) -> Iterator[Tile]:
    shape, top, width = sound.grid.shape, sound.top, max(sound.grid.shape) * sound.grid.pitch
    if (wanted := sound.wanted) is not None:

        def target(frame: int) -> Array:
            return wanted[frame].reshape(shape)

        yield Tile(title="Target sound", values=target, top=top, unit="Pa", width=width)
    if (played := sound.played) is not None:

        def made(frame: int) -> Array:
            field = played[frame].reshape(shape)
            return np.abs(field if sound.finer is None else sound.finer(field))

        share, points = 1.0, sound.grid.columns
        if sound.finer is not None and points > 1:
            # Interpolated points lie from the first grid point to the last.
            share = (finer := len(sound.finer.across)) * (points - 1) / (finer - 1) / points
        yield Tile(title="Played sound", values=made, top=top, unit="Pa", width=width, share=share)


def _cells(channels: Channels, sensor: SensorGrid, top: float) -> Tile:
    def felt(frame: int) -> Array:
        return np.abs(channels.values[frame]).reshape(sensor.shape)

    width = max(sensor.shape) * sensor.pitch
    return Tile(title=channels.label.capitalize(), values=felt, top=top, unit=channels.unit, width=width)


def _short(value: float) -> str:
    """Format three digits without an exponent."""
    return f"{float(f'{value:.3g}'):g}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmMaps:
    """Maps of one quantity on one colour scale."""

    maps: Mapping[str, Array]
    """Signed values in `unit` by title, shape (frame, row, column); NaN where there is no skin."""
    unit: str
    pitch: float
    """Distance of the points in m."""
    square: tuple[float, float]
    """Half the sides (x, y) of the area that the sensor covers, in m."""

    def __post_init__(self) -> None:
        shape = ("frame", "row", "column")
        frozen = {name: frozen_array(each, name, shape, finite=False) for name, each in self.maps.items()}
        object.__setattr__(self, "maps", frozen)


def film_of_palm(groups: Sequence[PalmMaps], *, rate: float, side: int = 256) -> Film:
    """Make a film of simulated maps, from left to right, that have the same number of frames.

    `rate` is the frame rate in Hz, `side` the side of each map in pixels.
    """
    frames = min(len(each) for group in groups for each in group.maps.values())
    shown = ViewData(title="palm", rate=rate, frames=frames, simulated=True)
    # Red is positive, blue negative pressure. Leakage may be many times stronger than the target: on a square-root
    # scale both are visible.
    tops = [max(float(np.nanmax(np.abs(each))) for each in group.maps.values()) for group in groups]
    pairs = zip(groups, tops, strict=True)
    tiles = [[_tile(name, each, group, top) for name, each in group.maps.items()] for group, top in pairs]
    return Film(shown, side=side, groups=tiles, table="RdBu_r")


def _tile(name: str, frames: Array, group: PalmMaps, top: float) -> Tile:
    rows, columns = frames.shape[1:]
    side = max(rows, columns)
    above, left = (side - rows) // 2, (side - columns) // 2
    beside = ((above, side - rows - above), (left, side - columns - left))

    def values(frame: int) -> Array:
        roots = np.sign(frames[frame]) * np.sqrt(np.abs(frames[frame]) * top)
        # Padded to a square, so that the map keeps its aspect ratio.
        return np.pad(roots, beside, constant_values=np.nan)

    unit, width = f"{group.unit},\nsquare root", side * group.pitch
    return Tile(title=name, values=values, top=top, low=-top, unit=unit, width=width, square=group.square)
