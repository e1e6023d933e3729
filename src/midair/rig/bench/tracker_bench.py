"""Find how a tracker lies relative to an array, from a palm that is held where the array marks places by a focus."""

from collections.abc import Callable

import numpy as np

from midair.array_types import Array
from midair.calibration import fit_tracker
from midair.devices import ArrayDevice, ExposureChoices, Tracker, check_exposure
from midair.errors import DeviceError
from midair.model import Acoustics, Drive, Provenance, TrackerPlacement
from midair.physics import focus_amplitude, focus_phase, sound_amplitude
from midair.rig.playing import play_cleared

PLACES = np.array([[-0.05, -0.04, 0.18], [0.05, -0.04, 0.22], [0.05, 0.04, 0.18], [-0.05, 0.04, 0.22]])
"""Default places, in m."""
ROUND, ROUNDS, RATE, TONE = 2.0, 30, 1000.0, 200.0
"""Length of a focus in s, most repeats for a place, frame rate and modulation in Hz."""
STILL, STEADY = 2e-3, 20
"""Largest standard deviation in m, and least number of poses in the last second, of a palm that is held still."""


def calibrate_tracker(
    tracker: Tracker,
    array: ArrayDevice,
    places: Array = PLACES,
    *,
    top: float = 100.0,
    acoustics: Acoustics | None = None,
    exposure: ExposureChoices,
    say: Callable[[int], None],
    entered: Callable[[], bool] = lambda: False,
) -> TrackerPlacement:
    """Mark each place by a focus until the palm is held still there, and fit the placement.

    Devices are open, and the tracker in its own coordinates; `places` are in m, `top` is the highest pressure of the
    focus in Pa. `say` gets the index of a place before it is marked; `entered` returns whether the person confirmed the
    place since the last call, which accepts a palm that is not still.

    ExposureError if the focus exceeds the profile, DeviceError if the palm is not held still for a minute or the
    tracker sends nothing, InputError if the places are collinear or do not fit; `fit_tracker`.
    """
    held: list[Array] = []
    for at, place in enumerate(places):
        admission = check_exposure(_focus(array, place, top, acoustics or Acoustics()), array, exposure)
        say(at)
        said = tracker.clock()
        for _ in range(ROUNDS):
            play_cleared(admission, array, source="calibrate tracker")
            seen = tracker.poses(since=max(said, tracker.clock() - 1.0))
            if seen is None or len(seen.time) < STEADY:
                continue
            if entered() or seen.centre.std(axis=0).max() < STILL:
                held.append(np.median(seen.centre, axis=0))
                break
        else:
            state = tracker.status().state
            raise DeviceError(
                f"{tracker.name}: expected a palm held still at place {at + 1} within {ROUND * ROUNDS:.0f} s, got none "
                f"(the tracker is {state}); hold it where the focus is felt"
            )
    return fit_tracker(np.array(held), np.asarray(places, np.float64))


def _focus(array: ArrayDevice, place: Array, top: float, acoustics: Acoustics) -> Drive:
    """A focus whose pressure swings between 0 and `top`, as far as the array reaches it."""
    times = np.arange(round(ROUND * RATE)) / RATE
    reached = focus_amplitude(place[None], array.array, acoustics=acoustics)
    strongest = min(1.0, float(sound_amplitude(np.array(top), acoustics.medium)) / reached)
    phase = focus_phase(array.array, place, acoustics=acoustics)
    return Drive(
        phase=np.broadcast_to(phase, (len(times), array.array.count)),
        level=strongest * np.abs(np.sin(np.pi * TONE * times)),
        rate=RATE,
        array=array.array,
        acoustics=acoustics,
        provenance=Provenance(source="focus on a place"),
    )
