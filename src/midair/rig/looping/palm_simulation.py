"""What a drive does to a whole palm on the virtual rig: simulated beyond the square, in pressure and in skin."""

from dataclasses import replace

from midair.devices import choose_silencer
from midair.evaluate import PalmFidelity, palm_fidelity
from midair.model import Acoustics, Drive, Palm, PressureFrames, Progress
from midair.physics import PlaybackChain, simulate, transfer_matrix
from midair.rig.looping.correction_loop import Loop
from midair.rig.names import VirtualRig
from midair.targets import decouple, interpolation_matrix, led_in


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
    grid, sensor = palm.grid(rig.height), asked.sensor
    skin = palm.inside.ravel()
    around = rig.acoustics or Acoustics(medium=drive.acoustics.medium)
    G = transfer_matrix(grid.position[skin], rig.array, acoustics=around)
    rate = rig.skin().rate
    pressure = simulate(drive, G, chain=chain, rate=rate, acoustics=around, progress=progress)
    # Of all pressures, the interpolated one of which the cells would hear what they heard.
    cells = decouple(asked).pressure.reshape(asked.frames, -1)
    return palm_fidelity(
        cells @ interpolation_matrix(sensor, grid)[skin].T,
        pressure,
        palm,
        rates=(asked.rate, rate),
        square=((sensor.columns + 1) / 2 * sensor.pitch, (sensor.rows + 1) / 2 * sensor.pitch),
        judged=judged,
        band=band,
    )


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
