"""What a drive does to a whole palm on the virtual rig: simulated beyond the square, in pressure and in skin."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.devices import choose_silencer
from midair.evaluate import PalmFidelity, PalmFrames, palm_fidelity, palm_frames
from midair.model import Acoustics, Drive, Palm, PressureFrames, Progress, SensorGrid
from midair.physics import PlaybackChain, simulate, transfer_matrix
from midair.rig.correction.correction_loop import Loop
from midair.rig.names import VirtualRig
from midair.targets import decouple, interpolation_matrix, led_in

Array = NDArray[np.float64]


def palm_of_drive(
    asked: PressureFrames,
    drive: Drive,
    palm: Palm,
    *,
    chain: PlaybackChain,
    rig: VirtualRig,
    judged: tuple[float, float] | None = None,
    band: tuple[float, float] = (20.0, 470.0),
    progress: Progress | None = None,
) -> PalmFidelity:
    """Play a drive to a palm, and compare with the pressure that was asked for within the sensor's square.

    Parameters
    ----------
    asked : PressureFrames
        What the cells were to feel, from the drive's first frame on.
    drive : Drive
        What the array is told.
    palm : Palm
        Where skin is.
    chain : PlaybackChain
        What stands between drive and sound.
    rig : VirtualRig
        Array, sensor and air.
    judged : tuple of float, optional
        (begin, duration) of what is judged, in s; all if None.
    band : tuple of float
        (low, high) that counts, in Hz.
    progress : callable, optional
        Called with (frames done, frames in all).
    """
    wanted, pressure = _pressed(asked, drive, palm, chain, rig, progress)
    rates, square = (asked.rate, rig.skin().rate), _square(asked.sensor)
    return palm_fidelity(wanted, pressure, palm, rates=rates, square=square, judged=judged, band=band)


def palm_frames_of_drive(
    asked: PressureFrames,
    drive: Drive,
    palm: Palm,
    *,
    chain: PlaybackChain,
    rig: VirtualRig,
    judged: tuple[float, float] | None = None,
    band: tuple[float, float] = (20.0, 470.0),
    skin: str = "soft, deep",
) -> PalmFrames:
    """What a drive does to a palm moment by moment, to be looked at; parameters as in `palm_of_drive`."""
    wanted, pressure = _pressed(asked, drive, palm, chain, rig, None)
    rates, square = (asked.rate, rig.skin().rate), _square(asked.sensor)
    return palm_frames(wanted, pressure, palm, rates=rates, square=square, judged=judged, band=band, skin=skin)


def _square(sensor: SensorGrid) -> tuple[float, float]:
    """Half the sides of what a sensor covers, along x and y, in m."""
    return (sensor.columns + 1) / 2 * sensor.pitch, (sensor.rows + 1) / 2 * sensor.pitch


def _pressed(
    asked: PressureFrames, drive: Drive, palm: Palm, chain: PlaybackChain, rig: VirtualRig, progress: Progress | None
) -> tuple[Array, Array]:
    """Pressure that is wanted and that comes, at the points of the palm that are skin, in Pa."""
    grid, skin = palm.grid(rig.height), palm.inside.ravel()
    around = rig.acoustics or Acoustics(medium=drive.acoustics.medium)
    G = transfer_matrix(grid.position[skin], rig.array, acoustics=around)
    came = simulate(drive, G, chain=chain, rate=rig.skin().rate, acoustics=around, progress=progress)
    # Of all pressures, the interpolated one of which the cells would hear what they heard.
    cells = decouple(asked).pressure.reshape(asked.frames, -1)
    return cells @ interpolation_matrix(asked.sensor, grid)[skin].T, came


def played_chain(drive: Drive, rig: VirtualRig) -> PlaybackChain:
    """What stands between a drive and its sound on the rig's array, with the silencer that it would choose."""
    silencer = choose_silencer("auto", drive)
    return replace(rig.array_device().chain, phase_ramp=silencer.phase, level_ramp=silencer.intensity)


def palm_of_loop(
    loop: Loop, rig: VirtualRig, palm: Palm | None = None, *, progress: Progress | None = None
) -> PalmFidelity:
    """What a palm, a disc of 85 mm if None, gets of a loop's last pass on the virtual rig."""
    last, original = loop.passes[-1], loop.original
    lead = (last.asked.frames - original.frames) // 2 / original.rate
    drive = last.reproduction.solution.drive
    return palm_of_drive(
        led_in(original, lead),
        drive,
        palm or Palm.disc(),
        chain=played_chain(drive, rig),
        rig=rig,
        judged=(lead, original.frames / original.rate),
        band=loop.settings.calibration.band,
        progress=progress,
    )
