"""Re-record a drive on the virtual rig, with the sensor and on a whole palm; pair a re-recording with its original."""

from dataclasses import dataclass, replace

from midair import evaluate
from midair.array_types import Array
from midair.calibration import known_noise
from midair.errors import InputError, MismatchError
from midair.evaluate import PalmFidelity, PalmPressure, apply_band_twice
from midair.files import OpenedTake
from midair.model import Acoustics, Drive, Palm, PressureFrames, Progress, Provenance, frames_without_lead
from midair.physics import PlaybackChain, middle_of, palm_matrix, simulate
from midair.pipeline import calibrated_pressure, resample_pressure
from midair.rig.correction.correction_loop import Loop
from midair.rig.correction.iteration import Stage, no_progress
from midair.rig.names.sensor_names import VirtualRig
from midair.rig.session import Played, Session
from midair.settings import Settings
from midair.targets import add_lead, decouple, interpolation_matrix, remove_lead
from midair.validation import checked_call


def palm_of_drive(
    asked: PressureFrames,
    drive: Drive,
    rig: VirtualRig,
    palm: Palm | None = None,
    *,
    chain: PlaybackChain | None = None,
    progress: Progress | None = None,
) -> PalmPressure:
    """Play a drive to a simulated palm (a disc of 85 mm) at the height of the rig.

    `asked` is the target pressure on the cells, from the drive's first frame; `chain` is the rig's if None.
    """
    palm = palm or Palm.disc()
    grid, skin, sensor = palm.grid(rig.height), palm.inside.ravel(), asked.sensor
    around = rig.acoustics or Acoustics(medium=drive.acoustics.medium)
    middle = middle_of(grid)
    G = palm_matrix(grid.position[skin], rig.array, reflection=rig.reflection, middle=middle, acoustics=around)
    rate, square = rig.skin().rate, (sensor.pitch / 2 * (sensor.columns + 1), sensor.pitch / 2 * (sensor.rows + 1))
    chain = chain or rig.array_device().chain
    came = simulate(drive, G, chain=chain, rate=rate, acoustics=around, progress=progress)
    # Many pressures give these readings of the cells; this is the interpolated one.
    cells = decouple(asked).pressure.reshape(asked.frames, -1)
    wanted = cells @ interpolation_matrix(sensor, grid)[skin].T
    return PalmPressure(wanted=wanted, delivered=came, rates=(asked.rate, rate), palm=palm, square=square)


def palm_of_loop(
    loop: Loop, rig: VirtualRig, palm: Palm | None = None, *, progress: Progress | None = None
) -> PalmFidelity:
    """Fidelity of a loop's last pass on a palm (by default a disc of 85 mm) on the virtual rig."""
    last, original = loop.passes[-1], loop.original
    lead = (last.asked.frames - original.frames) // 2 / original.rate
    found = palm_of_drive(add_lead(original, lead), last.reproduction.solution.drive, rig, palm, progress=progress)
    return found.fidelity(judged=(lead, original.frames / original.rate), band=loop.settings.calibration.band)


def rerecord_drive(drive: Drive, rig: VirtualRig, *, stage: Stage = no_progress) -> OpenedTake:
    """Play a drive on the virtual rig; the recording of its sensor begins with the first frame of the drive."""
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        recording = Session.on(array, sensor, None).rerecord(drive, progress=stage("play and re-record"))
        return OpenedTake(recording=recording, calibration=sensor.calibration)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlayedPair:
    """An original and its re-recording."""

    original: PressureFrames
    heard: PressureFrames
    """Re-recording, longer than the original at both ends where possible, so that a delay can be removed."""
    first: int = 0
    """Frame of `heard` at which the original begins."""
    noise: Array | None = None
    """Known rms noise of the sensor that re-recorded, in the band, in Pa, shape (row, column)."""

    @property
    def piece(self) -> PressureFrames:
        """Part of the re-recording at the original's frames, without removal of its delay."""
        end = self.first + self.original.frames
        return replace(self.heard, pressure=self.heard.pressure[self.first : end]) if self.first else self.heard


def aligned_pair(original: PressureFrames, take: OpenedTake, settings: Settings) -> PlayedPair:
    """Pair a re-recording with the part of the original that its provenance names; accepts lazy frames.

    The original of a played recording is filtered once more by the band, as a perfect rig would return it. A recording
    without a step "play" is compared directly.
    """
    provenance, calibration = take.recording.provenance, take.calibration
    if not provenance.last("play"):
        return PlayedPair(original=original, heard=calibrated_pressure(take.recording, calibration, settings))
    stages = [step.stage for step in provenance.steps]
    after = stages[len(stages) - stages[::-1].index("play") :]
    if edits := [stage for stage in ("cut", "trim", "join") if stage in after]:
        raise InputError(
            f"re-recording: expected it as it was played, got one after {' and '.join(edits)}; compare the whole one"
        )
    original, asked = original_of_drive(provenance, original)
    heard = _heard(take, settings)
    reference = remove_lead(apply_band_twice(asked), original.frames)
    noise = known_noise(calibration, settings.calibration.band)
    return PlayedPair(original=reference, heard=heard, first=(asked.frames - original.frames) // 2, noise=noise)


def rerecorded_pressure(take: OpenedTake, drive: Drive) -> PressureFrames:
    """Pressure of the re-recording of a drive, in the band and at the rate of the drive, without its lead."""
    heard = _heard(take, settings_of_rerecording(take.recording.provenance, Settings()))
    piece = frames_without_lead(drive.provenance, drive.frames, drive.rate)
    return replace(heard, pressure=heard.pressure[piece])


def _heard(take: OpenedTake, settings: Settings) -> PressureFrames:
    # A virtual sensor records the drive's first frame at time 0, and was at rest before.
    virtual = take.calibration is not None and take.calibration.provenance.simulated
    return calibrated_pressure(take.recording, take.calibration, settings, from_rest=virtual)


def original_of_drive(provenance: Provenance, original: PressureFrames) -> tuple[PressureFrames, PressureFrames]:
    """Part of an original that a drive's provenance names, without and with the lead of its solve."""
    cut, lead = provenance.last("cut"), provenance.last("lead").get("lead_s", 0.0)
    start, duration = cut.get("start_s"), cut.get("duration_s")
    known = original.provenance.last("cut") == cut
    if isinstance(start, int | float) and isinstance(duration, int | float) and not known:
        original = original.cut(float(start), float(duration))
    return original, add_lead(original, float(lead) if isinstance(lead, int | float) else 0.0)


def settings_of_rerecording(provenance: Provenance, settings: Settings) -> Settings:
    """Settings with the band and rate of the drive of a re-recording."""
    band, rate = provenance.last("calibrate").get("band_hz"), provenance.last("play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = settings.but(band=(low, high))
    return settings.but(rate=float(rate)) if isinstance(rate, int | float) else settings


_APART = 0.1
"""Difference of two durations in s up to which pressures are compared; a re-recording has a tail."""


@checked_call
def compare(
    original: PressureFrames | OpenedTake,
    reproduced: PressureFrames | OpenedTake | Played,
    *,
    fixed_place: bool = False,
) -> evaluate.Comparison:
    """Compare a reproduction with its original, as `midair compare` does.

    A re-recording is calibrated in the band and at the rate of its drive, and compared with the part of the original
    that the drive reproduces, without its lead; the original passes the band once more, as it would by a perfect rig.
    Pressures are compared as they are, see `evaluate.compare`.

    Parameters
    ----------
    original : PressureFrames or OpenedTake
        Pressure that the drive was made from, or its recording with calibration.
    reproduced : Played, OpenedTake or PressureFrames
        Result of `play`, a re-recording with its calibration, or a pressure.
    fixed_place : bool
        Count a shift and a turn of the pattern in the plane of the palm as distortion.

    Raises
    ------
    InputError
        If nothing was re-recorded, or the recording has no calibration.
    MismatchError
        If two pressures differ by more than a tenth of a second in duration, or by their cells.
    """
    if isinstance(reproduced, Played):
        if reproduced.take is None:
            raise InputError("reproduced: expected a re-recording, but nothing listened; open a rig with a sensor")
        reproduced = reproduced.take
    played = reproduced.recording.provenance if isinstance(reproduced, OpenedTake) else Provenance()
    settings = settings_of_rerecording(played, Settings())
    if isinstance(original, OpenedTake):
        original = calibrated_pressure(original.recording, original.calibration, settings)
    if not isinstance(reproduced, OpenedTake):
        found = evaluate.compare(original, reproduced, fixed_place=fixed_place)
        lasts = [each.frames / each.rate for each in (original, reproduced)]
        if abs(lasts[0] - lasts[1]) > _APART:
            expected = f"expected the original's {lasts[0]:g} s, got {lasts[1]:g} s"
            raise MismatchError(f"reproduced: {expected}; cut() both to the same part")
        return found
    pair = aligned_pair(resample_pressure(original, settings.target.rate), reproduced, settings)
    return evaluate.compare(pair.original, pair.heard, first=pair.first, noise=pair.noise, fixed_place=fixed_place)
