"""Test whether materials stay distinguishable (`python -m benchmarks.materials`): reproduce strokes, classify them.

For each stroke, a classifier that was trained on the originals of all other strokes predicts the material: from the
original, and from the re-recording in each mode. Errors on the re-recordings only are caused by the mode. A second
classifier, trained on the mode's own re-recordings, tests whether the materials still differ from each other.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration import CausalInverse
from midair.datasets import Object, stroke
from midair.dsp import band_energies, resample
from midair.errors import InputError
from midair.files import contents, open_take
from midair.model import Calibration, PressureFrames, Recording
from midair.paper.modes_compared import strongest_begins
from midair.pipeline import calibrated_pressure, reproduce, required_lead, with_fitted_gain
from midair.rig import Session, VirtualRig, record
from midair.settings import Mode, Settings, paper_mode, with_paper_mode
from midair.targets import add_lead

THIRD_OCTAVES = [tuple(1000 * 10 ** ((number + half) / 10) for half in (-0.5, 0.5)) for number in range(-16, -3)]
LIVE = "live"
"""The mode that inverts the sensor causally, as `midair live` does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """One stroke over a material."""

    material: str
    """Label for the classifier."""
    name: str
    """Name of the stroke."""
    take: Callable[[], tuple[Recording, Calibration | None]]
    """Returns the recording and the sensor's calibration."""
    begins: Callable[[PressureFrames], float]
    """Returns the start of the evaluated part of the pressure, in s."""

    def original(self, settings: Settings, duration: float) -> PressureFrames:
        """Calibrated pressure of the evaluated part, in the band and at the rate of settings."""
        whole = calibrated_pressure(*self.take(), settings)
        return whole.cut(self.begins(whole), min(duration, whole.frames / whole.rate))

    def live(self, settings: Settings, duration: float) -> PressureFrames:
        """The same part from the causal inverse of `midair live`, with its delay removed."""
        recording, calibration = self.take()
        rate, band = settings.target.rate, settings.calibration.band
        whole = calibrated_pressure(recording, calibration, settings)
        samples = recording.samples
        if not np.isclose(recording.rate, rate, rtol=1e-9):
            samples = resample(samples, recording.rate, rate)
        known = calibration or Calibration.flat(recording.sensor, sensitivity=1.0, unit=recording.unit)
        inverse = CausalInverse(known, rate, band=band)
        late = replace(whole, pressure=inverse.push(np.asarray(samples, float))[: whole.frames])
        length = whole.frames / whole.rate
        return late.cut(min(self.begins(whole) + inverse.delay, length - duration), min(duration, length))


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialsPlan:
    """Settings of the classification."""

    folder: Path | None = None
    """Recordings of one stroke each, in a folder for each material or named MATERIAL_anything; synthetic strokes
    of brush, sponge and towel if None."""
    strokes: int = 12
    """Number of strokes of each synthetic object, with seeds 0, 1, ..."""
    duration: float = 0.3
    """Duration in s of the part of each stroke: the middle of a synthetic one, the strongest part of a recording."""
    strength: float = 0.15
    """Peak of each target over a single focus of the whole array, in every mode."""
    paper: Settings = field(default_factory=lambda: paper_mode().but(method="glide"))
    """The paper's mode; the other modes use its air. Its recordings are solved as a whole, which gives about the
    error of frame-by-frame solving in a fortieth of the time."""
    mode: Mode = "best"
    """Mode to compare with the paper's and the live mode."""
    rig: VirtualRig = field(default_factory=VirtualRig)
    """Rig for playback and re-recording."""

    def __post_init__(self) -> None:
        if self.strokes < 3:
            raise InputError(f"strokes: expected three or more of each object, got {self.strokes}")

    @property
    def modes(self) -> Mapping[str, Settings]:
        """The modes by name. The live mode inverts the sensor, maps and solves frame by frame."""
        return {**with_paper_mode(self.mode, self.paper), LIVE: self.paper.but(method="live")}


def print_materials(plan: MaterialsPlan) -> None:
    """Reproduce every stroke in every mode, classify it with two classifiers, and print a row and the answers of each.

    Raises InputError if there are fewer than two materials, or fewer than three strokes of one.
    """
    strokes = synthetic(plan) if plan.folder is None else recorded(plan.folder, plan.duration)
    names = list(dict.fromkeys(one.material for one in strokes))
    truth = np.array([names.index(one.material) for one in strokes])
    heard: dict[str, list[Array]] = {"original": []}
    for mode, settings in plan.modes.items():
        for one in strokes:
            wanted = (one.live if mode == LIVE else one.original)(settings, plan.duration)
            if mode == next(iter(plan.modes)):
                heard["original"].append(third_octaves(wanted))
            heard.setdefault(mode, []).append(third_octaves(through(wanted, settings, plan)))
    known = np.array(heard["original"])
    print(f"{len(truth)} strokes; rows: true material; columns: classified as", ", ".join(names))
    for mode, found in heard.items():
        shapes = np.array(found)
        named, apart = left_out_names(known, shapes, truth), left_out_names(shapes, shapes, truth)
        counts = np.zeros((len(names), len(names)), int)
        np.add.at(counts, (truth, named), 1)
        low, high = share_between(int(np.trace(counts)), len(truth))
        alike = np.mean(named == left_out_names(known, known, truth))
        print(
            f"{mode:9} {np.mean(named == truth):.2f} correct ({low:.2f} to {high:.2f}), same as original {alike:.2f}, "
            f"correct within the mode {np.mean(apart == truth):.2f}, error of third octaves "
            f"{np.sqrt(np.mean((shapes - known) ** 2)):.1f} dB",
            flush=True,
        )
        for name, row in zip(names, counts, strict=True):
            print("   ", f"{name:14}", " ".join(f"{each:3d}" for each in row))


def synthetic(plan: MaterialsPlan) -> list[Stroke]:
    """Middle parts of seeded strokes of the three objects on the virtual sensor."""

    def take(name: Object, seed: int) -> tuple[Recording, Calibration | None]:
        skin = plan.rig.skin()
        touch = stroke(name, seed=seed, rate=skin.rate, sensor=skin.model.grid)
        with plan.rig.sensor(skin, touch=touch, name=f"virtual:{name}") as sensor:
            return record(sensor, touch.frames / touch.rate).recording, sensor.calibration

    def middle(whole: PressureFrames) -> float:
        return (whole.frames / whole.rate - plan.duration) / 2

    return [
        Stroke(material=name, name=f"{name} {seed}", take=partial(take, name, seed), begins=middle)
        for name in get_args(Object)
        for seed in range(plan.strokes)
    ]


def recorded(folder: Path, duration: float) -> list[Stroke]:
    """Strongest parts of the recordings in a folder.

    Raises an InputError for fewer than two materials, or fewer than three strokes of one.
    """

    def take(path: Path) -> tuple[Recording, Calibration | None]:
        opened = open_take(path)
        return opened.recording, opened.calibration

    paths = [path for path in sorted(folder.rglob("*.h5")) if contents(path).kind == "recording"]
    begins = partial(strongest_begins, duration=duration)
    strokes = [
        Stroke(material=material_of(path, folder), name=path.stem, take=partial(take, path), begins=begins)
        for path in paths
    ]
    count = {name: sum(one.material == name for one in strokes) for name in dict.fromkeys(s.material for s in strokes)}
    if len(count) < 2 or min(count.values()) < 3:
        found = ", ".join(f"{number} of {name}" for name, number in count.items()) or "no recording"
        raise InputError(
            f"{folder}: expected two or more materials with three or more recordings each, in a folder per material or "
            f"named MATERIAL_anything, got {found}"
        )
    return strokes


def material_of(path: Path, folder: Path) -> str:
    """Name of the recording's folder, or the beginning of its file name."""
    return path.parent.name if path.parent != folder else path.stem.partition("_")[0]


def through(original: PressureFrames, settings: Settings, plan: MaterialsPlan) -> PressureFrames:
    """Play a pressure on the virtual rig and return the re-recording."""
    rig = replace(plan.rig, cells=original.sensor)
    lead = required_lead(settings)
    asked = add_lead(original, lead)
    made = reproduce(asked, rig.array, with_fitted_gain(asked, rig.array, settings.but(strength=plan.strength)))
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        again = Session.on(array, sensor, None).rerecord(made.solution.drive)
        heard = calibrated_pressure(again, sensor.calibration, settings, from_rest=True)
    return heard.cut(lead, original.frames / original.rate)


def third_octaves(pressure: PressureFrames) -> Array:
    """Level of each third octave relative to the total power of all cells, in dB, shape (13,), at least -60 dB.

    The levels do not depend on the overall level, so a texture and a weaker copy of it have the same levels.
    """
    power = band_energies(pressure.pressure, pressure.rate, THIRD_OCTAVES).reshape(len(THIRD_OCTAVES), -1).sum(axis=1)
    if not power.sum() > 0:
        raise InputError("texture: expected vibration between 22 and 447 Hz, got silence")
    return 10 * np.log10(np.maximum(power / power.sum(), 1e-6))


def left_out_names(known: Array, asked: Array, truth: NDArray[np.int64]) -> NDArray[np.int64]:
    """Classify each stroke with a classifier trained on all other strokes (leave-one-out).

    `known` are the training features, shape (stroke, feature), `asked` the features to classify for the same strokes,
    and `truth` the materials, shape (stroke,).
    """
    names = np.empty_like(truth)
    for stroke_ in range(len(truth)):
        others = np.arange(len(truth)) != stroke_
        names[stroke_] = classifier().fit(known[others], truth[others]).predict(asked[stroke_ : stroke_ + 1])[0]
    return names


def classifier() -> Any:
    """Linear discriminant analysis with a shrunk covariance, because there are few strokes for the number of bands."""
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    return LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")


def share_between(right: int, count: int) -> tuple[float, float]:
    """Confidence limits of a proportion at 95 % (Wilson's, valid at 0 and 1 and for small counts)."""
    from scipy.stats import binomtest

    limits = binomtest(right, count).proportion_ci(method="wilson")
    return float(limits.low), float(limits.high)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.materials", description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=Path, help="a folder for each material; synthetic strokes without it")
    parser.add_argument("--strokes", type=int, default=12, help="of each synthetic material")
    parser.add_argument("--mode", choices=("best", "quick", "finest"), default="best")
    options = parser.parse_args()
    print_materials(MaterialsPlan(folder=options.recordings, strokes=options.strokes, mode=options.mode))


if __name__ == "__main__":
    main()
