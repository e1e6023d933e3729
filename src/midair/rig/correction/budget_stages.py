"""Error budget of one reproduction on the virtual rig: the stages are added one after the other."""

from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np

from midair.array_types import Array
from midair.calibration import known_noise
from midair.devices import SilencerChoice, silencer_named
from midair.evaluate import Budget, StageOutput, apply_band_twice, budget, leak
from midair.files import Laboratory
from midair.model import Acoustics, ArrayCalibration, Drive, Palm, PressureFrames, Recording, TransducerArray
from midair.physics import (
    PlaybackChain,
    calibration_of,
    cell_weights,
    middle_of,
    palm_matrix,
    radiation_pressure,
    sense,
    simulate,
)
from midair.pipeline import (
    Reproduction,
    calibrated_pressure,
    compensate_pressure,
    map_pressure,
    reproduce,
    with_fitted_gain,
)
from midair.rig.correction.drive_rerecording import palm_of_drive
from midair.rig.correction.iteration import Stage, no_progress
from midair.rig.correction.laboratory import laboratory_loss
from midair.rig.names.sensor_names import VirtualRig
from midair.settings import Settings
from midair.targets import add_lead, mapping_of


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetPlan:
    """Settings of an error budget."""

    settings: Settings
    rig: VirtualRig = field(default_factory=VirtualRig)
    """Array, sensor and air."""
    silencer: SilencerChoice = "off"
    """How the firmware spreads phase steps."""
    lead: float = 0.0
    """Fade-in before and fade-out after the original, in s; excluded from the comparison."""
    palm: Palm | None = None
    """Palm that is evaluated as well; only the sensor's cells if None."""
    measured: TransducerArray | None = None
    """Measured transducers of the rig, used by the solver; the model's if None."""
    laboratory: Laboratory | None = None
    """Uncertainties of a laboratory whose loss is computed as well."""
    calibration: ArrayCalibration | None = None
    """Measurement of `measured`, whose uncertainty remains in the laboratory."""
    seed: int = 0
    """Seed of the random laboratories."""
    fixed_place: bool = False
    """Whether a shift and a turn of the palm in its plane count as distortion."""


def error_budget(original: PressureFrames, plan: BudgetPlan, *, stage: Stage = no_progress) -> Budget:
    """Compute the loss of each stage of a reproduction.

    Each stage is added to those before it, and everything after it is ideal: targets and fields become pressure on the
    sensor's cells by the exact weights of the gel, and before the hold stage the pressure is band-limited between
    frames. Then follow frame hold, transducers with their own resonance and strength, silencer, and sensor with noise.

    `original` comes from `pressure_of`, `stage` is called with the name of each stage at its start, and returns its
    progress callback.
    """
    asked = add_lead(original, plan.lead)
    plan = replace(plan, settings=with_fitted_gain(asked, plan.measured or plan.rig.array, plan.settings))
    made = reproduce(asked, plan.measured or plan.rig.array, plan.settings, progress=stage("solve"))
    # With the lead: the compared part is cut out at the comparison, so that no stage sees an edge.
    outputs = list(stage_outputs(asked, made, plan, stage))
    part = (round(plan.lead * original.rate) / original.rate, original.frames / original.rate)
    band = plan.settings.calibration.band
    palm = None
    if plan.palm is not None:
        drive = made.solution.drive
        *_, (_, _, chain) = _chains(drive, plan)
        came = palm_of_drive(asked, drive, plan.rig, plan.palm, chain=chain, progress=stage("palm"))
        palm = came.fidelity(judged=part, band=band)
    found = budget(asked, outputs, strength=made.strength(), band=band, judged=part, palm=palm)
    if plan.laboratory is None:
        return found
    loss = laboratory_loss(
        asked,
        made.solution.drive,
        plan.laboratory,
        sensor=plan.rig.sensor_model,
        grid=plan.settings.target.grid,
        judged=part,
        band=band,
        measured=plan.calibration,
        seed=plan.seed,
        fixed_place=plan.fixed_place,
        progress=stage("laboratory"),
    )
    return replace(found, laboratory=loss)


def stage_outputs(asked: PressureFrames, made: Reproduction, plan: BudgetPlan, stage: Stage) -> Generator[StageOutput]:
    """The output of each stage for the pressure `asked`, each stage added to those before it."""
    settings, rig, drive = plan.settings, plan.rig, made.solution.drive
    compensated = compensate_pressure(asked, settings)
    decoupled = ["corrects the mixing of neighbouring cells by interpolation"] if settings.compensation.decouple else []
    louder = settings.compensation.precompensate and settings.compensation.compensate == "pressure"
    done = " and ".join([*decoupled, *(["compensates the attenuation by hold and transducers"] if louder else [])])
    if done:
        yield StageOutput(name="beforehand", what=f"{done}; later stages cancel this", pressure=compensated)
    to_push = mapping_of(settings.target.mapping, compensated.band)
    pushed = settings.target.gain * to_push(compensated.pressure, compensated.rate)
    yield StageOutput(
        name="mapping",
        what=f"makes signed pressure positive: {settings.target.mapping}",
        pressure=_simulated(replace(asked, pressure=pushed)),
    )
    skin = rig.skin()
    weights = cell_weights(rig.sensor_model, skin.points, between="waves")
    wanted, points = map_pressure(compensated, settings), settings.target.grid
    drawn = cell_weights(rig.sensor_model, points, centre=points.centre, between="lines")
    on_cells = radiation_pressure(wanted.amplitude, settings.acoustics.medium) @ drawn.T
    yield StageOutput(
        name="interpolation",
        what=f"spreads {asked.sensor.count} cells over the palm, interpolating {settings.target.interpolate}",
        pressure=_simulated(replace(asked, pressure=on_cells.reshape(asked.pressure.shape))),
    )
    outside = leak(drive, made.target.amplitude, settings.target.grid, acoustics=settings.acoustics)
    around = rig.acoustics or Acoustics(medium=drive.acoustics.medium)
    middle = middle_of(skin.points)
    G = palm_matrix(skin.points.position, rig.array, reflection=rig.reflection, middle=middle, acoustics=around)
    # Before the transducer stage, the transducers are those of the solver.
    believed = G * drive.array.response
    cells = on_cells
    for name, what, chain in _chains(drive, plan):
        way = believed if chain.transducers is None else G
        pressure = simulate(
            drive, way, chain=chain, rate=skin.rate, acoustics=around, weights=weights, progress=stage(name)
        )
        if chain.hold == "step":
            # A sample is the end of its interval; the first frame begins in silence.
            pressure = np.concatenate([np.zeros_like(pressure[:1]), pressure[:-1]])
        cells = pressure.reshape(-1, *asked.sensor.shape)
        played = _simulated(replace(asked, pressure=cells, rate=skin.rate))
        yield StageOutput(name=name, what=what, pressure=played, leak=outside if name == "solver" else None)
    yield StageOutput(
        name="sensor",
        what="records changes only, with noise, up to half its rate, and is calibrated",
        pressure=_simulated(_recorded(cells, asked, plan)),
        reference=apply_band_twice(asked),
        noise=known_noise(calibration_of(rig.sensor_model), plan.settings.calibration.band),
        tells_images=False,
    )


def _chains(drive: Drive, plan: BudgetPlan) -> Generator[tuple[str, str, PlaybackChain]]:
    full = plan.rig.array_device().chain
    ideal = PlaybackChain(phase_bits=None, hold="ideal")
    settings = plan.settings
    louder = settings.compensation.precompensate and settings.compensation.compensate == "sound"
    compensated = ", with compensation of the attenuation by hold and transducers" if louder else ""
    yield "solver", f"finds phases: {settings.solver.name}{compensated}", ideal
    bits = full.phase_bits
    yield "quantisation", f"phases of {bits} bits" if bits else "none", replace(ideal, phase_bits=bits)
    held = PlaybackChain(phase_bits=bits)
    yield "frame hold", f"holds each frame for {1e3 / drive.rate:g} ms", held
    moving = replace(held, transducers=full.transducers)
    yield "transducers", "respond with their own resonance, quality factor and strength", moving
    silencer = silencer_named(plan.silencer, drive.rate)
    spread = replace(moving, phase_ramp=silencer.phase, level_ramp=silencer.intensity)
    yield "silencer", f"spreads phase steps: {silencer}", spread


def _recorded(cells: Array, asked: PressureFrames, plan: BudgetPlan) -> PressureFrames:
    rig, settings = plan.rig, plan.settings
    model, over = rig.sensor_model, rig.steps
    whole = len(cells) // over * over
    volts = sense(model, cells[:whole], rig.rate, rng=np.random.default_rng(rig.seed), oversample=over)
    recording = Recording(samples=volts, rate=rig.rate, sensor=model.grid, provenance=asked.provenance)
    return calibrated_pressure(recording, calibration_of(model), settings, from_rest=True)


def _simulated(pressure: PressureFrames) -> PressureFrames:
    return replace(pressure, provenance=replace(pressure.provenance, simulated=True))
