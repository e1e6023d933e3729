"""Only checked drives play: the decisions of `check_exposure`, and the use of its clearances."""

import re
import tracemalloc
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tests.drives import Loud

from midair.devices import (
    ExposureChoices,
    ExposureStream,
    VirtualArray,
    amplitude_of,
    check_exposure,
    check_exposure_level,
    check_exposure_steered,
    felt_pressure_text,
    intensity_bytes,
    measure_exposure,
    phase_bytes,
)
from midair.devices.exposure_check import ExposureClearance, with_checked_reading
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError
from midair.files import profile_named
from midair.model import Acoustics, Drive, Medium, Provenance, TransducerArray
from midair.physics import PoseBox, airs_of_room, exposure, focus_phase, searches_of, sound_level, transfer_matrix
from midair.streaming import LazyFrames

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")
CHOICES = ExposureChoices(profile=PROFILE)
WEAKER = ExposureChoices(profile=PROFILE, attenuate=True)


def focus(level=1.0, frames=3, array=ARRAY):
    phase = np.tile(focus_phase(array, np.array([0, 0, 0.2])), (frames, 1))
    return Drive(phase=phase, level=np.full(frames, level), rate=1000.0, array=array, provenance=Provenance(source="t"))


def test_a_loud_drive_is_refused_with_level_and_place_and_passes_if_quiet_or_on_a_silent_device():
    with pytest.raises(ExposureError, match=r"14\d\.\d dB at the (left|right) ear, limit 110 dB"):
        check_exposure(focus(), Loud(ARRAY), CHOICES)
    drive = focus(level=0.01)
    clearance = check_exposure(drive, Loud(ARRAY), CHOICES)
    assert clearance.outcome == "kept"
    np.testing.assert_array_equal(clearance.drive.q, drive.q)
    assert check_exposure(focus(), VirtualArray(ARRAY), CHOICES).outcome == "exceeded"


@pytest.mark.long
def test_attenuation_keeps_the_profile_as_the_firmware_rounds_it():
    clearance = check_exposure(focus(), Loud(ARRAY), WEAKER)
    assert clearance.outcome == "attenuated"
    # So far down, one of the firmware's 255 steps is several decibels.
    assert -4.0 < clearance.exposure.excess <= 0
    assert clearance.drive.provenance.steps[-1].stage == "attenuate"
    made = amplitude_of(intensity_bytes(clearance.drive, 4))
    heard = Drive(phase=clearance.drive.phase, level=made, rate=1000.0, array=ARRAY)
    assert exposure(heard, PROFILE).excess <= 0


@pytest.mark.long
@pytest.mark.parametrize("own", [False, True], ids=["a level a frame", "a level each"])
def test_what_the_firmware_rounds_up_is_measured_as_it_sounds(own):
    """Half a step of 255 plays as a pulse of one step of 512: 9.9 dB louder than the level."""
    level = np.concatenate([[0.51 / 255, 3.51 / 255], np.linspace(0.001, 0.1, 40), [1.0]])
    phase = np.tile(focus_phase(ARRAY, np.array([0, 0, 0.2])), (len(level), 1))
    told = np.tile(level[:, None], (1, ARRAY.count)) if own else level
    drive = Drive(phase=phase, level=told, rate=1000.0, array=ARRAY)
    steps = intensity_bytes(drive, 4).reshape(len(level), -1)
    sounds = replace(drive, level=amplitude_of(steps) if own else amplitude_of(steps)[:, 0])
    found, heard = measure_exposure(drive, ARRAY, PROFILE).level, exposure(sounds, PROFILE).level
    assert (found > heard - 1e-3).all()
    assert found[0, 0] - exposure(drive, PROFILE).level[0, 0] > 9
    # What would be let through by its levels, and sounds above the limit.
    second = replace(drive, phase=phase[1:2], level=told[1:2])
    assert exposure(second, PROFILE).excess < 0
    with pytest.raises(ExposureError, match="too loud"):
        check_exposure(second, Loud(ARRAY), CHOICES)


def test_own_levels_are_measured_as_the_firmware_rounds_them():
    """Stated levels can cancel at an ear where the pulses do not; such a drive was measured 28 dB too low."""
    ear = np.array(PROFILE.places[0].position)
    # The level of the first group is played a sixth lower than stated.
    first = np.arange(ARRAY.count) % 20 < 9
    level = np.where(first, 7.49 / 255, 6 / 255)
    phase = focus_phase(ARRAY, ear) + np.pi * first
    drive = Drive(phase=phase[None], level=level[None], rate=1000.0, array=ARRAY)
    sounds = replace(drive, level=amplitude_of(intensity_bytes(drive, 4)).reshape(1, -1))
    airs = airs_of_room(None, PROFILE.places, ARRAY)
    expected = exposure(sounds, PROFILE, acoustics=airs, steps=256).level
    np.testing.assert_allclose(measure_exposure(drive, ARRAY, PROFILE).level, expected, atol=1e-3)


@pytest.mark.parametrize("steps", [256, 128])
def test_phases_are_measured_as_the_firmware_rounds_them(steps):
    """Errors of up to half a step, aligned for one place, reduce the stated level by 2 dB."""

    class Rounds(VirtualArray):
        steps_a_turn = steps

    rng, ear = np.random.default_rng(5), np.array(PROFILE.places[0].position)
    rounded = rng.integers(0, steps, (1, ARRAY.count)) * (2 * np.pi / steps)
    wave = transfer_matrix(ear[None], ARRAY)[0] * np.exp(1j * rounded[0])
    against = np.sign((np.conj(wave.sum()) * wave).imag)
    told = Drive(phase=rounded + against * 0.49 * (2 * np.pi / steps), level=np.ones(1), rate=1000.0, array=ARRAY)
    airs = airs_of_room(None, PROFILE.places, ARRAY)
    sounds = exposure(replace(told, phase=rounded), PROFILE, acoustics=airs).level
    for found in (
        measure_exposure(told, ARRAY, PROFILE, steps=steps).level,
        check_exposure(told, Rounds(ARRAY), CHOICES).exposure.level,
    ):
        assert found == pytest.approx(sounds, abs=2e-3)
    assert abs(exposure(told, PROFILE, acoustics=airs).level - sounds).max() > 0.02


def test_an_override_needs_a_name():
    clearance = check_exposure(focus(), Loud(ARRAY), ExposureChoices(profile=PROFILE, override=" A Person "))
    assert (clearance.outcome, clearance.by) == ("overridden", "A Person")
    with pytest.raises(InputError, match="name of the person"):
        ExposureChoices(profile=PROFILE, override="  ")


def test_an_override_applies_up_to_the_excess_that_was_checked():
    excess = measure_exposure(focus(), ARRAY, PROFILE).excess
    for more, outcome in ((0.1, "overridden"), (-0.1, None)):
        choices = ExposureChoices(profile=PROFILE, override="A Person", up_to=excess + more)
        if outcome:
            assert check_exposure(focus(), Loud(ARRAY), choices).outcome == outcome
            continue
        with pytest.raises(ExposureError, match=rf"expected at most {excess + more:.1f} dB .* A Person is responsible"):
            check_exposure(focus(), Loud(ARRAY), choices)


@pytest.mark.long
def test_the_source_strength_in_a_file_is_ignored():
    """A drive whose file states a transducer of a thousandth is measured, and refused, with the device's own."""
    claims = focus(array=replace(ARRAY, pressure=ARRAY.pressure / 1000))
    assert exposure(claims, PROFILE).excess < 0
    with pytest.raises(ExposureError):
        check_exposure(claims, Loud(ARRAY), CHOICES)
    clearance = check_exposure(claims, Loud(ARRAY), WEAKER)
    assert clearance.drive.array.pressure == ARRAY.pressure


@pytest.mark.long
@pytest.mark.parametrize("medium", [Medium(attenuation=100.0), Medium(speed=301.0)])
def test_the_air_of_a_file_changes_no_level(medium):
    """A drive whose file states an air that absorbs the sound, or scatters the focus, is refused as well."""
    claims = replace(focus(), acoustics=Acoustics(medium=medium))
    for check in (
        lambda: check_exposure(claims, Loud(ARRAY), CHOICES),
        lambda: ExposureStream(claims, Loud(ARRAY), CHOICES, frames=3),
    ):
        with pytest.raises(ExposureError):
            check()
    np.testing.assert_array_equal(
        measure_exposure(claims, ARRAY, PROFILE).level, measure_exposure(focus(), ARRAY, PROFILE).level
    )


@pytest.mark.parametrize("speed", [100.0, 299.0, 371.0])
def test_a_drive_for_no_air_of_a_room_is_refused_before_any_work(speed):
    claims = replace(focus(), acoustics=Acoustics(medium=Medium(speed=speed)))
    with pytest.raises(InputError, match=f"expected a speed of sound of 300 to 370 m/s.*got {speed:g} m/s"):
        check_exposure(claims, Loud(ARRAY), CHOICES)


def hiding(airs, air, point):
    """A drive that is loud at a point in one air, and quiet at the left ear's points in others."""
    points = searches_of(PROFILE.places, ARRAY, airs).each[0].points[::2]
    seen = np.concatenate([transfer_matrix(points, ARRAY, acoustics=each).astype(np.complex64) for each in airs])
    power = (seen.conj().T @ seen / len(points)).astype(np.complex128)
    power[np.diag_indices(ARRAY.count)] += 1e-3 * np.linalg.norm(power, 2)
    q = np.linalg.solve(power, transfer_matrix(point[None], ARRAY, acoustics=air)[0].conj())
    steps = np.rint(255 * np.abs(q) / np.abs(q).max()).astype(np.uint8)
    phase = np.rint(np.angle(q) * 128 / np.pi) * np.pi / 128
    return Drive(phase=phase[None], level=amplitude_of(steps)[None], rate=1000.0, array=ARRAY)


@pytest.mark.long
@pytest.mark.parametrize(
    "known", ["the paper's air", pytest.param("all airs that are measured", marks=pytest.mark.long)]
)
@pytest.mark.parametrize(
    "degrees", [20.0, pytest.param(25.0, marks=pytest.mark.long), pytest.param(29.0, marks=pytest.mark.long)]
)
def test_what_is_hidden_in_other_airs_is_measured_in_that_of_the_room(degrees, known):
    """In the paper's air alone, levels were up to 9.8 dB too low."""
    here, ear = Acoustics(medium=Medium.at(temperature=degrees)), PROFILE.places[0]
    room = Medium.at(temperature=degrees + 1.5)
    point = np.array(ear.position) + ear.reach * np.array([1, 1, 1])
    for stated in (None, room):
        airs = airs_of_room(stated, PROFILE.places, ARRAY) if known.startswith("all") else (Acoustics(),)
        drive = hiding(airs, here, point)
        true = sound_level(np.abs(drive.q @ transfer_matrix(point[None], ARRAY, acoustics=here)[0]))
        found = measure_exposure(drive, ARRAY, PROFILE, room=stated)
        assert found.level[0, 0] > true - 0.5
        if known.startswith("the"):
            assert exposure(drive, PROFILE, alone=True).level[0, 0] < true - 1


@pytest.mark.long
def test_the_loudest_air_is_named():
    ear, warm = np.array(PROFILE.places[0].position), Acoustics(medium=Medium.at(temperature=29.5))
    colder = (Acoustics(), Acoustics(medium=Medium.at(temperature=22.0)))
    found = measure_exposure(hiding(colder, warm, ear + np.array([0.04, -0.04, 0.04])), ARRAY, PROFILE)
    assert found.loudest_air.degrees == pytest.approx(29.5, abs=2.5)
    assert f"in air of {found.loudest_air.degrees:.0f} °C" in found.where
    stated = check_exposure(focus(), Loud(ARRAY), replace(WEAKER, room=Medium.at(temperature=22.0))).exposure
    assert [round(each.medium.degrees) for each in stated.airs][:: len(stated.airs) - 1] == [20, 24]
    assert stated.measured_in.startswith("20 to 24 °C")
    assert stated.air.shape == stated.level.shape


@pytest.mark.long
def test_a_clearance_is_for_the_device_that_was_measured():
    louder = Loud(replace(ARRAY, pressure=2 * ARRAY.pressure))
    other = Loud(TransducerArray.autd3(columns=1, rows=1))
    clearance = check_exposure(focus(level=0.01), Loud(ARRAY), CHOICES)
    for device in (louder, other):
        with device, pytest.raises(MismatchError, match="expected a drive that was checked for it"):
            device.play(clearance)
        assert not device.emitting
    with louder, pytest.raises(DeviceStateError, match="check it again"):
        louder.play(check_exposure(focus(), VirtualArray(louder.array), CHOICES))


def test_a_clearance_cannot_be_made_up_nor_its_drive_replaced():
    honest = check_exposure(focus(level=0.01), Loud(ARRAY), CHOICES)
    with pytest.raises(DeviceStateError, match="cannot be made up"):
        ExposureClearance(drive=focus(), array=ARRAY, exposure=honest.exposure, outcome="kept")
    with pytest.raises(DeviceStateError, match="cannot be made up"):
        replace(honest, drive=focus())


def piece(drive, first, last):
    return replace(drive, phase=drive.phase[first:last], level=drive.level[first:last])


def streamed(drive, ends, device=None, choices=CHOICES, **how):
    """The stream of a drive that comes in parts."""
    made, device = None, device or Loud(ARRAY)
    for first, last in zip([0, *ends[:-1]], ends, strict=True):
        if made is None:
            made = ExposureStream(piece(drive, first, last), device, choices, frames=drive.frames, **how)
        else:
            made.add(piece(drive, first, last))
    return made


@pytest.mark.long
@pytest.mark.parametrize("own", [False, True], ids=["a level a frame", "a level each"])
@pytest.mark.parametrize("repeats", [1, 3])
def test_a_stream_finds_what_the_check_of_the_whole_drive_finds(own, repeats):
    rng, frames = np.random.default_rng(1), 700
    phase = focus_phase(ARRAY, np.array([0, 0, 0.2])) + rng.normal(scale=0.5, size=(frames, ARRAY.count))
    level = rng.uniform(0, 0.01, (frames, ARRAY.count) if own else frames)
    drive = Drive(phase=phase, level=level, rate=1000.0, array=ARRAY)
    made = streamed(drive, [90, 350, 351, 700], repeats=repeats)
    found, whole = made.clearance(), check_exposure(drive, Loud(ARRAY), CHOICES, repeats=repeats)
    assert (found.outcome, found.repeats) == (whole.outcome, repeats)
    # Moments that cannot be the loudest of a part are not searched.
    np.testing.assert_allclose(found.exposure.peak, whole.exposure.peak, atol=0.02)
    np.testing.assert_allclose(found.exposure.duty, whole.exposure.duty, rtol=0.2 if own else 1e-9)
    assert found.exposure.warming == pytest.approx(whole.exposure.warming, rel=0.01)
    assert found.exposure.pressure == pytest.approx(whole.exposure.pressure, rel=0.02)
    np.testing.assert_array_equal(phase_bytes(found.drive, 4), phase_bytes(drive, 4))
    with Loud(ARRAY) as device:
        assert device.play(found).frames == repeats * frames


def test_only_the_checked_parts_of_a_stream_are_read():
    drive = replace(focus(frames=6), level=np.array([0.01, 0.01, 0.01, 0.01, 1.0, 0.9]))
    made = streamed(drive, [2, 4])
    cleared = made.clearance()
    assert cleared.drive.phase.read(0, 4).shape == (4, ARRAY.count)
    assert made.phase.there == 4
    with pytest.raises(ExposureError, match="limit 110 dB") as wrong:
        made.add(piece(drive, 4, 6))
    made.fail(wrong.value)
    with pytest.raises(ExposureError, match="limit 110 dB"):
        cleared.drive.phase.read(4, 6)
    assert cleared.later().drive.frames == 4


@pytest.mark.long
@pytest.mark.parametrize("repeats", [1, 40])
def test_heat_adds_up_over_the_parts_of_a_stream(repeats):
    """No part alone warms the palm too much, nor do all of them once; the whole check says the same."""
    profile = replace(PROFILE, places=tuple(replace(each, limit=170.0) for each in PROFILE.places))
    drive = replace(focus(frames=60), rate=10.0)
    once = check_exposure(drive, VirtualArray(ARRAY), replace(CHOICES, profile=profile)).exposure.warming
    limit = once * (0.9 if repeats == 1 else 1.1)
    choices = replace(CHOICES, profile=replace(profile, warming=limit))
    with pytest.raises(ExposureError, match="palm warms"):
        check_exposure(drive, Loud(ARRAY), choices, repeats=repeats)
    with pytest.raises(ExposureError, match="palm warms"):
        streamed(drive, [20, 40, 60], choices=choices, repeats=repeats)
    assert streamed(drive, [20, 40], choices=choices, repeats=repeats).clearance().outcome == "kept"


@pytest.mark.long
def test_own_levels_keep_the_profile_after_attenuation_and_rounding():
    """Two groups of transducers cancel at an ear, and do not after their levels are rounded down by one step."""
    ear = replace(PROFILE.places[0], reach=0.0)
    second = np.arange(ARRAY.count) % 9 < 4
    phase = focus_phase(ARRAY, np.array(ear.position)) + np.pi * second
    level = np.where(second, 8 / 255, 7 / 255)
    drive = Drive(phase=phase[None], level=level[None], rate=1000.0, array=ARRAY)
    before = measure_exposure(drive, ARRAY, replace(PROFILE, places=(ear,))).peak[0]
    profile = replace(PROFILE, places=(replace(ear, limit=before - 0.01),))
    weaker = replace(WEAKER, profile=profile)
    found = check_exposure(drive, Loud(ARRAY), weaker)
    assert found.exposure.excess <= 0


def test_parts_that_do_not_do_are_refused(subtests):
    for parts, choices, error, says in [
        ([focus(level=0.01), replace(focus(), rate=2000.0)], CHOICES, MismatchError, "all at 1000 Hz"),
        ([focus(array=TransducerArray.autd3(columns=1, rows=1))], CHOICES, MismatchError, "solve the target again"),
        ([focus()], CHOICES, ExposureError, "limit 110 dB"),
        ([focus()], WEAKER, InputError, "no attenuation"),
    ]:
        with subtests.test(says=says), pytest.raises(error, match=says):
            ExposureStream(parts[0], Loud(ARRAY), choices, frames=6).add(parts[-1])


@pytest.mark.long
def test_a_level_is_cleared_by_the_worst_case_of_phases():
    device = Loud(ARRAY)
    with pytest.raises(ExposureError, match="limit 110 dB"):
        check_exposure_level(0.1, device, CHOICES, rate=1000.0)
    clearance = check_exposure_level(0.1, device, WEAKER, rate=1000.0)
    assert 0 < clearance.level < 0.1
    assert clearance.exposure.excess == pytest.approx(0, abs=0.1)
    ear = np.array(PROFILE.places[0].position)
    at_the_ear = Drive(phase=focus_phase(ARRAY, ear)[None], level=np.full(1, clearance.level), rate=1e3, array=ARRAY)
    assert exposure(at_the_ear, PROFILE).excess <= 1e-6
    clearance.check_level(at_the_ear)
    with pytest.raises(ExposureError, match="expected a level of at most"):
        clearance.check_level(replace(at_the_ear, level=np.full(1, 2 * clearance.level)))


def test_levels_that_make_no_sense_are_refused():
    for level in (0.0, -0.1, 1.1, float("nan")):
        with pytest.raises(InputError, match="level"):
            check_exposure_level(level, Loud(ARRAY), CHOICES, rate=1000.0)


@pytest.mark.long
def test_the_pressure_left_after_attenuation_is_reported():
    clearance = check_exposure(focus(), Loud(ARRAY), WEAKER)
    assert clearance.exposure.pressure < 1
    told = r"nothing will be felt: 0\.\d+ of the 0\.57 Pa that one of 20 people feels"
    assert re.search(told, clearance.verdict())
    assert felt_pressure_text(exposure(focus(), PROFILE)) == ""
    kept = check_exposure(focus(level=0.01), Loud(ARRAY), CHOICES)
    assert "felt" not in kept.verdict()
    with pytest.raises(ExposureError, match=r"--attenuate plays it weaker \(-3\d\.\d dB, and nothing will be felt\)"):
        check_exposure(focus(), Loud(ARRAY), CHOICES)


def test_what_is_read_again_is_what_was_measured():
    frames = np.random.default_rng(0).uniform(0, 6, (9300, ARRAY.count))
    reel = LazyFrames(lambda first, last: frames[first:last].copy(), frames.shape)
    drive = with_checked_reading(Drive(phase=reel, level=np.full(9300, 0.02), rate=1000.0, array=ARRAY))
    np.testing.assert_array_equal(drive.phase, frames)
    np.testing.assert_array_equal(drive.phase.read(100, 700), frames[100:700])
    drive.phase.read(1100, 9300)  # the last 16 stretches are still in memory
    frames[600] = 0
    drive.phase.read(0, 512)
    with pytest.raises(ExposureError, match="512 to 1023 as they were checked, got others"):
        drive.phase.read(500, 700)


@pytest.mark.long
def test_what_is_kept_of_a_long_drive_is_its_levels_alone():
    """Four places per frame, twice while they are copied: 64 bytes per frame, in any air."""
    array = TransducerArray(position=np.array([[0, 0, 0], [0.01, 0, 0]]), normal=np.array([[0, 0, 1.0]] * 2))
    points = tuple(replace(place, reach=0.0, limit=170.0) for place in PROFILE.places)
    choices, frames = ExposureChoices(profile=replace(PROFILE, places=points, duty=1.0)), 160_000
    drive = Drive(
        phase=LazyFrames(lambda first, last: np.zeros((last - first, 2)), (frames, 2)),
        level=LazyFrames(lambda first, last: np.ones(last - first), (frames,)),
        rate=1000.0,
        array=array,
        acoustics=Acoustics(medium=Medium.at(temperature=22.0)),
    )
    check_exposure(drive, Loud(array), choices)
    tracemalloc.start()
    try:
        clearance = check_exposure(drive, Loud(array), choices)
        kept, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(clearance.exposure.level) == frames
    assert kept < 40 * frames
    assert most < 80 * frames


@pytest.mark.long
@pytest.mark.parametrize("choices", [CHOICES, WEAKER], ids=["as it is", "weaker"])
def test_a_drive_on_disk_is_cleared_as_one_in_memory(choices):
    whole = focus(level=0.01 if choices is CHOICES else 1.0, frames=300)
    reel = LazyFrames(lambda first, last: whole.phase[first:last], whole.phase.shape)
    one, other = (check_exposure(each, Loud(ARRAY), choices) for each in (whole, replace(whole, phase=reel)))
    assert one.outcome == other.outcome
    np.testing.assert_array_equal(one.exposure.level, other.exposure.level)
    np.testing.assert_array_equal(one.drive.phase, other.drive.phase)
    np.testing.assert_array_equal(one.drive.level, other.drive.level)


def test_heat_counts_repeats_and_a_minute_of_what_never_ends():
    """Whoever plays it: 1.6 s at full level, 60 times or for ever, are a duty of 1."""
    profile = replace(PROFILE, places=tuple(replace(each, limit=200.0, reach=0.0) for each in PROFILE.places))
    drive, choices = replace(focus(frames=2), rate=1.25), replace(CHOICES, profile=profile)
    how = {"box": PoseBox(), "solved": np.zeros(3), "samples": drive}
    for check in (check_exposure, partial(check_exposure_steered, **how)):
        assert check(drive, Loud(ARRAY), choices).exposure.duty.max() == pytest.approx(1.6 / 60)
        for long in ({"repeats": 60}, {"endless": True}, {"repeats": 2, "endless": True}):
            with pytest.raises(ExposureError, match="at 1 of full drive over a minute"):
                check(drive, Loud(ARRAY), choices, **long)
    assert check_exposure(drive, VirtualArray(ARRAY), choices, repeats=2, endless=True).repeats == 2


def test_steered_frames_stay_below_what_a_person_answered_for():
    """Frames of the same level that are loud at an ear: 8 dB above the excess that was signed."""
    drive, ear = focus(0.3), np.array(PROFILE.places[0].position)
    choices = replace(CHOICES, override="A Person")
    how = {"box": PoseBox(), "solved": np.zeros(3), "samples": drive}
    cleared = check_exposure_steered(drive, Loud(ARRAY), choices, **how)
    own = cleared.steered(drive, None)
    loud = cleared.steered(replace(drive, phase=np.tile(focus_phase(ARRAY, ear), (3, 1))), None)
    excess, alone = (measure_exposure(loud, ARRAY, PROFILE, alone=each).excess for each in (False, True))
    assert (own.level == drive.level).all()
    assert (loud.level < drive.level).all()
    assert cleared.exposure.excess - 0.5 < alone + cleared.louder <= cleared.exposure.excess
    assert excess <= cleared.exposure.excess


def test_the_end_of_a_drive_without_an_end_sounds_with_its_begin():
    """Also if it is longer than the minute that counts as heat: near transducers begin it, distant ones end it."""
    places = tuple(replace(each, reach=0.0) for each in PROFILE.places)
    ear = np.array(places[0].position)
    late = np.linalg.norm(ear - ARRAY.position, axis=1)
    near, level = late < np.median(late), np.zeros((64, ARRAY.count))
    level[0], level[-1] = 0.02 * near, 0.02 * ~near
    told = replace(focus(frames=64), phase=np.tile(focus_phase(ARRAY, ear), (64, 1)), level=level, rate=1.0)
    choices = ExposureChoices(profile=replace(PROFILE, places=places), override="A Person")
    once, endless = (
        check_exposure(told, Loud(ARRAY), choices, endless=each).exposure.peak[0] for each in (False, True)
    )
    assert endless > once + 3
