"""Poses in the frames of Ultraleap's tracking service, protocol version 6."""

from collections.abc import Mapping
from typing import Any, Literal

from midair.devices.trackers.tracker import RawPose

Side = Literal["any", "left", "right"]


class LeapFrames:
    """Follows one hand from frame to frame: the same one while it is seen, then the one that is seen longest.

    Positions are in mm with y up and z towards the person; poses are in m with y away from the person and z up.
    """

    def __init__(self, side: Side = "any") -> None:
        self._side, self._id = side, None

    def read(self, frame: Any) -> RawPose | str | None:
        """The pose in a frame; None without a hand, and a text that describes a malformed frame."""
        if not isinstance(frame, Mapping):
            return "JSON that is no frame"
        if "hands" not in frame:
            return None
        try:
            hands: list[Mapping[str, Any]] = [hand for hand in frame["hands"] if self._side in ("any", hand["type"])]
            if not hands:
                self._id = None
                return None
            hand = next((hand for hand in hands if hand["id"] == self._id), None)
            hand = hand or max(hands, key=lambda one: float(one.get("timeVisible", 0.0)))
            self._id = hand["id"]
            return RawPose(
                stamp=float(frame["timestamp"]) * 1e-6,
                values=[
                    *(1e-3 * value for value in _turned(hand["palmPosition"])),
                    *_turned(hand["palmNormal"]),
                    *_turned(hand["direction"]),
                ],
                confidence=float(hand.get("confidence", 1.0)),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as wrong:
            return f"a frame without a usable {str(wrong)[:60]}"


def _turned(vector: Any) -> tuple[float, float, float]:
    x, y, z = vector
    return float(x), -float(z), float(y)
