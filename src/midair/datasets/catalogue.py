"""Real recordings, small and under a licence that lets them travel with the package."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

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
        Path below the folder of the samples.
    """

    name: str
    what: str
    licence: str
    source: str
    file: str


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
    recording = open_take(sample_path(name)).recording
    about = {"licence": SAMPLES[name].licence, "origin": SAMPLES[name].source}
    life = replace(recording.provenance, notes={**recording.provenance.notes, **about})
    return replace(recording, provenance=life)


def sample_path(name: str) -> Path:
    """The original file of a sample, byte by byte as its authors published it.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in SAMPLES:
        raise InputError(f"sample: expected one of {', '.join(SAMPLES)}, got {name!r}")
    return Path(str(files("midair.datasets").joinpath("samples", *SAMPLES[name].file.split("/"))))
