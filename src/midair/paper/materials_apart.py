"""Do materials stay apart? Strokes of several things through each mode, and what a classifier takes them for.

A classifier that knows the originals of all strokes but one is asked for the name of that one: of its original, and of
what a sensor heard of it in each mode. What it gets wrong of a mode and right of the original, the mode has changed.
A second one that knows the mode's own strokes tells whether they are still different from each other, whatever they
have become.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from midair.calibration import CausalInverse
from midair.datasets import Object, stroke
from midair.devices import check_exposure
from midair.dsp import resample
from midair.errors import InputError, MissingExtraError
from midair.evaluate import THIRD_OCTAVES, third_octaves
from midair.figures import ConfusionPanel, confusion_figures, png
from midair.files import contents, open_take
from midair.model import Calibration, PressureFrames, Recording
from midair.paper.modes_compared import strongest_begins
from midair.paper.result import PaperResult, Row
from midair.pipeline import at_strength, calibrated_pressure, lead_of, reproduce
from midair.rig import Stage, VirtualRig, capture_recording, quiet, rerecord, usual_exposure
from midair.settings import Mode, Settings, beside_paper, paper_mode
from midair.targets import led_in

Array = NDArray[np.float64]
LIVE = "live"
"""The mode that undoes the sensor while it is felt, as `midair live` does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """One stroke of a thing.

    Attributes
    ----------
    material : str
        What is to be told apart.
    name : str
        Of the stroke.
    take : callable
        Gives what a sensor said of it, and the sensor's calibration.
    begins : callable
        Where in what was felt the part lies that is taken, in s.
    """

    material: str
    name: str
    take: Callable[[], tuple[Recording, Calibration | None]]
    begins: Callable[[PressureFrames], float]

    def original(self, settings: Settings, duration: float) -> PressureFrames:
        """What was felt of its part, in the band and at the rate of settings."""
        whole = calibrated_pressure(*self.take(), settings)
        return whole.cut(self.begins(whole), min(duration, whole.frames / whole.rate))

    def live(self, settings: Settings, duration: float) -> PressureFrames:
        """The same part as the causal inverse of `midair live` gives it, frame by frame; its delay taken out."""
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
    """What is told apart.

    Attributes
    ----------
    folder : Path or None
        Recordings, one a stroke: in a folder of each material's name, or named MATERIAL_anything. Synthetic strokes of
        brush, sponge and towel if None.
    strokes : int
        Of each of the synthetic three, with seeds 0, 1, ...
    duration : float
        Of the part of each stroke, in s: the middle of a synthetic one, the strongest part of a recording.
    strength : float
        Of each target, its peak over a single focus of the whole array, in every mode.
    paper : Settings
        The paper's mode; the others take its air. It is solved as a whole, which has about the error of one frame
        after another in a fortieth of the time.
    mode : {"paper", "best", "quick", "finest"}
        What is put beside the paper's and the live one.
    rig : VirtualRig
        On which all is played and heard.
    """

    folder: Path | None = None
    strokes: int = 12
    duration: float = 0.3
    strength: float = 0.15
    paper: Settings = field(default_factory=lambda: paper_mode().but(method="glide"))
    mode: Mode = "best"
    rig: VirtualRig = field(default_factory=VirtualRig)

    def __post_init__(self) -> None:
        if self.strokes < 3:
            raise InputError(f"strokes: expected three or more of each thing, got {self.strokes}")

    @property
    def modes(self) -> Mapping[str, Settings]:
        """The modes by name. The live one undoes the sensor, maps and solves frame by frame."""
        return {**beside_paper(self.mode, self.paper), LIVE: self.paper.but(method="live")}


def materials_table(plan: MaterialsPlan | None = None, *, stage: Stage = quiet) -> PaperResult:
    """Take every stroke through every mode, and ask two classifiers what it was.

    Parameters
    ----------
    plan : MaterialsPlan, optional
        Its defaults if None.
    stage : callable
        Told the name of each stage as it begins.

    Raises
    ------
    InputError
        If there are fewer than two materials, or fewer than three strokes of one.
    MissingExtraError
        If scikit-learn is not installed.
    """
    plan = plan or MaterialsPlan()
    check_classifier()
    strokes = synthetic(plan) if plan.folder is None else recorded(plan.folder, plan.duration)
    names = tuple(dict.fromkeys(one.material for one in strokes))
    truth = np.array([names.index(one.material) for one in strokes])
    heard: dict[str, list[Array]] = {"original": []}
    for mode, settings in plan.modes.items():
        progress = stage(f"{len(strokes)} strokes, {mode} mode")
        for number, one in enumerate(strokes):
            wanted = (one.live if mode == LIVE else one.original)(settings, plan.duration)
            if mode == next(iter(plan.modes)):
                heard["original"].append(third_octaves(wanted))
            heard.setdefault(mode, []).append(third_octaves(through(wanted, settings, plan)))
            if progress is not None:
                progress(number + 1, len(strokes))
    known = np.array(heard["original"])
    rows: list[Row] = []
    matrices: list[ConfusionPanel] = []
    for mode, shapes in heard.items():
        named = left_out_names(known, np.array(shapes), truth)
        apart = left_out_names(np.array(shapes), np.array(shapes), truth)
        counts = np.zeros((len(names), len(names)), np.int64)
        np.add.at(counts, (truth, named), 1)
        right = int(np.trace(counts))
        low, high = share_between(right, len(truth))
        rows.append(
            {
                "mode": mode,
                "strokes": len(truth),
                "named_right": right / len(truth),
                "named_right_low": low,
                "named_right_high": high,
                "as_its_original": float(np.mean(named == left_out_names(known, known, truth))),
                "told_apart": float(np.mean(apart == truth)),
                "shape_off_db": float(np.sqrt(np.mean((np.array(shapes) - known) ** 2))),
                **{
                    f"{names[true]}_as_{names[taken]}": int(counts[true, taken])
                    for true in range(len(names))
                    for taken in range(len(names))
                },
            }
        )
        matrices.append(ConfusionPanel(title=f"{mode}\n{right} of {len(truth)} right", names=names, counts=counts))
    return PaperResult(
        name="materials",
        title="Do materials stay apart? What a classifier that knows the originals takes each stroke for",
        rows=tuple(rows),
        pictures={"materials.png": png(confusion_figures(matrices, simulated=True))},
        about={
            "materials": list(names),
            "strokes": [one.name for one in strokes],
            "duration_s": plan.duration,
            "strength": plan.strength,
            "features": f"{len(THIRD_OCTAVES)} third octaves, level taken out",
            "classifier": "linear discriminants, shrunk (Ledoit and Wolf), each stroke left out in turn",
            "interval": "95 %, Wilson",
        },
    )


def synthetic(plan: MaterialsPlan) -> list[Stroke]:
    """The middles of seeded strokes of the three objects, as the virtual sensor feels them."""

    def take(name: Object, seed: int) -> tuple[Recording, Calibration | None]:
        skin = plan.rig.skin()
        touch = stroke(name, seed=seed, rate=skin.rate, sensor=skin.model.grid)
        with plan.rig.sensor(skin, touch=touch, name=f"virtual:{name}") as sensor:
            return capture_recording(sensor, touch.frames / touch.rate), sensor.calibration

    def middle(whole: PressureFrames) -> float:
        return (whole.frames / whole.rate - plan.duration) / 2

    return [
        Stroke(material=name, name=f"{name} {seed}", take=partial(take, name, seed), begins=middle)
        for name in get_args(Object)
        for seed in range(plan.strokes)
    ]


def recorded(folder: Path, duration: float) -> list[Stroke]:
    """The strongest parts of recordings in a folder.

    Raises
    ------
    InputError
        If there are fewer than two materials, or fewer than three strokes of one.
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
            f"{folder}: expected three or more recordings of each of two or more materials, in a folder of its name or "
            f"named MATERIAL_anything, got {found}"
        )
    return strokes


def material_of(path: Path, folder: Path) -> str:
    """The folder that a recording lies in, or what its name begins with."""
    return path.parent.name if path.parent != folder else path.stem.partition("_")[0]


def through(original: PressureFrames, settings: Settings, plan: MaterialsPlan) -> PressureFrames:
    """What a sensor hears of it when the virtual rig plays it."""
    rig = replace(plan.rig, cells=original.sensor)
    lead = lead_of(settings)
    asked = led_in(original, lead)
    made = reproduce(asked, rig.array, at_strength(asked, rig.array, settings.but(strength=plan.strength)))
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        again = rerecord(check_exposure(made.solution.drive, array, usual_exposure()), array, sensor)
        heard = calibrated_pressure(again, sensor.calibration, settings, from_rest=True)
    return heard.cut(lead, original.frames / original.rate)


def left_out_names(known: Array, asked: Array, truth: NDArray[np.int64]) -> NDArray[np.int64]:
    """What each stroke is taken for by a classifier that knows all others.

    Parameters
    ----------
    known : ndarray, shape (stroke, feature)
        What it learns from.
    asked : ndarray, shape (stroke, feature)
        The same strokes, as it is asked for them.
    truth : ndarray of int, shape (stroke,)
        Their materials.

    Returns
    -------
    ndarray of int, shape (stroke,)
    """
    names = np.empty_like(truth)
    for stroke_ in range(len(truth)):
        others = np.arange(len(truth)) != stroke_
        names[stroke_] = classifier().fit(known[others], truth[others]).predict(asked[stroke_ : stroke_ + 1])[0]
    return names


def classifier() -> Any:
    """Linear discriminants with a covariance that is shrunk, since there are few strokes for so many bands."""
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    return LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")


def check_classifier() -> None:
    """Say before the work what lacks for it.

    Raises
    ------
    MissingExtraError
        If scikit-learn is not installed.
    """
    if find_spec("sklearn") is None:
        raise MissingExtraError("materials: expected scikit-learn: pip install 'midair[analysis]'")


def share_between(right: int, count: int) -> tuple[float, float]:
    """Limits of a share at 95 % (Wilson's, which hold at 0 and 1 and for small counts)."""
    from scipy.stats import binomtest

    limits = binomtest(right, count).proportion_ci(method="wilson")
    return float(limits.low), float(limits.high)
