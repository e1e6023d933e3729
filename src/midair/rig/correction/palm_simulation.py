"""Simulate a drive on a whole palm with the virtual rig: pressure and skin displacement in and beside the sensor."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.devices import choose_silencer
from midair.evaluate import PalmFidelity, PalmFrames, palm_fidelity, palm_frames
from midair.model import BAND, Acoustics, Drive, Palm, PressureFrames, Progress, SensorGrid
from midair.physics import PlaybackChain, simulate, transfer_matrix
from midair.rig.correction.correction_loop import Loop
from midair.rig.names import VirtualRig
from midair.targets import add_lead, decouple, interpolation_matrix

Array = NDArray[np.float64]


def palm_of_drive(
    asked: PressureFrames,
    drive: Drive,
    palm: Palm,
    *,
    chain: PlaybackChain,
    rig: VirtualRig,
    judged: tuple[float, float] | None = None,
    band: tuple[float, float] = BAND,
    progress: Progress | None = None,
) -> PalmFidelity:
    """Play a drive to a simulated palm, and compare with the target pressure within the sensor's square.

    Parameters
    ----------
    asked : PressureFrames
        Target pressure on the cells, from the drive's first frame.
    palm : Palm
        Outline of the skin.
    chain : PlaybackChain
        Playback chain from drive to sound.
    rig : VirtualRig
        Array, sensor and air.
    judged : tuple of float, optional
        (start, duration) of the compared part in s; all if None.
    band : tuple of float
        (low, high) of the compared band in Hz.
    progress : callable, optional
        Called with (frames done, total frames).
    """
    wanted, pressure = _palm_pressure(asked, drive, palm, chain, rig, progress)
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
    band: tuple[float, float] = BAND,
    skin: str = "soft, deep",
) -> PalmFrames:
    """Simulate a drive on a palm frame by frame, for display; parameters as in `palm_of_drive`."""
    wanted, pressure = _palm_pressure(asked, drive, palm, chain, rig, None)
    rates, square = (asked.rate, rig.skin().rate), _square(asked.sensor)
    return palm_frames(wanted, pressure, palm, rates=rates, square=square, judged=judged, band=band, skin=skin)


def _square(sensor: SensorGrid) -> tuple[float, float]:
    """Half the sides of the sensor's area, along x and y, in m."""
    return (sensor.columns + 1) / 2 * sensor.pitch, (sensor.rows + 1) / 2 * sensor.pitch


def _palm_pressure(
    asked: PressureFrames, drive: Drive, palm: Palm, chain: PlaybackChain, rig: VirtualRig, progress: Progress | None
) -> tuple[Array, Array]:
    """Target and resulting pressure in Pa, at the points of the palm that are skin."""
    grid, skin = palm.grid(rig.height), palm.inside.ravel()
    around = rig.acoustics or Acoustics(medium=drive.acoustics.medium)
    G = transfer_matrix(grid.position[skin], rig.array, acoustics=around)
    came = simulate(drive, G, chain=chain, rate=rig.skin().rate, acoustics=around, progress=progress)
    # Of all pressures that give these readings of the cells, the interpolated one.
    cells = decouple(asked).pressure.reshape(asked.frames, -1)
    return cells @ interpolation_matrix(asked.sensor, grid)[skin].T, came


def played_chain(drive: Drive, rig: VirtualRig) -> PlaybackChain:
    """Playback chain of the rig's array for a drive, with the silencer that it would choose."""
    silencer = choose_silencer("auto", drive)
    return replace(rig.array_device().chain, phase_ramp=silencer.phase, level_ramp=silencer.intensity)


def palm_of_loop(
    loop: Loop, rig: VirtualRig, palm: Palm | None = None, *, progress: Progress | None = None
) -> PalmFidelity:
    """Fidelity of a loop's last pass on a palm (by default a disc of 85 mm) on the virtual rig."""
    last, original = loop.passes[-1], loop.original
    lead = (last.asked.frames - original.frames) // 2 / original.rate
    drive = last.reproduction.solution.drive
    return palm_of_drive(
        add_lead(original, lead),
        drive,
        palm or Palm.disc(),
        chain=played_chain(drive, rig),
        rig=rig,
        judged=(lead, original.frames / original.rate),
        band=loop.settings.calibration.band,
        progress=progress,
    )
