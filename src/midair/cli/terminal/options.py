"""Options that several commands share."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter

from midair.cli.terminal.quantities import quantity
from midair.flow import Settings
from midair.model import ControlGrid
from midair.physics import Directivity
from midair.solvers import Amplitudes, Guard
from midair.targets import Circle

Length = Annotated[float, quantity("m")]
Frequency = Annotated[float, quantity("Hz")]
Time = Annotated[float, quantity("s")]
Band = Annotated[tuple[float, float], quantity("Hz", many=2)]


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class BandOptions:
    """Which part of a recording counts.

    Parameters
    ----------
    band
        Lowest and highest frequency that is kept; the paper's microphones hear 20 to 470 Hz.
    rate
        Frames per second of what is played.
    inverse
        How the sensor's response is undone: by a zero-phase FFT, or by a linear-phase FIR filter.
    """

    band: Band = (20.0, 470.0)
    rate: Frequency = 1000.0
    inverse: Literal["fft", "fir"] = "fft"

    def settings(self) -> Settings:
        """The settings of the flow that these options mean."""
        return Settings(band=self.band, rate=self.rate, inverse=self.inverse)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class SolveOptions(BandOptions):
    """How pressure becomes sound.

    Parameters
    ----------
    height
        Of the palm above the array.
    pitch
        Between the control points.
    points
        Rows and columns of the control points.
    mapping
        From pressure of both signs to pressure that pushes: half-wave (the paper's), constant-offset or slow-bias.
    decouple
        Undo that a cell also feels what is played for its neighbours.
    precompensate
        Make louder beforehand what holding frames and the transducers' envelope make quieter.
    compensate
        Where: on the sound at all frequencies, or on the pressure within 20 to 480 Hz.
    circle
        Radius of a slow circle on which the pattern moves, for touch below 20 Hz; not validated on people.
    circle_rate
        Turns per second on that circle.
    interpolate
        Whether sound amplitude (as in the paper) or pressure is interpolated between the cells.
    gain
        Multiplies the pressure.
    directivity
        Of a transducer.
    method
        The solver; lm is the paper's Levenberg-Marquardt.
    iterations
        At most, for the first frame and for each later one; 50 and 20 in the paper.
    start
        Where a frame starts from: the frame before it, or zero.
    level
        Drive of all transducers, 0 to 1; auto takes what the loudest frame needs.
    amplitudes
        All transducers at that level (equal, as in the paper), or each at its own up to it (bounded).
    guard
        Width of a ring around the control points in which the field is kept quiet; none if not given.
    fit
        Whether the control points are met (as in the paper) or the sensor's cells.
    smooth
        Weight of the change of phase from frame to frame; 0.01 is much.
    backend
        What does the arithmetic of fast: numpy, torch, torch:cuda or cupy; numpy if not given.
    """

    height: Length = 0.2
    pitch: Length = 11e-3 / 3
    points: int = 16
    mapping: str = "half-wave"
    decouple: bool = False
    precompensate: bool = False
    compensate: Literal["sound", "pressure"] = "sound"
    circle: Annotated[float | None, quantity("m")] = None
    circle_rate: Frequency = 5.0
    interpolate: Literal["amplitude", "pressure"] = "amplitude"
    gain: float = 1.0
    directivity: Directivity = "t4010a1"
    method: str = "lm"
    iterations: tuple[int, int] | None = None
    start: Literal["previous", "zero"] = "previous"
    level: float | Literal["auto"] = 1.0
    amplitudes: Amplitudes = "equal"
    guard: Annotated[float | None, quantity("m")] = None
    fit: Literal["points", "cells"] = "points"
    smooth: float = 0.0
    backend: str | None = None

    def settings(self) -> Settings:
        """The settings of the flow that these options mean."""
        return Settings(
            band=self.band,
            rate=self.rate,
            inverse=self.inverse,
            mapping=self.mapping,
            decouple=self.decouple,
            precompensate=self.precompensate,
            compensate=self.compensate,
            circle=None if self.circle is None else Circle(radius=self.circle, frequency=self.circle_rate),
            interpolate=self.interpolate,
            gain=self.gain,
            grid=ControlGrid(rows=self.points, columns=self.points, pitch=self.pitch, height=self.height),
            directivity=self.directivity,
            method=self.method,
            iterations=self.iterations,
            start=self.start,
            level=self.level,
            amplitudes=self.amplitudes,
            guard=None if self.guard is None else Guard(margin=self.guard),
            fit=self.fit,
            smooth=self.smooth,
            backend=self.backend,
        )
