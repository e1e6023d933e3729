"""The command `show`: a recording, a drive or a comparison as a web page, a film or a sound file."""

import os
import sys
import time
import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from midair import files, rig, view
from midair.cli.console import banner, out, print_rows, progress_bars
from midair.cli.options import BandOptions, Force, OptionalTime, Time
from midair.cli.output import may_write
from midair.errors import InputError
from midair.pipeline import target_amplitude

ENDINGS = (".html", ".mp4", ".gif", ".wav")
"""Formats that `show` writes."""


def show_command(
    source: Path,
    again: Path | None = None,
    /,
    *,
    save: Annotated[Path | None, Parameter(alias="-o")] = None,
    channel: int | None = None,
    target: bool = False,
    start_at: Time = 0.0,
    duration: OptionalTime = None,
    options: BandOptions | None = None,
    no_browser: bool = False,
    force: Force = False,
) -> None:
    """Show a recording, a drive or a comparison as a web page, a film or a sound file.

    The web page is a single file that works offline.
    It shows traces, spectrogram, fields and phases, and can play, pause and step.
    A film shows every frame at 50 pictures per second.

    Parameters
    ----------
    source
        File to show: a recording, NAME.drive.h5, or any recording that midair can import.
    again
        Re-recording to show over the recording.
    save
        File to write: page.html, film.mp4 (needs ffmpeg), film.gif or wave.wav. [default: NAME.show.html]
    channel
        Channel to listen to, from 0. [default: the loudest]
    target
        Show the target sound amplitude at the control points instead of the recording.
    start_at
        Start of the part to show.
    duration
        Length of the part to show. [default: to the end]
    no_browser
        Do not open the page in a browser.

    Examples
    --------
    $ midair show take.h5
    $ midair show take.drive.h5 --save take.gif --duration 0.2s
    $ midair show take.h5 take.rerecorded.h5 --save both.html
    $ midair show take.h5 --save take.wav --channel 6
    """
    if again is not None and again.suffix.lower() in ENDINGS and not again.exists():
        raise InputError(f"{again}: expected a re-recording to show beside {source}; a file to write is --save {again}")
    path = save or source.with_name(f"{source.name.removesuffix('.h5')}.show.html")
    may_write(path, force or save is None, *ENDINGS)
    if path.suffix.lower() == ".mp4":
        view.ffmpeg()
    began = time.monotonic()
    shown = _shown(source, again, (start_at, duration), target=target, options=options or BandOptions())
    shown = replace(shown, chosen=channel)
    banner(shown.simulated)
    rows = _WRITERS[path.suffix.lower()](shown, path)
    count = path.stat().st_size
    size = f"{count / 1e6:.3g} MB" if count >= 1e5 else f"{count / 1e3:.3g} kB"
    told = [*rows, ("written", f"{path}, {size}, in {time.monotonic() - began:.1f} s")]
    print_rows([("shown", f"{shown.title}, {shown.frames} frames, {shown.duration:.4g} s"), *told])
    if path.suffix.lower() == ".html" and not no_browser and _has_browser():
        webbrowser.open(path.resolve().as_uri())


def _shown(source: Path, again: Path | None, part: view.Part, *, target: bool, options: BandOptions) -> view.ViewData:
    if again is not None:
        take = rig.calibrated_take(again)
        settings = rig.settings_of_rerecording(take.recording.provenance, options.settings())
        pair = rig.aligned_pair(rig.pressure_of(source, settings), take, settings)
        return view.show_comparison(pair.original, pair.piece, part=part)
    if source.name.lower().endswith((".h5", ".hdf5")) and files.contents(source).kind == "drive":
        return view.show_drive(
            files.load_solution(source, streamed=True), target=files.load_target(source, streamed=True), part=part
        )
    settings = options.settings()
    if target:
        return view.show_target(target_amplitude(rig.pressure_of(source, settings), settings), part=part)
    take = files.open_take(source)
    felt = None if take.calibration is None else rig.pressure_of(source, settings)
    return view.show_recording(take.recording, pressure=felt, part=part)


def _page(shown: view.ViewData, path: Path) -> list[tuple[str, str]]:
    view.check_size(shown)
    files.write_file(path, view.show_page(shown))
    return []


def _film(shown: view.ViewData, path: Path) -> list[tuple[str, str]]:
    film, kind = view.Film(shown), path.suffix.lower()
    out().print(f"film of {len(film)} pictures, {film.seconds:.3g} s, {film.slower:.4g} times slower")
    with progress_bars() as stage, files.atomic_file(path) as partial:
        (view.write_mp4 if kind == ".mp4" else view.write_gif)(film, partial, progress=stage("film"))
    return []


def _wave(shown: view.ViewData, path: Path) -> list[tuple[str, str]]:
    if shown.samples is None:
        raise InputError(f"{path}: expected a recording for a sound file, got a drive; save a page or a film")
    heard = view.channel_sound(shown.samples, shown.channel, shown.rate)
    files.write_file(path, heard.data)
    return [("heard", f"channel {shown.channel}; full scale is {heard.full_scale:.3g} {shown.samples.unit}")]


_WRITERS = {".html": _page, ".mp4": _film, ".gif": _film, ".wav": _wave}


def _has_browser() -> bool:
    """Whether a browser can open here: stdout is a terminal and there is a display."""
    windows = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.stdout.isatty() and bool(windows)
