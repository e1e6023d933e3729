"""Recordings that are part of the package: real ones whose licence permits redistribution, and synthetic ones."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from midair.datasets.strokes import Object, stroke
from midair.errors import InputError
from midair.files import open_take
from midair.model import RATE, Recording
from midair.recordings import resample


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A recording that is part of the package."""

    name: str
    """Argument of `sample`."""
    what: str
    """Description in one line."""
    licence: str
    """SPDX identifier; the text is beside the file."""
    source: str
    """Repository, commit and paper."""
    file: str = ""
    """Path below the folder of the samples; empty for a synthetic recording."""
    stroke: Object | None = None
    """Object of a synthetic recording."""
    peak: float | None = None
    """Largest pressure in Pa; None for the default of the object. For a real recording it is the largest change of any
    channel, chosen so that it can be felt, not measured."""
    faster: float = 1.0
    """Factor by which it is faster than the original."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Further notes for the provenance, besides licence and source."""

    @property
    def ready(self) -> bool:
        """True if the recording is in Pa and can be solved directly."""
        return self.peak is not None or self.stroke is not None


def _synthetic(name: Object, peak: float | None = None) -> Sample:
    return Sample(
        name=name,
        what=f"a {name} that slides over the sensor at 50 mm/s, synthetic: SIMULATED, at a level that can be felt",
        licence="MIT",
        source="midair.datasets.stroke, seed 0",
        stroke=name,
        peak=peak,
    )


_FABRICSLIDE = (
    "github.com/wngfra/FabricSlide at eceb7716027cd1bcb5e614927f4cc2d0904adb25; "
    "Wang et al. 2022, doi 10.3389/fnbot.2022.808222"
)

SAMPLES: Mapping[str, Sample] = {
    "denim": Sample(
        name="denim",
        what="a 16-taxel capacitive finger slid over denim at 50 mm/s by a robot's arm, 35.6 Hz, raw counts",
        licence="MIT",
        source=_FABRICSLIDE,
        file="fabricslide/Denim_F180_V-50mmps_0.csv",
    ),
    "connect": Sample(
        name="connect",
        what="a designed effect of one channel, 1 s at 1953 Hz, below full scale: no recording, no field",
        licence="Apache-2.0",
        source="github.com/google/audio-to-tactile at d3f449fdfd8cfe4a845d0ae244fce2a0bca34a15; no paper",
        file="audio_to_tactile/tactile_pattern_connect.wav",
    ),
    "ridges": Sample(
        name="ridges",
        what="a 16-taxel capacitive finger slid over a board with ridges of 2 mm by a robot's arm, ten times as fast",
        licence="MIT",
        source=_FABRICSLIDE,
        file="fabricslide/Board2mm_F135_V-20mmps_0.csv",
        peak=90.0,
        faster=10.0,
        notes={
            "level": "chosen so that it can be felt, not measured: the largest change of any taxel is 90 Pa",
            "speed": "recorded at 20 mm/s and 35.6 Hz, ten times as fast here, as if slid at 200 mm/s; at 5, 10, "
            "20 and 30 mm/s the ridges come every 4.0 mm alike",
            "felt": "yes, 14 dB above the detection threshold of a palm by a model of skin, as an array plays it 2 dB "
            "above the median of people; not tested on people",
        },
    ),
    # Bristles with smooth tips are felt least: 1 dB above the threshold at the model's own level.
    "brush": _synthetic("brush", 60.0),
    "sponge": _synthetic("sponge"),
    "towel": _synthetic("towel"),
}
"""By name."""


def samples() -> tuple[Sample, ...]:
    """Every sample that is part of the package."""
    return tuple(SAMPLES.values())


def sample(name: str) -> Recording:
    """Load or generate a sample by name; its provenance contains source and licence.

    Raises InputError if the name is unknown.
    """
    about = _sample_named(name)
    return _with_notes(_generated(about) if about.stroke is not None else _read(about), about)


def with_credits(name: str, recording: Recording) -> Recording:
    """A recording read from `sample_path(name)`, with licence and source added to its provenance."""
    return _with_notes(recording, _sample_named(name))


def _with_notes(recording: Recording, about: Sample) -> Recording:
    notes = {"licence": about.licence, "origin": about.source, **about.notes}
    life = replace(recording.provenance, notes={**recording.provenance.notes, **notes})
    return replace(recording, provenance=life)


def _generated(about: Sample) -> Recording:
    """Generate a synthetic sample."""
    pressure = stroke(about.stroke or "towel", peak=about.peak)
    return Recording(
        samples=pressure.pressure, rate=pressure.rate, sensor=pressure.sensor, unit="Pa", provenance=pressure.provenance
    )


def _read(about: Sample) -> Recording:
    """Read a real sample, and apply its speed and level if it has them."""
    found = open_take(sample_path(about.name), **_OPENED.get(about.name, {})).recording
    if about.peak is None:
        return found
    life = found.provenance.then("faster", {"times": about.faster, "from_hz": found.rate})
    quick = resample(replace(found, rate=about.faster * found.rate, provenance=life), RATE)
    change = np.asarray(quick.samples) - np.median(quick.samples, axis=0)
    scale = about.peak / float(np.abs(change).max())
    life = quick.provenance.then("level", {"pa_per_count": scale, "peak_pa": about.peak})
    return replace(quick, samples=scale * change, unit="Pa", provenance=life)


_OPENED: Mapping[str, Mapping[str, Any]] = {"connect": {"unit": "count"}}
"""Options that `open_take` needs for a sample."""


def _sample_named(name: str) -> Sample:
    if name not in SAMPLES:
        raise InputError(f"sample: expected one of {', '.join(SAMPLES)}, got {name!r}")
    return SAMPLES[name]


def sample_path(name: str) -> Path:
    """The original file of a sample, byte by byte as its authors published it.

    Raises InputError if the name is unknown, or the sample is synthetic.
    """
    if not _sample_named(name).file:
        raise InputError(f"sample: expected one that has a file, got {name!r}, which is made by sample()")
    return Path(str(files("midair.datasets").joinpath("samples", *SAMPLES[name].file.split("/"))))
