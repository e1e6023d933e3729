"""Interactive view of a loop."""

from dataclasses import replace

import numpy as np

from midair.rig.correction.loop_view import view_of_loop
from midair.targets import frames_without_lead


def test_the_view_has_recording_drive_and_rerecording(loop):
    shown = view_of_loop(loop)
    last = loop.passes[-1]
    made = last.reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    assert shown.frames == loop.original.frames == len(shown.sound.played) == len(shown.again.values)
    assert np.array_equal(shown.samples.values, loop.original.pressure.reshape(shown.frames, -1))
    assert np.array_equal(shown.again.values, last.felt.pressure[: shown.frames].reshape(shown.frames, -1))
    assert np.array_equal(shown.sound.wanted, made.target.amplitude[inside])
    assert np.array_equal(shown.sound.drive.phase, made.solution.drive.phase[inside])


def test_a_long_loop_shows_its_beginning(loop):
    shown = view_of_loop(loop, longest=20)
    assert (shown.frames, len(shown.sound.wanted), len(shown.again.values)) == (20, 20, 20)


def test_a_drive_of_other_frames_is_left_out(loop):
    shown = view_of_loop(replace(loop, original=loop.original.cut(0, 0.05)))
    assert shown.sound is None
    assert shown.frames == 50
