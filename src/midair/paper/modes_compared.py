"""Compare the fidelity of two modes on test signals and objects, from the sensor to the palm."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from midair.datasets import probe_signal
from midair.dsp import strongest_window
from midair.errors import InputError
from midair.evaluate import Budget, in_band
from midair.figures import budget_figure, passes_figure, png_bytes
from midair.model import BAND, PressureFrames
from midair.paper.figures import PaperResult, Row
from midair.physics import focus_amplitude
from midair.pipeline import required_lead, target_amplitude
from midair.rig import (
    BudgetPlan,
    Loop,
    OpenRig,
    Stage,
    VirtualRig,
    error_budget,
    loop,
    no_progress,
    pressure_of,
    record,
)
from midair.settings import Mode, Settings, paper_mode, with_fewer_points, with_paper_mode
from midair.targets import add_lead

SIGNALS = ("25+250 Hz", "noise", "bursts")
OBJECTS = ("brush", "sponge", "towel")


@dataclass(frozen=True, slots=True, kw_only=True)
class FidelityPlan:
    """Settings of the comparison."""

    things: tuple[str, ...] = (*SIGNALS, *OBJECTS)
    """Test signals, objects, and files of calibrated recordings."""
    paper: Settings = field(default_factory=paper_mode)
    best: Settings | None = None
    """Settings of the other mode; its defaults if None."""
    mode: Mode = "best"
    """Mode to compare with the paper's."""
    strength: float = 0.15
    """Strength of the target in both modes."""
    duration: float = 0.12
    """Duration of each test signal and of the part of each stroke, in s."""
    passes: int = 6
    """Passes of the iterative correction, which is applied to the noise only; 0 for none."""
    points: int = 11
    """Rows and columns of the control points for the correction, over the same square."""
    rig: VirtualRig = field(default_factory=VirtualRig)
    """Rig whose transducers vary in resonance, quality factor and strength."""

    def __post_init__(self) -> None:
        known = (*SIGNALS, *OBJECTS)
        unknown = [thing for thing in self.things if thing not in known and not Path(thing).is_file()]
        if unknown or not self.things:
            raise InputError(
                f"things: expected some of {', '.join(known)}, or files of calibrated recordings, "
                f"got {', '.join(unknown) or 'none'}"
            )

    @property
    def modes(self) -> Mapping[str, Settings]:
        """The two modes by name."""
        return with_paper_mode(self.mode, self.paper, self.best)


def fidelity_table(plan: FidelityPlan | None = None, *, stage: Stage = no_progress) -> PaperResult:
    """Compute error budgets of all signals in both modes at the same strength, and iterative corrections.

    `stage` is called with the name of each stage as it begins.
    """
    plan = plan or FidelityPlan()
    rows: list[Row] = []
    pictures: dict[str, bytes] = {}
    for thing in plan.things:
        called = thing if thing in (*SIGNALS, *OBJECTS) else Path(thing).stem
        made: list[tuple[str, Budget]] = []
        for mode, settings in plan.modes.items():
            original = original_of(thing, plan, settings)
            alike = at_strength(original, settings, plan)
            lead = required_lead(alike)
            at = BudgetPlan(settings=alike, rig=replace(plan.rig, cells=original.sensor), lead=lead)
            budget = error_budget(original, at, stage=lambda what, m=mode, t=called: stage(f"{t}, {m}: {what}"))
            made.append((f"{called}, {mode} mode", budget))
            rows.append(_row(called, mode, budget))
        name = "".join(letter if letter.isalnum() else "-" for letter in called).lower()
        pictures[f"budget-{name}.png"] = png_bytes(budget_figure(made))
    about: dict[str, object] = {"strength": plan.strength, "duration_s": plan.duration}
    if plan.passes:
        loops = {mode: iterated_loop(plan, settings, stage) for mode, settings in plan.modes.items()}
        errors = {mode: [one.comparison.waveform_error for one in loop.passes[1:]] for mode, loop in loops.items()}
        series = [(f"noise, {mode} mode", each) for mode, each in errors.items()]
        pictures["passes.png"] = png_bytes(passes_figure(series, simulated=True))
        about["iterative_correction_of_noise"] = {
            mode: {"waveform_error": errors[mode], "taken_back": loop.taken_back, "end": loop.end}
            for mode, loop in loops.items()
        }
    return PaperResult(
        name="fidelity",
        title="Fidelity from the sensor to the palm, in both modes",
        rows=tuple(rows),
        pictures=pictures,
        about=about,
    )


def original_of(thing: str, plan: FidelityPlan, settings: Settings) -> PressureFrames:
    """Pressure of a test signal or of the middle of a stroke on the virtual sensor, at the rate of a mode.

    For a recording, the strongest part.
    """
    rig, skin = plan.rig, plan.rig.skin()
    if thing not in (*SIGNALS, *OBJECTS):
        return strongest_part(pressure_of(thing, settings), plan.duration)
    if thing in OBJECTS:
        with rig.touched_by(thing) as sensor:
            return pressure_of(record(sensor, 1.26), settings, 0.55, plan.duration)
    touch = probe_signal(thing, duration=plan.duration, rate=skin.rate, sensor=skin.model.grid, seed=rig.seed)
    with rig.sensor(skin, touch=touch, name=f"virtual:{thing}") as sensor:
        return pressure_of(record(sensor, plan.duration + 0.2), settings, 0.1, plan.duration)


def strongest_part(pressure: PressureFrames, duration: float) -> PressureFrames:
    """Part of the given duration in s with most power in 20 to 470 Hz; the whole pressure if it is not longer."""
    if pressure.frames <= round(duration * pressure.rate):
        return pressure
    return pressure.cut(strongest_begins(pressure, duration), duration)


def strongest_begins(pressure: PressureFrames, duration: float) -> float:
    """Start of the part that `strongest_part` selects, in s."""
    power = (in_band(pressure.pressure, pressure.rate, BAND) ** 2).sum(axis=(1, 2))
    return strongest_window(power, round(duration * pressure.rate)) / pressure.rate


def at_strength(original: PressureFrames, settings: Settings, plan: FidelityPlan) -> Settings:
    """Settings with the gain that gives the target the plan's strength."""
    target = target_amplitude(add_lead(original, required_lead(settings)), settings)
    focus = focus_amplitude(settings.target.grid, plan.rig.array, acoustics=settings.acoustics)
    return settings.but(gain=settings.target.gain * (plan.strength * focus / target.amplitude.max()) ** 2)


def iterated_loop(plan: FidelityPlan, settings: Settings, stage: Stage = no_progress) -> Loop:
    """Run a loop with iterative correction on the noise, with fewer points and without a guard."""
    settings = with_fewer_points(settings.but(guard=None), plan.points)
    original = original_of("noise", plan, settings)
    skin = plan.rig.skin()
    with OpenRig(array=plan.rig.array_device(skin), sensor=plan.rig.sensor(skin)) as rig:
        return loop(original, settings, rig, corrections=1, iterate=plan.passes, stage=stage)


def _row(thing: str, mode: str, budget: Budget) -> Row:
    skin, sensor, solved = budget.stage("silencer").so_far, budget.stage("sensor").so_far, budget.stage("solver")
    return {
        "signal": thing,
        "mode": mode,
        "strength": budget.strength,
        "sdr_on_skin_db": skin.distortion_ratio,
        "sdr_rerecorded_db": sensor.distortion_ratio,
        "sdr_all_cells_db": skin.overall_ratio,
        "images_db": skin.images,
        "spatial_correlation": skin.spatial_correlation,
        "leak": None if solved.leak is None else solved.leak.peak,
        "leak_typical": None if solved.leak is None else solved.leak.typical,
    }
