"""Panel Reproduce: the takes, the settings of their drives, and the jobs that solve them."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from midair.errors import InputError
from midair.files import atomic_file
from midair.studio.folders import EXPORTS, StudioFolder, pack_folder
from midair.studio.importing import ImportForm, run_edit, run_import, run_words
from midair.studio.jobs import StudioJob
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.play_panel import SolveForm
from midair.studio.studio_state import Arguments, Page
from midair.studio.take_data import describe_settings, facts, made_with, stamp_of
from midair.studio.takes_list import NOTES, SAMPLES, take_of
from midair.studio.work import SolveRequest, make_sample, settings_of, solve_take


class TakeNamed(Arguments):
    """Name of a take."""

    take: str = Field(max_length=1000)


class NewName(TakeNamed):
    """Name of a take, and its new name without an ending, with a folder before it if it is to lie in one."""

    name: str = Field(min_length=1, max_length=100, pattern=r"^\w[\w -]*(/\w[\w -]*)?$")


class Notes(Arguments):
    """Text and named marks that a person adds to a take."""

    text: str = Field(default="", max_length=10_000)
    marks: dict[float, Annotated[str, Field(max_length=100)]] = Field(default={}, max_length=1000)
    """Names by time in s."""


class NotesForm(TakeNamed, Notes):
    """A take, and the notes on it."""


class EditForm(TakeNamed):
    """The command that edits a take, and its options as they are typed; an empty one is not given."""

    edit: Literal["cut", "delete", "trim", "gain", "fade", "mask", "resample", "join"]
    start: str = Field(default="", max_length=20)
    end: str = Field(default="", max_length=20)
    by: str = Field(default="", max_length=20)
    channels: str = Field(default="", max_length=200)
    rate: str = Field(default="", max_length=20)
    other: str = Field(default="", max_length=1000)
    """Take to join."""

    def words(self) -> list[str]:
        """Options of the command."""
        taken = {"cut": ("start", "end"), "fade": ("start", "end"), "gain": ("by",), "mask": ("channels",)}
        taken = (taken | {"resample": ("rate",)}).get(self.edit, ())
        return [f"--{name}={value}" for name in taken if (value := getattr(self, name).replace(" ", ""))]


class ExportForm(TakeNamed):
    """A file to make of a take, of its drive, or of what was re-recorded."""

    of: Literal["", "drive", "rerecorded"] = ""
    ending: Literal[".csv", ".wav", ".flac", ".npz", ".mat", ".json", ".html", ".gif", ".mp4"]
    channel: int = Field(default=0, ge=0)
    """The channel of a FLAC, which cannot hold those of a whole sensor."""


class JobNumber(Arguments):
    """Number of a job."""

    number: int


class ReproducePanel(Panel):
    """Takes and drives."""

    name, title, script, place = "reproduce", "Reproduce", WEB / "room-reproduce.js", 4

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._jobs, self._reading = context.jobs, context.reading
        context.playing.request = self._request
        self._edits: list[tuple[str, str]] = []  # take, and what was made of it
        self._undone: list[tuple[str, str, str]] = []  # the same, and the folder of the bin
        store = context.store
        self._offer(open=TakeNamed, drives=TakeNamed, code=SolveForm, watchers=True)
        self._offer(solve=SolveForm, rename=NewName, duplicate=TakeNamed, delete=TakeNamed, restore=TakeNamed)
        self._offer(edit=EditForm, look=EditForm, undo=Arguments, redo=Arguments, note=NotesForm)
        self._offer(export=ExportForm, pack=Arguments)
        store.offer("reproduce", "list", lambda _, __: context.show_takes(), watchers=True)
        store.offer("reproduce", "import", self.bring, ImportForm)
        store.offer("jobs", "cancel", self.cancel, JobNumber)
        store.put(edits={"undo": "", "redo": ""}, exported="")
        store.missing.append(context.show_takes)
        context.show_takes()

    def start(self) -> None:
        """Make the samples."""
        for thing in SAMPLES:
            order = (str(self._takes.samples), thing)
            self._reading.add(f"sample {thing}", make_sample, order, ended=self._solved, quiet=True)

    async def open(self, _: Page, order: TakeNamed) -> Any:
        """Return the facts of a take."""
        notes = self._notes(order)
        data = self._takes.data(order.take)
        found = await self._reading.result(f"reading {order.take}", facts, data)
        return {
            "stamp": data.stamp,
            "part": data.drive == self._takes.preview_path(order.take),
            "written": notes,
            **found,
        }

    async def drives(self, _: Page, order: TakeNamed) -> list[dict[str, Any]]:
        """Return name, mode, settings and E of each drive of a take."""
        names = self._takes.drives(order.take)
        paths = tuple(str(self._takes.beside(name, ".drive.h5")) for name in names)
        made = await self._reading.result(f"reading {order.take}", made_with, paths)
        # A solver that another mode uses can make the settings those of that mode; the label stays that of the request.
        labels = [name.removeprefix(take_of(name))[1:].partition("-")[0] for name in names]
        found = zip(names, labels, made, strict=True)
        return [{**each, "name": name, "mode": label or each["mode"]} for name, label, each in found]

    def rename(self, _: Page, order: NewName) -> str:
        """Rename a take and the files beside it."""
        self._check_idle(order.take)
        return self._listed(self._takes.rename(order.take, order.name.strip()))

    def duplicate(self, _: Page, order: TakeNamed) -> str:
        """Copy a take."""
        return self._listed(self._takes.duplicate(order.take))

    def delete(self, _: Page, order: TakeNamed) -> str:
        """Move a take to the bin; the answer is the folder that `restore` takes."""
        self._check_idle(order.take)
        return self._listed(self._takes.delete(order.take))

    def restore(self, _: Page, order: TakeNamed) -> str:
        """Move a deleted take back."""
        return self._listed(self._takes.restore(order.take))

    async def edit(self, _: Page, order: EditForm) -> str:
        """Make an edited copy of a take, which stays as it is; returns the copy."""
        made = self._takes.folder.free(self._takes.path(order.take).stem, ".h5")
        await self._reading.result(f"editing {order.take}", run_edit, self._edit_commands(order, made))
        self._edits.append((take_of(order.take), made.name))
        self._undone.clear()
        return self._edited(made.name)

    async def look(self, _: Page, order: EditForm) -> dict[str, Any]:
        """Return the course of the strongest channel as it would be after an edit."""
        commands = self._edit_commands(order, self._takes.samples / "edited.preview.h5")
        return await self._reading.result(f"preview of {order.take}", run_edit, commands)

    def _edit_commands(self, order: EditForm, made: Path) -> tuple[tuple[str, ...], ...]:
        """Return the commands of an edit; without a part, those that join what lies before and after it."""
        take = str(self._takes.path(order.take))
        if order.edit != "delete":
            others = [str(self._takes.path(order.other))] if order.edit == "join" else []
            return ((order.edit, *order.words(), "--force", take, *others, str(made)),)
        ends = [f"--end={order.start}"] * bool(order.start) + [f"--start={order.end}"] * bool(order.end)
        kept = [("cut", end, "--force", take, str(self._takes.samples / f"edited.{end[2]}.h5")) for end in ends]
        if order.start == order.end:
            raise InputError("delete: expected a part of the take, got all or nothing of it; see Delete below the list")
        if len(kept) == 1:
            return ((*kept[0][:-1], str(made)),)
        return (*kept, ("join", "--force", *(words[-1] for words in kept), str(made)))

    def note(self, _: Page, order: NotesForm) -> bool:
        """Keep notes and named marks in a file beside the take."""
        with atomic_file(self._notes_path(order)) as partial:
            partial.write_text(order.model_dump_json(exclude={"take"}, indent=1), encoding="utf-8")
        return True

    def _notes_path(self, order: TakeNamed) -> Path:
        return self._takes.beside(take_of(order.take), NOTES)

    def _notes(self, order: TakeNamed) -> dict[str, Any]:
        path = self._notes_path(order)
        try:
            return Notes.model_validate_json(path.read_bytes()).model_dump() if path.exists() else Notes().model_dump()
        except ValueError as wrong:
            raise InputError(f"{path.name}: expected the notes of a take, got something else; move it away") from wrong

    def pack(self, _: Page, __: Arguments) -> dict[str, int]:
        """Write all files of the folder into one in `exports`, as a job."""
        target = StudioFolder.at(self._takes.folder.path / EXPORTS).free("project", ".zip")
        ended = self._exported(target)
        return {"job": self._jobs.add(f"export {target.name}", pack_folder, str(target), ended=ended).number}

    def undo(self, _: Page, __: Arguments) -> str:
        """Move the copy of the last edit to the bin; returns the take that it was made of."""
        if not self._edits:
            raise InputError("undo: expected an edit in this session, there is none")
        self._check_idle(self._edits[-1][1])
        take, made = self._edits.pop()
        self._undone.append((take, made, self._takes.delete(made)))
        return self._edited(take)

    def redo(self, _: Page, __: Arguments) -> str:
        """Move the copy of the edit that was undone last back; returns it."""
        if not self._undone:
            raise InputError("redo: expected an edit that was undone, there is none")
        take, made, folder = self._undone.pop()
        self._edits.append((take, self._takes.restore(folder)))
        return self._edited(made)

    def _edited(self, name: str) -> str:
        undo, redo = (steps[-1][1] if steps else "" for steps in (self._edits, self._undone))
        self._store.put(edits={"undo": undo, "redo": redo})
        return self._listed(name)

    def export(self, _: Page, order: ExportForm) -> dict[str, int]:
        """Write a file of another format into the folder `exports`, as a job."""
        path = self._takes.beside(order.take, f".{order.of}.h5") if order.of else self._takes.path(order.take)
        if not path.exists():
            raise InputError(
                f"{path.name}: expected this file, found none; {'solve' if order.of == 'drive' else 'play'} first"
            )
        folder = self._takes.folder.path / EXPORTS
        folder.mkdir(exist_ok=True)
        stem = path.name.removesuffix(".h5") if path.suffix == ".h5" else path.name
        number, target, due = 1, folder / (stem + order.ending), {job.title for job in self._jobs.unfinished()}
        while target.exists() or f"export {target.name}" in due:
            number += 1
            target = folder / f"{stem}-{number}{order.ending}"
        film = order.ending in (".html", ".gif", ".mp4")
        words = ("show", "--no-browser", str(path), "--save") if film else ("export", str(path))
        words = (*words, str(target), *(("--channels", str(order.channel)) if order.ending == ".flac" else ()))
        ended = self._exported(target)
        return {"job": self._jobs.add(f"export {target.name}", run_words, words, room="reproduce", ended=ended).number}

    def _exported(self, target: Path) -> Callable[[StudioJob], None]:
        def ended(job: StudioJob) -> None:
            if job.state == "done":
                self._context.later(lambda: self._store.put(exported=f"exports/{target.name}"))

        return ended

    def _check_idle(self, take: str) -> None:
        busy = [job.title for job in self._jobs.unfinished() if take_of(job.title).endswith(take_of(take))]
        if busy:
            raise InputError(f"{take}: expected no job on it, got {busy[0]!r}; cancel it or wait for its end")

    def _listed(self, name: str) -> str:
        self._context.show_takes()
        return name

    async def bring(self, _: Page, order: ImportForm) -> dict[str, Any]:
        """Import an uploaded file into the session's folder as a preview, or into the studio's with `save`."""
        source = self._takes.incoming_files.find(order.file)
        words, name = order.words(), source.name
        target = self._takes.folder.free(source.stem, ".h5") if order.save else source.with_suffix(".preview.h5")
        made = await self._reading.result(f"importing {name}", run_import, (str(source), str(target), words))
        if "asked" in made:
            return made
        command = shlex.join(["midair", "import", name, *([target.name] if order.save else []), *words])
        if order.save:
            self._context.show_takes()
        return {**made, "command": command, "take": target.name if order.save else ""}

    def code(self, _: Page, order: SolveForm) -> dict[str, Any]:
        """Return the settings of a form as commands and Python."""
        return describe_settings(settings_of(self._request(order, order.take)))

    async def solve(self, page: Page, order: SolveForm) -> dict[str, Any]:
        """Add the solving of a take to the queue, the visible second first; a mode has its own drive.

        If it or a re-recording exists, the answer is a question instead; `replaces` with its stamp is the consent.
        """
        new = describe_settings(settings_of(self._request(order, order.take)))["line"]  # raises now, not in the job
        found = await self.drives(page, TakeNamed(take=order.take))
        same = [each["name"] for each in found if each["mode"] == order.mode]
        if order.beside or (found and not same):
            name = self._takes.free_drive(order.take, order.mode)
        else:
            name = order.take if order.take in same or not found else same[0]
        request = self._request(order, name)
        there = [path for path in (request.drive, *(path for path, _ in request.outdated)) if stamp_of(path)]
        stamp = "-".join(map(stamp_of, there))
        if there and order.replaces != stamp:
            made = "".join(each["made"] for each in found if each["name"] == name)
            return {"asks": {"files": [Path(path).name for path in there], "made": made, "new": new, "replaces": stamp}}
        return {"job": self._solve(order, request, name).number, "take": name}

    def _request(self, order: SolveForm, name: str) -> SolveRequest:
        drive, again = (self._takes.beside(name, ending) for ending in (".drive.h5", ".rerecorded.h5"))
        return SolveRequest(
            take=str(self._takes.path(name)),
            drive=str(drive),
            mode=order.mode,
            choices=self._choices(order),
            device=self._context.playing.device,
            array_calibration=self._context.array_calibration,
            replaces=stamp_of(drive),
            outdated=((str(again), stamp_of(again)),),
        )

    def _choices(self, order: SolveForm) -> tuple[tuple[str, Any], ...]:
        """Return the settings that differ from the mode; a stated air of the room is one of them."""
        return (*order.choices(), *self._context.air.stated.items())

    def _solve(self, order: SolveForm, whole: SolveRequest, name: str) -> StudioJob:
        title, sight = f"solve {name}", f"solve the visible second of {name}"
        for job in self._jobs.unfinished():
            if job.title in (title, sight):
                self._jobs.cancel(job.number)
        Path(self._takes.preview_path(name)).unlink(missing_ok=True)
        if order.visible_s is not None and whole.replaces:
            part = self._takes.preview_path(name)
            first = replace(whole, drive=part, start=order.visible_s, duration=1.0, replaces="", outdated=())
            self._jobs.add(sight, solve_take, first, room="reproduce", ended=self._ended(name, title))
        return self._jobs.add(title, solve_take, whole, room="reproduce", ended=self._ended(name, title))

    def cancel(self, _: Page, order: JobNumber) -> bool:
        """Cancel a job."""
        if not any(queue.cancel(order.number) for queue in (self._jobs, self._reading)):
            raise InputError(f"job {order.number}: expected a waiting or running job, it has ended")
        return True

    def _ended(self, take: str, title: str) -> Any:
        def ended(job: StudioJob) -> None:
            # The visible second is shown until the whole drive exists or has failed.
            if title not in [each.title for each in self._jobs.unfinished()]:
                Path(self._takes.preview_path(take)).unlink(missing_ok=True)
            if job.title == title and job.state == "done":
                # The comparison was made with the previous drive.
                self._takes.comparison_path(take).unlink(missing_ok=True)
                self._context.playing.newest = take
            self._solved(job)

        return ended

    def _solved(self, _: StudioJob) -> None:
        self._context.later(self._context.show_takes)
