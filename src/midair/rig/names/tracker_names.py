"""Trackers of the palm by name: ``leap:``, ``lsl:Palm``, ``osc:9000``, ``replay:hand.csv?latency_ms=20``."""

import time
from collections.abc import Callable

from pydantic import Field

from midair.devices import ReplaySource, Tracker, TrackerOptions
from midair.errors import UnknownDeviceError
from midair.files import load_palm_path
from midair.model import TrackerPlacement
from midair.registry import Registry
from midair.rig.names.sensor_names import checked_options, split_name

TRACKERS: Registry[type[TrackerOptions]] = Registry(
    "midair.trackers", {"replay": "midair.rig.names.tracker_names:ReplayTracker"}
)
"""Kinds of trackers."""


class ReplayTracker(TrackerOptions):
    """Kind ``replay:FILE``: a file of poses; `latency_ms` delays them."""

    # A hand-made path may hold still.
    freeze: float = Field(0.0, ge=0)

    def source(self, place: str, clock: Callable[[], float]) -> ReplaySource:
        """Poses of a file."""
        return ReplaySource(load_palm_path(place), clock, latency=self.latency_ms * 1e-3)


def open_tracker(
    name: str, *, placement: TrackerPlacement | None = None, clock: Callable[[], float] = time.monotonic
) -> Tracker:
    """Open a tracker of the palm; close it, or leave its ``with`` block.

    Parameters
    ----------
    name : str
        Kind, place and options, such as ``replay:hand.csv?latency_ms=20``.
    placement : TrackerPlacement, optional
        How the tracker lies relative to the array; its coordinates are those of the array by default.
    clock : callable, optional
        Clock of all times, for simulations.

    Raises
    ------
    UnknownDeviceError, InputError, MissingExtraError, DeviceError
        If the name is unknown, an option is invalid, a package is missing, or the tracker does not answer.
    """
    kind, place, stated = split_name(name)
    if kind not in TRACKERS:
        raise UnknownDeviceError(f"tracker: expected {', '.join(f'{each}:PLACE' for each in TRACKERS)}, got {name!r}")
    options = checked_options(name, TRACKERS[kind], stated)
    tracker = Tracker(options.source(place, clock), name=name, options=options, placement=placement, clock=clock)
    tracker.open()
    return tracker
