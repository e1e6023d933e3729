"""Trackers of the palm by name: ``leap:``, ``lsl:Palm``, ``osc:9000``, ``replay:hand.csv?latency_ms=20``."""

import os
import time
from collections.abc import Callable

import numpy as np
from pydantic import Field

from midair.devices import LeapFrames, RawPose, ReplaySource, Tracker, TrackerOptions
from midair.errors import BrokenFileError, InputError, UnknownDeviceError
from midair.files import json_of, load_palm_path, load_tracker, read_text
from midair.model import PalmPath, TrackerPlacement
from midair.registry import Registry
from midair.rig.names.sensor_names import checked_options, split_name

TRACKERS: Registry[type[TrackerOptions]] = Registry(
    "midair.trackers",
    {
        "leap": "midair.devices.trackers.leap:LeapTracker [leap]",
        "lsl": "midair.devices.trackers.lsl_poses:LslTracker [lsl]",
        "osc": "midair.devices.trackers.osc:OscTracker",
        "replay": "midair.rig.names.tracker_names:ReplayTracker",
    },
)
"""Kinds of trackers."""


class ReplayTracker(TrackerOptions):
    """Kind ``replay:FILE``: a file of poses; `latency_ms` delays them."""

    # A hand-made path may hold still.
    freeze: float = Field(0.0, ge=0)

    def source(self, place: str) -> ReplaySource:
        """Poses of a file: CSV, or a list of frames of Ultraleap's service in JSON."""
        palm = _leap_recording(place) if place.lower().endswith(".json") else load_palm_path(place)
        return ReplaySource(palm, latency=self.latency_ms * 1e-3)


def _leap_recording(path: str) -> PalmPath:
    """Poses of frames of the protocol version 6, as a list or under the key "frames"; time 0 is the first pose."""
    try:
        content = json_of(read_text(path, "a list of frames in JSON"))
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected a list of frames in JSON, got: {wrong}") from wrong
    reader = LeapFrames()
    read = [reader.read(frame) for frame in (content["frames"] if isinstance(content, dict) else content)]
    poses = [pose for pose in read if isinstance(pose, RawPose)]
    if not poses:
        raise BrokenFileError(f"{path}: expected frames with a hand, got none")
    rows = np.array([[pose.stamp - poses[0].stamp, *pose.values, pose.confidence] for pose in poses])
    try:
        return PalmPath.from_rows(rows)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def open_tracker(
    name: str,
    *,
    placement: TrackerPlacement | str | os.PathLike[str] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Tracker:
    """Open a tracker of the palm; close it, or leave its ``with`` block.

    UnknownDeviceError, InputError, MissingExtraError or DeviceError if the name is unknown, an option is invalid, a
    package is missing, or the tracker does not answer.

    Parameters
    ----------
    placement : TrackerPlacement or path, optional
        How the tracker lies relative to the array; by default their coordinates are the same.
    clock : callable
        Clock of all times, for simulations.
    """
    kind, place, stated = split_name(name)
    if kind not in TRACKERS:
        raise UnknownDeviceError(f"tracker: expected {', '.join(f'{each}:PLACE' for each in TRACKERS)}, got {name!r}")
    options = checked_options(name, TRACKERS[kind], stated)
    if placement is not None and not isinstance(placement, TrackerPlacement):
        placement = load_tracker(placement)
    source = options.source(place)
    if isinstance(source, ReplaySource):
        source.clock = clock
    tracker = Tracker(source, name=name, options=options, placement=placement, clock=clock)
    tracker.open()
    return tracker
