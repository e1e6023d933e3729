"""Compare the air of the room with the air that a drive was solved for, before it plays."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from midair.correct import correct_air
from midair.errors import InputError
from midair.evaluate import error_at_temperature
from midair.files import load_target
from midair.model import AmplitudeFrames, Drive, Medium

FAR = 2.0
"""Temperature difference in K between room and drive above which the error is computed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AirCheck:
    """Result of the comparison, as one line."""

    said: str
    """The line."""
    warns: bool
    """Whether the pressure may differ from that of the solved drive."""


def check_air(
    drive: Drive,
    room: Medium | None,
    target: Callable[[], AmplitudeFrames | None],
    *,
    simulated: bool = False,
    frames: int = 64,
) -> AirCheck:
    """Describe the effect of the room's air (None if unknown) on a drive; a virtual array plays in the drive's own air.

    `target` returns the target of the drive, or None, and is called only if E is needed; `frames` is the number of
    evenly spaced frames of which E is computed.
    """
    own = drive.acoustics.medium
    if room is None:
        unknown = f"room temperature unknown: the drive was solved for {own}; give it with --temperature"
        return AirCheck(said=f"air: {own}, the drive's own" if simulated else unknown, warns=not simulated)
    said = f"air: the room has {room}, the drive was solved for {own}"
    if far := abs(room.degrees - own.degrees) > FAR:
        said += f": {_error_text(drive, room, target(), frames)}; solve it again for this air"
    return AirCheck(said=said, warns=far)


def correct_air_of_file(drive: Drive, source: Path, room: Medium) -> Drive:
    """Correct the phases of the drive of a file around the centre of its control points; InputError without target."""
    target = load_target(source, streamed=True)
    if target is None:
        raise InputError(f"{source}: expected a drive with its target for --correct-air, got none; solve it again")
    return correct_air(drive, room, target.grid.position.mean(axis=0))


def _error_text(drive: Drive, room: Medium, target: AmplitudeFrames | None, frames: int) -> str:
    if target is None:
        return "the error cannot be computed, since the file has no target"
    here, own = (error_at_temperature(drive, target, each, frames=frames) for each in (room, drive.acoustics.medium))
    if not len(here):
        return "the drive is silent"
    return f"E {100 * here.mean():.1f} % instead of {100 * own.mean():.1f} %, the mean of {len(here)} frames"
