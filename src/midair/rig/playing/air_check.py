"""What is to be said of the air before a drive is played: that of the room, and that which it was solved for."""

from collections.abc import Callable
from dataclasses import dataclass

from midair.evaluate import error_at_temperature
from midair.model import AmplitudeFrames, Drive, Medium

FAR = 2.0
"""Degrees Celsius between room and drive from which on it is said what that costs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoomAir:
    """A line for whoever plays.

    Attributes
    ----------
    said : str
        The line.
    warns : bool
        Whether the drive may press otherwise than it was solved for.
    """

    said: str
    warns: bool


def room_air(
    drive: Drive,
    room: Medium | None,
    target: Callable[[], AmplitudeFrames | None],
    *,
    simulated: bool = False,
    frames: int = 64,
) -> RoomAir:
    """What the air of the room does to a drive.

    Parameters
    ----------
    drive : Drive
        To be played.
    room : Medium or None
        The air of the room; None where nobody stated it.
    target : callable
        Gives what the drive was solved for, or None where that is not known; asked only where it matters.
    simulated : bool
        Whether there is no room: a virtual array plays in the drive's own air unless another is stated.
    frames : int
        How many frames E is worked out for, evenly spread over those that play.
    """
    own = drive.acoustics.medium
    if room is None:
        if simulated:
            return RoomAir(said=f"air: {own}, the drive's own", warns=False)
        said = f"temperature of the room not stated: the drive was solved for {own}; --temperature states it"
        return RoomAir(said=said, warns=True)
    both = f"the room has {room}, the drive was solved for {own}"
    if abs(room.degrees - own.degrees) <= FAR:
        return RoomAir(said=f"air: {both}", warns=False)
    return RoomAir(said=f"air: {both}: {_cost(drive, room, target(), frames)}; solve it again for this air", warns=True)


def _cost(drive: Drive, room: Medium, target: AmplitudeFrames | None, frames: int) -> str:
    if target is None:
        return "what that costs its file cannot tell, since it has no target"
    here, own = (error_at_temperature(drive, target, each, frames=frames) for each in (room, drive.acoustics.medium))
    if not len(here):
        return "it is silent"
    return f"E {100 * here.mean():.1f} % instead of {100 * own.mean():.1f} %, the mean of {len(here)} frames"
