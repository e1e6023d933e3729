"""Uncalibrated samples of a sensor, and events during their recording."""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import UnitError
from midair.model.geometry import SensorGrid
from midair.model.provenance import Provenance
from midair.model.reprs import frames_and_duration, from_source, span, summary
from midair.validation import frozen_array, positive

Unit = Literal["V", "count", "Pa"]
"""Unit of a recording's samples."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Samples of a sensor grid."""

    samples: NDArray[np.float64]
    """Shape (frame, row, column), in `unit`."""
    rate: float
    """Frames per second, in Hz: frame i was sampled at i / rate."""
    sensor: SensorGrid = field(default_factory=SensorGrid)
    unit: Unit = "V"
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        axes = ("frame", self.sensor.rows, self.sensor.columns)
        object.__setattr__(self, "samples", frozen_array(self.samples, "samples", axes))
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))
        if self.unit not in get_args(Unit):
            raise UnitError(f"unit of the samples: expected one of {', '.join(get_args(Unit))}, got {self.unit!r}")

    def __repr__(self) -> str:
        return summary(
            self,
            frames_and_duration(self.frames, self.rate),
            self.sensor.spelled,
            span(self.samples, self.unit),
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.samples)

    @property
    def duration(self) -> float:
        """Number of frames divided by the rate, in s."""
        return self.frames / self.rate

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate


EventKind = Literal["lost", "clipped", "dead", "stuck", "rate", "clock", "trigger", "stroke", "mended", "late"]
"""lost: frames that did not arrive; the last good one was repeated. clipped, dead, stuck: faults of a channel. rate:
frames counted against this computer's clock. clock: the device's clock against this computer's. trigger: the frame that
started the recording. stroke: frames of a stroke of a motion stage. mended: missing frames of a channel that were
filled. late: frames of live touch that were not played in time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event in a recording."""

    kind: EventKind
    frame: int
    """First frame that it concerns, from 0."""
    frames: int = 0
    """Number of frames that it concerns."""
    channel: int = -1
    """Channel of the sensor; -1 for all."""
    ppm: float = 0.0
    """Deviation from this computer's clock (kinds rate and clock), in parts per million; positive if faster."""
