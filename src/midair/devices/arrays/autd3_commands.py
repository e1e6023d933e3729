"""Commands of AUTD3's firmware series 0.12 for playback; needs the extra `autd3`."""

from collections.abc import Iterator

import numpy as np
from autd3.commands import (
    ActivatePatternBank,
    ConfigPattern,
    FixedCompletionTime,
    FixedUpdateRate,
    Pattern,
    PhaseDepth,
    SetSilencer,
    WritePatternBuffer,
    WritePatternPhase,
)
from autd3.geometry import Autd3, Geometry
from autd3.params import BUFFER_SIZE_MIN, EMISSION_MAX_INDICES
from autd3.value import LoopBehavior, PatternBank, SamplingConfig, SysTime, TransitionMode
from autd3_core import Duration
from autd3_pattern import IntensityBuffer, PhaseBuffer

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.model import UNIT, Placement

Command = WritePatternPhase | WritePatternBuffer | ConfigPattern | ActivatePatternBank | Pattern | SetSilencer

FRAMES_MAX, FRAMES_MIN = EMISSION_MAX_INDICES, BUFFER_SIZE_MIN
TOGETHER = 5
"""Patterns of 8-bit phases per datagram."""

_BANKS = PatternBank.B0, PatternBank.B1


def geometry(placement: Placement) -> Geometry:
    """The units in the SDK's format, in mm."""
    places = zip(placement.origin * 1e3, placement.quaternion, strict=True)
    return Geometry(
        [Autd3(origin=origin.astype(np.float32), rotation=turn.astype(np.float32)) for origin, turn in places]
    )


def silencer(chosen: Silencer) -> SetSilencer:
    """Command for a silencer setting; "off" is a limit of a whole turn per tick, which the firmware never reaches."""
    if chosen.phase == 0:
        # The SDK's own command for "off" makes the emulator turn phases the long way round for a while.
        return SetSilencer(FixedUpdateRate(65535, 65535))
    # In strict mode the firmware would refuse drives whose frames are shorter than the completion time.
    spread = FixedCompletionTime(_duration(chosen.intensity), _duration(chosen.phase), strict_mode=False)
    return SetSilencer(spread)


def load(bank: int, phases: Bytes, intensity: Bytes, divider: int) -> list[Command]:
    """Commands that write patterns, followed by a silent one, to be played once."""
    units, count = phases.shape[1], len(phases)
    write = (
        _shared_intensity(bank, phases, intensity) if intensity.ndim == 1 else _own_intensity(bank, phases, intensity)
    )
    quiet = PhaseBuffer.from_array(np.zeros((units, UNIT), np.uint8))
    end = WritePatternPhase(_BANKS[bank], count, PhaseDepth.Bits8, 0, [quiet])
    config = ConfigPattern(_BANKS[bank], SamplingConfig(divider), count + 1, LoopBehavior.Once)
    return [*write, end, config]


def switch(bank: int, instant: int) -> ActivatePatternBank:
    """Command that plays a bank from an instant of device time on."""
    return ActivatePatternBank(_BANKS[bank], TransitionMode.SysTime(SysTime.from_nanos(instant)))


def silence(units: int, bank: int = 0) -> Pattern:
    """Command that plays a silent pattern at once, which overwrites a bank; it also cancels pending switches."""
    return Pattern(PhaseBuffer.from_array(np.zeros((units, UNIT), np.uint8)), 0, _BANKS[bank])


def _shared_intensity(bank: int, phases: Bytes, intensity: Bytes) -> Iterator[Command]:
    """Commands for frames with one intensity each; a datagram holds consecutive patterns of the same intensity."""
    edges = np.flatnonzero(np.diff(intensity)) + 1
    for run in np.split(np.arange(len(phases)), edges):
        for first in range(int(run[0]), int(run[-1]) + 1, TOGETHER):
            last = min(first + TOGETHER, int(run[-1]) + 1)
            patterns = [PhaseBuffer.from_array(frame) for frame in phases[first:last]]
            yield WritePatternPhase(_BANKS[bank], first, PhaseDepth.Bits8, int(intensity[first]), patterns)


def _own_intensity(bank: int, phases: Bytes, intensity: Bytes) -> Iterator[Command]:
    for index, (phase, strength) in enumerate(zip(phases, intensity, strict=True)):
        yield WritePatternBuffer(
            _BANKS[bank], index, PhaseBuffer.from_array(phase), IntensityBuffer.from_array(strength)
        )


def _duration(seconds: float) -> Duration:
    return Duration.from_nanos(round(seconds * 1e9))
