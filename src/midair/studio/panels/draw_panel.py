"""Panel Draw: patterns of moving foci, drawn on a palm, played and saved."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import Field

from midair.files import read_toml
from midair.patterns import Pattern
from midair.studio.drawn_pattern import PatternRequest, preview_pattern, save_pattern
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.reproduce_panel import TakeNamed
from midair.studio.studio_state import Arguments, Page
from midair.studio.take_data import stamp_of
from midair.studio.takes_list import DRAWN


class PatternForm(Arguments):
    """A pattern as the dicts of its TOML file."""

    pattern: dict[str, Any]


class SaveForm(PatternForm):
    """A pattern, the name of its file without ending, and whether its drive is made too."""

    name: str = Field(min_length=1, max_length=100, pattern=r"^\w[\w -]*$")
    drive: bool = False
    replaces: str = Field(default="", max_length=200)


class DrawPanel(Panel):
    """The palette, the preview of a pattern, its file and its drive."""

    name, title, script = "draw", "Draw", WEB / "room-draw.js"

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        store = context.store
        store.offer("draw", "files", self.files, watchers=True)
        store.offer("draw", "open", self.open, TakeNamed, watchers=True)
        store.offer("draw", "preview", self.preview, PatternForm, watchers=True)
        store.offer("draw", "save", self.save, SaveForm)
        store.offer("draw", "draft", self.draft, PatternForm)
        self._show(palette=read_toml(WEB.with_name("palette.toml"), "patterns"), files=[])

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
        files = [self._takes.folder.place(order.name + ending) for ending in (".toml", ".drive.h5")[: 1 + order.drive]]
        stamps = tuple(map(stamp_of, files))
        if any(stamps) and order.replaces != "-".join(stamps):
            return {"asks": {"files": [each.name for each in files if each.exists()], "replaces": "-".join(stamps)}}
        saved = await self._write(order, files, stamps)
        self.files()
        return {"saved": saved}

    async def draft(self, _: Page, order: PatternForm) -> str:
        """Make the drive of a pattern in the session's folder; returns the name to check and play."""
        (folder := self._takes.samples / "drawn").mkdir(exist_ok=True)
        (folder / "pattern.rerecorded.h5").unlink(missing_ok=True)
        files = [folder / "pattern.toml", folder / "pattern.drive.h5"]
        await self._write(order, files, tuple(map(stamp_of, files)))
        return f"{DRAWN}pattern.toml"

    async def _write(self, order: PatternForm, files: list[Path], stamps: tuple[str, ...]) -> list[str]:
        request = self._request(order, files=tuple(map(str, files)), replaces=stamps)
        queue = self._context.jobs if len(files) > 1 else self._context.reading
        return await queue.result(f"draw {files[0].stem}", save_pattern, request)

    def _request(self, order: PatternForm, **more: Any) -> PatternRequest:
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
            **more,
        )
