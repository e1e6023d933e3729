"""Flipped bits in finished files: each is reported or harmless, and repair keeps the rest."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from midair.errors import MidairError
from midair.files import (
    RecordingWriter,
    contents,
    load,
    load_calibration,
    load_pressure,
    load_solution,
    load_target,
    open_take,
    repair,
    save,
    save_calibration,
    save_pressure,
    save_solution,
)
from midair.model import Calibration, Event, PressureFrames, Provenance, Recording, SensorGrid

SENSOR = SensorGrid()
LONG = Provenance(source="bench").then("record", {"text": "x" * 6000})
"""HDF5 has no checksum of attributes of more than 4 kB."""


def recorded(path, frames=1000):
    """Samples of a recording that grew in `path`, with a calibration and an event."""
    samples = np.random.default_rng(3).normal(size=(frames, 4, 4))
    options = {"rate": 1000, "sensor": SENSOR, "unit": "V", "provenance": LONG}
    with RecordingWriter(path, **options, calibration=Calibration.flat(SENSOR)) as writer:
        writer.note([Event(kind="clipped", frame=3, frames=2, channel=1)])
        for first in range(0, frames, 70):
            writer.append(samples[first : first + 70])
    return samples


def flip(path, place, bit=6):
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def place_of(path, name, row=0):
    """Byte offset of a row of a dataset in chunks."""
    with h5py.File(path) as file:
        size = file[name].dtype.itemsize * int(np.prod(file[name].shape[1:]))
        chunk = file[name].id.get_chunk_info(row // file[name].chunks[0])
        return chunk.byte_offset + row % file[name].chunks[0] * size


@pytest.mark.long
@pytest.mark.parametrize(
    ("row", "first", "last", "streamed"), [(0, 0, 256, False), (300, 256, 512, True), (999, 768, 1000, False)]
)
def test_a_flipped_bit_in_a_recording_names_its_frames_and_repair_keeps_the_rest(row, first, last, streamed, tmp_path):
    path = tmp_path / "a.h5"
    samples = recorded(path)
    flip(path, place_of(path, "samples", row) + 7)
    with pytest.raises(MidairError) as caught:
        np.asarray(open_take(path, streamed=streamed).recording.samples)
    frames = f"frames {first} to {last - 1}"
    assert str(caught.value) == (
        f"{path}: samples: {frames} of all 16 channels are damaged, their checksum does not match; "
        "midair repair keeps the rest"
    )
    assert repair(path) == (
        f"{last - first} of 1000 frames were damaged in every channel, {frames}: they hold the last good frame and are "
        "listed as lost.",
    )
    take = open_take(path)
    right = samples.copy()
    right[first:last] = samples[first - 1 if first else last]
    np.testing.assert_array_equal(take.recording.samples, right)
    assert take.recording.provenance.steps[-1].settings["lost"] == ((first, last - first),)
    assert take.calibration is not None
    assert repair(path) == ()


def test_blocks_are_read_from_any_frame_to_any_other(tmp_path):
    path = tmp_path / "a.h5"
    samples = recorded(path, frames=1100)
    flip(path, place_of(path, "samples", 600))
    lazy = open_take(path, streamed=True).recording.samples
    for first, last in ((0, 1), (255, 257), (300, 512), (768, 1100), (1099, 1100)):
        np.testing.assert_array_equal(lazy.read(first, last), samples[first:last])
    for first, last in ((511, 513), (767, 800)):
        with pytest.raises(MidairError, match=r"samples: frames \d+ to \d+ of all 16"):
            lazy.read(first, last)


@pytest.mark.long
def test_other_damaged_parts_of_a_recording_are_left_out(tmp_path):
    path = tmp_path / "a.h5"
    samples = recorded(path)
    flip(path, place_of(path, "event_frame"))
    flip(path, place_of(path, "calibration/response_real"))
    for read in (load, load_calibration):
        with pytest.raises(MidairError, match="damaged, their checksum"):
            read(path)
    said = " ".join(repair(path))
    assert "The list of events was damaged and left out." in said
    assert "The calibration was damaged and left out" in said
    np.testing.assert_array_equal(load(path).samples, samples)
    assert load_calibration(path) is None
    save_pressure(PressureFrames(pressure=samples, rate=1000, sensor=SENSOR), path)
    flip(path, place_of(path, "pressure/pressure", 10))
    flip(path, place_of(path, "time", 500))
    with pytest.raises(MidairError, match="pressure: frames 0 to 511 of all 16 channels are damaged"):
        load_pressure(path)
    assert "The calibrated pressure was damaged" in " ".join(repair(path))
    np.testing.assert_array_equal(load(path).samples, samples)


def test_a_flipped_bit_in_a_drive_names_its_frames_and_repair_silences_them(solution, target, tmp_path):
    path = tmp_path / "a.drive.h5"
    drive, times = solution.drive, 20
    long = replace(drive, phase=np.tile(drive.phase, (times, 1)), level=np.tile(drive.level, times))
    values = {name: np.tile(getattr(solution, name), times) for name in ("error", "iterations")}
    wanted = replace(target, amplitude=np.tile(target.amplitude, (times, 1)))
    save_solution(replace(solution, drive=long, status=solution.status * times, **values), path, target=wanted)
    size = 64
    flip(path, place_of(path, "phase_change") + 700)
    said = f"phase_change: frames 0 to {size - 1} of all {drive.array.count} transducers are damaged.*midair repair"
    with pytest.raises(MidairError, match=said):
        load_solution(path)
    (note,) = repair(path)
    assert note == f"{size} of {long.frames} frames were damaged, frames 0 to {size - 1}: they are silent."
    again = load_solution(path)
    assert set(again.status[:size]) == {"silent"}
    assert not again.drive.level[:size].any()
    np.testing.assert_array_equal(again.drive.phase[size:], long.phase[size:])
    np.testing.assert_array_equal(again.drive.level[size:], long.level[size:])
    np.testing.assert_array_equal(load_target(path).amplitude, wanted.amplitude)
    flip(path, place_of(path, "transducer_position"))
    with pytest.raises(MidairError, match="expected an undamaged array, got damage in transducer_position"):
        repair(path)


def test_a_flipped_bit_in_a_calibration_names_the_frequencies(calibration, tmp_path):
    path = tmp_path / "a.calibration.h5"
    save_calibration(calibration, path)
    flip(path, place_of(path, "response_imag", 1))
    with pytest.raises(MidairError, match=r"response_imag: frequencies 0 to 2 of all 15 channels .* measure again"):
        load_calibration(path)
    with pytest.raises(MidairError, match="expected a recording or a drive, got a midair calibration"):
        repair(path)


def test_a_long_provenance_has_a_digest(tmp_path):
    path = tmp_path / "a.h5"
    samples = recorded(path)
    flip(path, path.read_bytes().index(b"x" * 5000) + 100, bit=0)
    with pytest.raises(MidairError, match="provenance: damaged or edited, its SHA-256 does not match"):
        load(path)
    assert repair(path) == ("The provenance was edited or damaged and is kept as it is.",)
    np.testing.assert_array_equal(load(path).samples, samples)


def test_a_recording_without_checksums_is_read_and_reported(tmp_path):
    path = tmp_path / "a.h5"
    samples = recorded(path)
    assert contents(path).checksums
    with h5py.File(path, "r+") as file:
        del file["checksums"], file.attrs["provenance_digest"]
    assert not contents(path).checksums
    np.testing.assert_array_equal(load(path).samples, samples)
    assert repair(path) == ()
    assert contents(path).checksums


def numbers_of(kind, path):
    """What midair reads from a file."""
    if kind == "drive":
        seen, wanted = load_solution(path), load_target(path)
        drive = (seen.drive.phase, seen.drive.level, seen.drive.array.position, seen.drive.rate, seen.drive.provenance)
        return (*drive, seen.error, seen.iterations, seen.status, wanted.amplitude, wanted.provenance)
    if kind == "calibration":
        seen = load_calibration(path)
        return seen.frequency, seen.response, seen.noise, seen.unit, seen.date, seen.provenance, seen.sensor
    take = open_take(path)
    seen = take.recording
    return seen.samples, seen.rate, seen.unit, seen.sensor, seen.provenance, take.journal, take.calibration is None


@pytest.mark.long
@pytest.mark.parametrize("kind", ["recording", "saved", "drive", "calibration"])
def test_no_flipped_bit_is_read_as_data(kind, recording, solution, target, calibration, tmp_path):
    """Twenty flips in the data and twenty anywhere in the file."""
    path = tmp_path / {"drive": "a.drive.h5", "calibration": "a.calibration.h5"}.get(kind, "a.h5")
    if kind == "recording":
        recorded(path)
    elif kind == "saved":
        save(Recording(samples=recording.samples, rate=1000, sensor=recording.sensor, provenance=LONG), path)
    elif kind == "drive":
        save_solution(solution, path, target=target)
    else:
        save_calibration(calibration, path)
    main = {"drive": "phase_change", "calibration": "response_real"}.get(kind, "samples")
    with h5py.File(path) as file:
        rows = file[main].shape[0]
        size = file[main].dtype.itemsize * int(np.prod(file[main].shape[1:]))
    right, whole = numbers_of(kind, path), path.read_bytes()
    rng = np.random.default_rng(31)
    places = [place_of(path, main, int(rng.integers(rows))) + int(rng.integers(size)) for _ in range(20)]
    places += [int(place) for place in rng.integers(len(whole), size=20)]
    reported = 0
    for place in places:
        path.write_bytes(whole)
        flip(path, place, bit=int(rng.integers(8)))
        try:
            seen = numbers_of(kind, path)
        except MidairError:
            reported += 1
            continue
        assert place not in places[:20]
        for one, other in zip(seen, right, strict=True):
            np.testing.assert_equal(one, other)
    assert reported >= 20
