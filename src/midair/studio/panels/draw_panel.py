"""Panel Draw: patterns of moving foci, drawn on a palm, played and saved.

The effect of a pattern on a palm, and its drive, are computed in the worker processes.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import Field

from midair.array_types import Array
from midair.datasets import STORED
from midair.devices import measure_exposure
from midair.dsp import resample
from midair.errors import InputError
from midair.evaluate import felt, skin_motion, too_loud
from midair.files import DEFAULT_PROFILE, profile_named, read_toml, write_file
from midair.model import BAND, Acoustics, Medium, Palm, Solution, TransducerArray
from midair.patterns import PALETTE, Foci, Pattern, check_reach, draw_file, draw_parts, palm_pressure
from midair.physics import SKINS
from midair.rig import measured_transducers
from midair.studio.jobs import Progressed
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.reproduce_panel import TakeNamed
from midair.studio.studio_state import Arguments, Page
from midair.studio.take_data import stamp_of
from midair.studio.takes_list import DRAWN

LOOP, SHOWN = 2.0, 1.0
"""Lengths in s of the drive of a loop, and of the first part of a pattern that the maps show."""
SAMPLED, MOTION_RATE = 12, 1000.0
"""Moments of which the exposure is computed, and frames per second of the map of motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternRequest:
    """A pattern as the dicts of its file, the array that will play it, and the stated air of the room."""

    pattern: dict[str, Any]
    text: str = ""
    """Its TOML, in which files of recorded signals are relative."""
    device: str = "virtual"
    array_calibration: Path | None = None
    room: Medium | None = None
    files: tuple[str, ...] = ()
    """Paths of the TOML file, and of the drive if one is to be made."""
    replaces: tuple[str, ...] = ()
    """Stamps of the files that may be replaced; empty for a file that may not exist."""

    def array(self) -> TransducerArray:
        """Return the array, with its calibration if there is one."""
        return measured_transducers(self.device, given=self.array_calibration)


def preview_pattern(request: PatternRequest, _: Progressed) -> dict[str, Any]:
    """Return maps of pressure and motion of the skin, the exposure of the loudest frames, and the level that is felt.

    The pressure is that of ideal foci, in steps of a quarter of a millimetre.
    """
    pattern, array, palm = Pattern.from_plain(request.pattern), request.array(), Palm.disc()
    foci, acoustics = (
        pattern.foci(min(pattern.duration_s or SHOWN, SHOWN)),
        Acoustics(medium=request.room or Medium.at()),
    )
    used = check_reach(foci, array, acoustics)
    pressure, rate = palm_pressure(foci, array, palm, acoustics=acoustics)
    skin = skin_motion(SKINS["soft, deep"], palm.inside.shape, palm.pitch, MOTION_RATE, BAND)
    motion = skin.displacement(resample(pressure, rate, MOTION_RATE))
    perceived = felt(pressure, rate, palm.pitch)
    return {
        "rows": len(palm.inside),
        "pressure": _map(pressure, palm),
        "motion": _map(1e6 * motion, palm),
        "highest_pa": float(f"{foci.pressure.max():.4g}"),
        "reach": used,
        "exposure": _exposure(foci, array, acoustics, request.room) if foci.pressure.any() else None,
        "felt": perceived.plain() | {"text": str(perceived)},
    }


def _map(values: Array, palm: Palm) -> dict[str, Any]:
    """Rms over time in 255 steps of its highest value, row by row from the lowest y; -1 beside the skin."""
    rms = np.sqrt((values**2).mean(axis=0))
    top, (row, column) = float(rms.max()), np.unravel_index(int(rms.argmax()), rms.shape)
    place = [1e3 * palm.pitch * (int(at) - (len(rms) - 1) / 2) for at in (column, row)]
    steps = np.where(palm.inside, np.rint(255 * rms / max(top, 1e-12)), -1).astype(int)
    return {"top": float(f"{top:.3g}"), "at_mm": place, "steps": steps.ravel().tolist()}


def _exposure(foci: Foci, array: TransducerArray, acoustics: Acoustics, room: Medium | None) -> dict[str, Any]:
    """Highest level at the place that is nearest to its limit, of moments of four frames with silence between them."""
    together = foci.pressure.sum(axis=1)
    loud = np.flatnonzero(together >= 0.9 * together.max())
    jump = np.abs(np.diff(foci.position, axis=0)).max(axis=(1, 2)) * np.minimum(together[1:], together[:-1])
    chosen = [*loud[np.unique(np.linspace(0, len(loud) - 1, SAMPLED).astype(int))], int(np.append(jump, 0).argmax())]
    moments = np.clip(np.add.outer(chosen, np.arange(-2, 4)), 0, foci.frames - 1)
    sounds = np.array([1, 1, 1, 1, 0, 0])[:, None]
    part = replace(
        foci,
        position=foci.position[moments].reshape(-1, *foci.position.shape[1:]),
        pressure=(foci.pressure[moments] * sounds).reshape(-1, *foci.pressure.shape[1:]),
    )
    drive = Solution.joined(list(draw_parts(part, array, acoustics=acoustics))).drive
    found = measure_exposure(drive, array, profile_named(DEFAULT_PROFILE), room=room)
    place, frame = found.worst
    peak = float(found.level[frame, found.profile.places.index(place)])
    ears = {"text": too_loud(peak - place.limit), "loud": peak > place.limit}
    return {"place": place.name, "peak_db": round(peak, 1), "limit_db": place.limit, **ears}


def save_pattern(request: PatternRequest, progress: Progressed) -> list[str]:
    """Write a pattern as TOML, and its drive if a second path is given; returns the file names.

    InputError if a file has changed since the page was asked whether it may be replaced.
    """
    pattern, source = Pattern.from_plain(request.pattern), Path(request.files[0])
    if tuple(map(stamp_of, request.files)) != request.replaces:
        raise InputError("save: expected the files as they were when it was asked, one has changed; save again")
    write_file(source, request.text)
    for drive in request.files[1:]:
        foci, stage = pattern.foci(None if pattern.duration_s else LOOP), partial(progress, "drawing")
        draw_file(foci, source, drive, request.array(), medium=request.room, progress=stage)
    return [Path(file).name for file in request.files]


class PatternForm(Arguments):
    """A pattern as the dicts of its TOML file."""

    pattern: dict[str, Any]


class SaveForm(PatternForm):
    """A pattern, the name of its file without ending, and whether its drive is written too."""

    name: str = Field(min_length=1, max_length=100, pattern=r"^\w[\w -]*$")
    drive: bool = False
    replaces: str = Field(default="", max_length=200)


class DrawPanel(Panel):
    """The palette, the preview of a pattern, its file and its drive."""

    name, title, script, place = "draw", "Draw", WEB / "room-draw.js", 6

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._offer(files=Arguments, open=TakeNamed, preview=PatternForm, watchers=True)
        self._offer(save=SaveForm, draft=PatternForm, change=PatternForm)
        known = STORED["touch"] | STORED["drawn"]
        figures = {name: (known[name]["felt"], known[name]["ears"], too_loud(known[name]["ears"])) for name in PALETTE}
        self._show(palette={name: (one, *figures[name]) for name, one in PALETTE.items()}, files=[])

    def files(self, *_: object) -> None:
        """List the TOML files of the folder."""
        self._show(files=self._takes.folder.names(".toml"))

    def open(self, _: Page, order: TakeNamed) -> dict[str, Any]:
        """Return a pattern of the folder as dicts; InputError or BrokenFileError if the file is not a pattern."""
        plain = read_toml(self._takes.folder.find(order.take), "a pattern in TOML")
        Pattern.from_plain(plain)
        return plain

    async def preview(self, _: Page, order: PatternForm) -> dict[str, Any]:
        """Return what a pattern does to the palm."""
        return await self._context.reading.result("preview of a pattern", preview_pattern, self._request(order))

    async def save(self, _: Page, order: SaveForm) -> dict[str, Any]:
        """Save a pattern in the folder, with its drive on request.

        If a file exists, the answer is a question instead; `replaces` with its stamp is the consent.
        """
        endings = (".toml", ".drive.h5")[: 1 + order.drive]
        files = [self._takes.folder.place(order.name + ending) for ending in endings]
        request = self._request(order, files)
        stamps = "-".join(request.replaces)
        if any(request.replaces) and order.replaces != stamps:
            return {"asks": {"files": [each.name for each in files if each.exists()], "replaces": stamps}}
        saved = await self._write(request)
        self.files()
        return {"saved": saved}

    async def draft(self, _: Page, order: PatternForm) -> str:
        """Make the drive of a pattern in the session's folder; returns the name to check and play."""
        await self._draft(order, ".toml", ".drive.h5")
        (self._takes.samples / "drawn" / "pattern.rerecorded.h5").unlink(missing_ok=True)
        return f"{DRAWN}pattern.toml"

    async def change(self, _: Page, order: PatternForm) -> dict[str, Any]:
        """Let a pattern replace the one that plays in a loop, when its exposure has been checked."""
        return await self._context.playing.change(await self._draft(order, ".toml"))

    async def _draft(self, order: PatternForm, *endings: str) -> Path:
        """Write a pattern with an end into the session's folder."""
        (folder := self._takes.samples / "drawn").mkdir(exist_ok=True)
        files = [folder / f"pattern{ending}" for ending in endings]
        request = self._request(order, files)
        plain = {"duration_s": LOOP} | request.pattern
        await self._write(replace(request, pattern=plain, text=tomli_w.dumps(plain)))
        return files[0]

    async def _write(self, request: PatternRequest) -> list[str]:
        queue = self._context.jobs if len(request.files) > 1 else self._context.reading
        return await queue.result(f"draw {Path(next(iter(request.files))).stem}", save_pattern, request)

    def _request(self, order: PatternForm, files: Sequence[Path] = ()) -> PatternRequest:
        plain = deepcopy(order.pattern)
        for spot in plain["spot"] if isinstance(plain.get("spot"), list) else []:
            if isinstance(spot, dict) and isinstance(signal := spot.get("signal"), dict):  # pyright: ignore[reportUnknownMemberType]
                signal["file"] = str(self._takes.folder.find(str(signal.get("file", ""))))  # pyright: ignore[reportUnknownMemberType]
        context = self._context
        return PatternRequest(
            pattern=plain,
            text=tomli_w.dumps(order.pattern),
            device=context.playing.device,
            array_calibration=context.array_calibration,
            room=context.air.medium,
            files=tuple(map(str, files)),
            replaces=tuple(map(stamp_of, files)),
        )
