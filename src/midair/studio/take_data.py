"""Facts and frames of a take for the page; frames are binary sections of one second.

These functions run in a worker process; the server itself reads no such files.
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from pprint import pformat
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.devices import ExposureClearance
from midair.errors import InputError, MidairError
from midair.files import OpenedTake, load_solution, load_target, open_take
from midair.model import AmplitudeFrames, Provenance, Solution, frames_without_lead
from midair.physics import TransducerDynamics, focus_amplitude, transfer_matrix
from midair.pressure_level import predicted
from midair.rig import event_message, pressure_of
from midair.settings import Settings, nearest_mode, typed_options
from midair.view import Channels, Kind, channel_sound, encode_counts, fit_interpolation, pack, phase_counts

Streams = Literal["samples", "wanted", "played", "phases", "original", "again"]

LONGEST = 120.0
"""Longest take in s that a page can hold; of a longer one it shows the first part."""


def stamp_of(path: str | Path) -> str:
    """Return the modification time of a file as text; empty if there is no file."""
    try:
        return f"{Path(path).stat().st_mtime_ns:x}"
    except FileNotFoundError:
        return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeData:
    """Paths of the files of one take; an empty path means that there is none."""

    take: str
    drive: str = ""
    comparison: str = ""
    """Pressures of the comparison."""
    stamp: str = ""
    """Changes when one of the files changes."""


def facts(data: TakeData, _: object = None) -> dict[str, Any]:
    """Return the properties of a take, without its frames."""
    take = _take(data.take, data.stamp)
    recording = take.recording
    shown = min(recording.frames, round(LONGEST * recording.rate))
    sensor = recording.sensor
    said: dict[str, Any] = {
        "frames": shown,
        "frames_in_all": recording.frames,
        "rate_hz": recording.rate,
        "unit": recording.unit,
        "rows": sensor.rows,
        "columns": sensor.columns,
        "pitch_mm": 1e3 * sensor.pitch,
        "simulated": recording.provenance.simulated,
        "source": recording.provenance.source,
        "calibrated": take.calibration is not None,
        "report": list(take.report),
        "journal": [
            {"kind": event.kind, "frame": event.frame, "said": event_message(event, recording.rate, sensor)}
            for event in take.journal
        ],
        "drive": _drive_facts(data, shown) if data.drive else None,
    }
    if data.drive and not _drive(data.drive, data.stamp)[0].drive.provenance.follows(recording.provenance):
        said["report"].append(f"{Path(data.drive).name} was made of another recording: solve this one again.")
    return said


def _drive_facts(data: TakeData, shown: int) -> dict[str, Any]:
    solution, target, _ = _drive(data.drive, data.stamp)
    drive, grid, known = solution.drive, target.grid, _chosen_settings(solution.drive.provenance)
    frames = _frames_of(solution, target, _take(data.take, data.stamp).recording.rate, 0, shown)
    fine = _finer(data.drive, data.stamp)
    focus = focus_amplitude(grid, drive.array, acoustics=drive.acoustics)
    peak = target.amplitude[frames].max(axis=1)
    return {
        "rows": grid.rows,
        "columns": grid.columns,
        "pitch_mm": 1e3 * grid.pitch,
        "height_mm": 1e3 * grid.height,
        "air_c": drive.acoustics.medium.degrees,
        "x_mm": 1e3 * grid.centre[0],
        "y_mm": 1e3 * grid.centre[1],
        "frames": len(frames),
        "rate_hz": drive.rate,
        "transducers": drive.array.count,
        "array": drive.array.name,
        "positions_mm": np.round(1e3 * drive.array.position[:, :2], 2).ravel().tolist(),
        "down": np.round(fine[0], 6).ravel().tolist(),
        "across": np.round(fine[1], 6).ravel().tolist(),
        "error": np.round(solution.error[frames], 4).tolist(),
        "strength": np.round(peak / focus, 4).tolist(),
        "settings": None if known is None else describe_settings(known),
        "verdict": _predicted(data.drive, data.stamp),
        "array_calibration": drive.provenance.last("array calibration").get("age", ""),
    }


@lru_cache(maxsize=16)
def _predicted(path: str, stamp: str) -> list[tuple[str, str]]:
    """Rows of the verdict that the model predicts for a drive; none for a silent one."""
    solution, target, _ = _drive(path, stamp)
    if not solution.plays.any():
        return []
    level, feeling = predicted(Path(path), solution, target)
    left_out = str(target.provenance.last("not reproduced").get("text", ""))
    rows = [("felt, predicted", str(feeling)), level.row()]
    return page_rows([*rows, ("left out", left_out)] if left_out else rows)


def page_rows(rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Rows of a verdict without the dashes of options, and without advice that only a command can follow."""
    return [(name, re.sub(r"; keep it: [^;]*|--(?=\w)", "", text)) for name, text in rows]


def cleared_facts(clearance: ExposureClearance) -> dict[str, Any]:
    """A passed exposure check for the page."""
    facts = {"refused": "", "outcome": clearance.outcome, "verdict": clearance.verdict()}
    return facts | exposed(clearance.exposure)


def exposed(found: Any) -> dict[str, Any]:
    """Return an exposure for the page: level and limit of each place in dB."""
    return {
        "excess_db": round(float(found.excess), 2),
        "pressure_pa": round(float(found.pressure), 2),
        "profile": found.profile.name,
        "heat": found.heat,
        "measured_in": found.measured_in,
        "places": [
            {
                "name": place.name,
                "peak_db": round(float(found.peak[number]), 1),
                "limit_db": place.limit,
                "enforced": place.enforced,
            }
            for number, place in enumerate(found.profile.places)
        ],
    }


def _chosen_settings(provenance: Provenance) -> Settings | None:
    """Settings of a drive as they were chosen: without the envelope of a measured array."""
    known = Settings.of(provenance)
    measured = known is not None and provenance.last("array calibration")
    return known.but(dynamics=TransducerDynamics()) if known is not None and measured else known


def describe_settings(settings: Settings) -> dict[str, Any]:
    """Return settings as form values ("" for the default of the mode), as one line, and as code."""
    near = nearest_mode(settings)
    mode, chosen = near or ("paper", {})
    places = {"mapping": "target.mapping", "method": "solver.method", "level": "solver.level"}
    form: dict[str, Any] = {name: chosen.get(path, "") for name, path in places.items()}
    typed = list(typed_options(chosen))
    also = [each for each in typed if not each.startswith(("--method ", "--rate "))]
    plain = settings.but(jobs=None).plain()
    simple = all(path.count(".") == 1 and not path.startswith("acoustics") for path in chosen)
    given = ", ".join(f"{path.partition('.')[2]}={value!r}" for path, value in chosen.items())
    by_name = f'MODES["{mode}"]()' + (f".but({given})" if given else "")
    return {
        "mode": mode if near else "",
        **form,
        "gain": settings.target.gain,
        "ears_db": chosen.get("target.ears", ""),
        "height_mm": float(f"{1e3 * settings.target.grid.height:.6g}") if "target.grid.height" in chosen else "",
        "line": ", ".join(
            [
                mode if near else "custom settings",
                settings.solver.name,
                f"{settings.target.rate:g} Hz",
                *(each.removeprefix("--") for each in also),
            ]
        ),
        "options": " ".join([f"--mode {mode}", *typed]) if near else "",
        "python": by_name if near and simple else f"Settings.from_plain(\n    {pformat(plain, width=100, indent=4)}\n)",
    }


def made_with(paths: tuple[str, ...], _: object = None) -> list[dict[str, Any]]:
    """Return mode, gain, settings in one line, and mean E of drives; the mode is empty if it is not known."""
    return [_made_with(path, stamp_of(path)) for path in paths]


@lru_cache(maxsize=256)
def _made_with(path: str, stamp: str) -> dict[str, Any]:
    del stamp
    try:
        solution = load_solution(path, streamed=True)
    except MidairError:
        return {"mode": "", "made": "a file that cannot be read"}
    error = solution.error[solution.plays]
    said = {"error": round(float(error.mean()), 4) if len(error) else 0.0}
    if (known := _chosen_settings(solution.drive.provenance)) is None:
        return {**said, "mode": "", "made": "made with settings that it does not contain"}
    shown = describe_settings(known)
    return {**said, "mode": shown["mode"], "gain": shown["gain"], "made": f"made with {shown['line']}"}


def frames_of(order: tuple[TakeData, Streams, int], _: object = None) -> bytes:
    """Return one second of a stream as sections; InputError if the take has no such stream."""
    data, stream, second = order
    if stream in ("original", "again"):
        return _compared(data, stream, second)
    take = _take(data.take, data.stamp)
    rate = take.recording.rate
    first = round(second * rate)
    count = min(round((second + 1) * rate), take.recording.frames, round(LONGEST * rate)) - first
    if count <= 0:
        return b""
    if stream == "samples":
        samples = np.asarray(take.recording.samples[first : first + count]).reshape(count, -1)
        return pack([encode_counts(samples - _rest(data.take, data.stamp), Kind.SAMPLES, first=first, rate=rate)])
    if stream == "wanted" and not data.drive:
        wanted = _wanted(data.take, data.stamp)
        places = np.minimum(np.rint(np.arange(first, first + count) / rate * wanted.rate), wanted.frames - 1)
        return pack(
            [encode_counts(wanted.amplitude[places.astype(np.intp)], Kind.FIELD, dtype="<i2", first=first, rate=rate)]
        )
    if not data.drive:
        raise InputError(f"{stream}: expected a take that was solved; solve it first")
    solution, target, matrix = _drive(data.drive, data.stamp)
    frames = _frames_of(solution, target, rate, first, count)
    if not len(frames):
        return b""
    if stream == "wanted":
        return pack([encode_counts(target.amplitude[frames], Kind.FIELD, dtype="<i2", first=first, rate=rate)])
    drive = solution.drive
    if stream == "phases":
        return pack([phase_counts(drive.phase[frames], first=first, rate=rate)])
    level = drive.level[frames] if drive.level.ndim == 2 else drive.level[frames][:, None]
    q = (level * np.exp(1j * drive.phase[frames])).astype(np.complex64)
    return pack([encode_counts(q @ matrix.T, Kind.FIELD, dtype="<i2", first=first, rate=rate)])


def _frames_of(solution: Solution, target: AmplitudeFrames, rate: float, first: int, count: int) -> NDArray[np.intp]:
    """Indices of the drive frames at the times of recording frames; its fade-in is left out."""
    drive = solution.drive
    inside = frames_without_lead(target.provenance, drive.frames, drive.rate)
    cut = target.provenance.last("cut")
    start = cut.get("start_s")
    # A recording that was cut by an edit begins at 0; the part of a solve has a duration.
    begin = (float(start) if isinstance(start, int | float) and "duration_s" in cut else 0.0) * drive.rate
    places = np.rint((np.arange(first, first + count) / rate) * drive.rate - begin).astype(np.intp) + inside.start
    return places[(places >= inside.start) & (places < inside.stop)]


def _compared(data: TakeData, stream: Streams, second: int) -> bytes:
    if not data.comparison:
        raise InputError(f"{stream}: expected a take that was compared; play and compare it first")
    with np.load(data.comparison) as kept:
        rate, pressure = float(kept["rate"]), kept[stream]
    first = round(second * rate)
    part = pressure[first : first + round(rate)]
    return (
        pack([encode_counts(part.reshape(len(part), -1), Kind.SAMPLES, first=first, rate=rate)]) if len(part) else b""
    )


LOUDNESS = 0.1
"""Rms of a sound as a share of full scale, the same for all."""


def sound_of(order: tuple[TakeData, Streams], _: object = None) -> bytes:
    """Return the sum of the cells as a WAV file: the original, or what came of a drive; all have the same rms."""
    data, stream = order
    if data.comparison:
        with np.load(data.comparison) as kept:
            rate, pressure = float(kept["rate"]), kept[stream]
    elif stream == "original":
        recording = _take(data.take, data.stamp).recording
        rate, pressure = recording.rate, np.asarray(recording.samples, float) - recording.samples[0]
    else:
        raise InputError(f"{stream}: expected a take that was compared; play and compare it first")
    summed = pressure.reshape(len(pressure), -1).sum(axis=1, keepdims=True)
    rms = float(summed.std()) or 1.0
    channel = Channels(values=summed, unit="Pa", label=stream)
    return channel_sound(channel, 0, rate, full_scale=rms / LOUDNESS).data


@lru_cache(maxsize=4)
def _take(path: str, stamp: str) -> OpenedTake:
    del stamp
    return open_take(path)


@lru_cache(maxsize=4)
def _rest(path: str, stamp: str) -> NDArray[np.float64]:
    """Median of each channel; the traces are drawn around it."""
    samples = np.asarray(_take(path, stamp).recording.samples)
    return np.median(samples.reshape(len(samples), -1), axis=0)


@lru_cache(maxsize=4)
def _drive(path: str, stamp: str) -> tuple[Solution, AmplitudeFrames, NDArray[np.complex64]]:
    del stamp
    solution, target = load_solution(path), load_target(path)
    if target is None:
        raise InputError(f"{Path(path).name}: expected a drive with its target, got one without; solve it again")
    drive = solution.drive
    matrix = transfer_matrix(target.grid, drive.array, acoustics=drive.acoustics)
    return solution, target, np.asarray(matrix, np.complex64)


@lru_cache(maxsize=4)
def _finer(path: str, stamp: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    solution, target, _ = _drive(path, stamp)
    made = fit_interpolation(target.grid, solution.drive.array, acoustics=solution.drive.acoustics)
    return made.down, made.across


@lru_cache(maxsize=4)
def _wanted(path: str, stamp: str) -> AmplitudeFrames:
    from midair.pipeline import target_amplitude

    take = _take(path, stamp)
    settings = Settings().but(rate=take.recording.rate)
    return target_amplitude(pressure_of(take, settings), settings)
