"""Recordings that come with the package: real ones under a licence that lets them travel, and synthetic ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from midair.datasets.strokes import Object, stroke
from midair.errors import InputError
from midair.files import open_take
from midair.model import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A recording that comes with the package.

    Attributes
    ----------
    name : str
        The name by which `sample` knows it.
    what : str
        What it is a recording of, in one line.
    licence : str
        SPDX identifier; the text lies beside the file.
    source : str
        Repository, commit and paper that it is from.
    file : str
        Path below the folder of the samples; empty where it is synthetic.
    stroke : {"brush", "sponge", "towel"} or None
        The object of a synthetic one.
    peak : float or None
        Its largest pressure, in Pa; as strong as the object makes it if None.
    """

    name: str
    what: str
    licence: str
    source: str
    file: str = ""
    stroke: Object | None = None
    peak: float | None = None


def _synthetic(name: Object, peak: float | None = None) -> Sample:
    return Sample(
        name=name,
        what=f"a {name} that slides over the sensor at 50 mm/s, synthetic: SIMULATED, at a level that is felt",
        licence="MIT",
        source="midair.datasets.stroke, seed 0",
        stroke=name,
        peak=peak,
    )


SAMPLES: Mapping[str, Sample] = {
    "denim": Sample(
        name="denim",
        what="a 16-taxel capacitive finger slid over denim at 50 mm/s by a robot's arm, 35.6 Hz, raw counts",
        licence="MIT",
        source=(
            "github.com/wngfra/FabricSlide at eceb7716027cd1bcb5e614927f4cc2d0904adb25; "
            "Wang et al. 2022, doi 10.3389/fnbot.2022.808222"
        ),
        file="fabricslide/Denim_F180_V-50mmps_0.csv",
    ),
    "connect": Sample(
        name="connect",
        what="a designed effect of one channel, 1 s at 1953 Hz, below full scale: no recording, no field",
        licence="Apache-2.0",
        source="github.com/google/audio-to-tactile at d3f449fdfd8cfe4a845d0ae244fce2a0bca34a15; no paper",
        file="audio_to_tactile/tactile_pattern_connect.wav",
    ),
    # Bristles of smooth tips are felt least: by 1 dB as strong as the model makes them.
    "brush": _synthetic("brush", 60.0),
    "sponge": _synthetic("sponge"),
    "towel": _synthetic("towel"),
}
"""By name."""


def samples() -> tuple[Sample, ...]:
    """Every sample that comes with the package: name, what it is, licence and source."""
    return tuple(SAMPLES.values())


def sample(name: str) -> Recording:
    """A recording that comes with the package.

    Parameters
    ----------
    name : str
        One of the names that `samples` lists.

    Returns
    -------
    Recording
        Its provenance names source and licence.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    known = _known(name)
    if known.stroke is not None:
        pressure = stroke(known.stroke, peak=known.peak)
        recording = Recording(
            samples=pressure.pressure,
            rate=pressure.rate,
            sensor=pressure.sensor,
            unit="Pa",
            provenance=pressure.provenance,
        )
    else:
        recording = open_take(sample_path(name), **_OPENED.get(name, {})).recording
    about = {"licence": SAMPLES[name].licence, "origin": SAMPLES[name].source}
    life = replace(recording.provenance, notes={**recording.provenance.notes, **about})
    return replace(recording, provenance=life)


_OPENED: Mapping[str, Mapping[str, Any]] = {"connect": {"unit": "count"}}
"""What has to be said to open a sample in Python."""


def _known(name: str) -> Sample:
    if name not in SAMPLES:
        raise InputError(f"sample: expected one of {', '.join(SAMPLES)}, got {name!r}")
    return SAMPLES[name]


def sample_path(name: str) -> Path:
    """The original file of a sample, byte by byte as its authors published it.

    Raises
    ------
    InputError
        If there is none of that name, or it is synthetic.
    """
    if not _known(name).file:
        raise InputError(f"sample: expected one that has a file, got {name!r}, which is made by sample()")
    return Path(str(files("midair.datasets").joinpath("samples", *SAMPLES[name].file.split("/"))))
