import io
from dataclasses import replace

import numpy as np
import pytest
import soundfile

from midair.datasets import stroke
from midair.errors import InputError
from midair.files import load_target, open_take, save, save_solution
from midair.model import ControlGrid, Provenance, Recording, TransducerArray
from midair.physics import propagate, quantise_phase
from midair.pipeline import calibrated_pressure, reproduce, required_lead
from midair.settings import MODES, Settings
from midair.studio.take_data import LOUDNESS, TakeData, describe_settings, facts, frames_of, sound_of
from midair.targets import add_lead
from midair.view import Kind, unpack


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A short stroke, solved with a lead, so that frames of take and drive do not have the same numbers."""
    folder = tmp_path_factory.mktemp("scene")
    touch = stroke("towel", rate=1000.0, duration=0.05)
    recording = Recording(
        samples=touch.pressure, rate=1000.0, sensor=touch.sensor, unit="Pa", provenance=Provenance(source="stroke")
    )
    save(recording, folder / "take.h5")
    settings = Settings().but(method="fast", mapping="slow-bias", level="auto")
    take = open_take(folder / "take.h5")
    pressure = add_lead(calibrated_pressure(take.recording, take.calibration, settings), required_lead(settings))
    made = reproduce(pressure, TransducerArray.autd3(columns=1, rows=1), settings)
    save_solution(made.solution, folder / "take.drive.h5", target=made.target)
    return TakeData(take=str(folder / "take.h5"), drive=str(folder / "take.drive.h5"), stamp="1"), made, recording


def stream(scene, name):
    [section] = unpack(frames_of((scene, name, 0)))
    return section, section.values * section.unit


def test_samples_are_those_of_the_file_minus_the_median(scene):
    scene, _, recording = scene
    section, values = stream(scene, "samples")
    rows = recording.samples.reshape(len(recording.samples), -1)
    assert section.first == 0
    assert np.abs(values - (rows - np.median(rows, axis=0))).max() <= section.unit


def test_target_and_played_field_match_the_frames_of_the_take(scene):
    scene, made, recording = scene
    lead = round(required_lead(made_settings := Settings.of(made.solution.drive.provenance)) * 1000)
    assert lead > 0
    assert made_settings.target.mapping == "slow-bias"
    section, wanted = stream(scene, "wanted")
    assert section.kind == Kind.FIELD
    assert len(wanted) == recording.frames
    kept = load_target(scene.drive).amplitude  # the file rounds it to 13 binary digits
    assert np.abs(wanted - kept[lead : lead + len(wanted)]).max() <= section.unit
    section, played = stream(scene, "played")
    field = played[:, ::2] + 1j * played[:, 1::2]
    # The file holds phases in 256 steps to a turn.
    drive = replace(made.solution.drive, phase=quantise_phase(made.solution.drive.phase, bits=8))
    exact = propagate(drive, made.target.grid, acoustics=drive.acoustics)[lead : lead + len(field)]
    assert np.abs(field - exact).max() <= 2 * section.unit + 2e-3 * np.abs(exact).max()


def test_phases_are_those_of_the_drive_in_256_steps(scene):
    scene, made, recording = scene
    section, phases = stream(scene, "phases")
    lead = (made.solution.drive.frames - recording.frames) // 2
    turned = phases - made.solution.drive.phase[lead : lead + len(phases)]
    assert np.abs(np.angle(np.exp(1j * turned))).max() <= np.pi / 256 + 1e-6
    assert section.values.dtype == np.uint8


def test_facts_have_all_properties_for_the_page(scene, tmp_path):
    scene, _, recording = scene
    said = facts(scene)
    assert (said["frames"], said["rate_hz"], said["unit"]) == (recording.frames, 1000.0, "Pa")
    assert said["drive"]["transducers"] == 249
    assert len(said["drive"]["error"]) == recording.frames
    assert len(said["drive"]["down"]) == 64 * 16
    assert said["drive"]["settings"]["mapping"] == "slow-bias"
    save(replace(recording, provenance=Provenance(source="other.wav")), tmp_path / "b.h5")
    beside = facts(TakeData(take=str(tmp_path / "b.h5"), drive=scene.drive, stamp="3"))
    others = [[line for line in each["report"] if "was made of another recording" in line] for each in (said, beside)]
    assert list(map(len, others)) == [0, 1]


def test_settings_are_described_as_options_and_python():
    for settings, options in [
        (MODES["best"](), "--mode best"),
        (MODES["paper"]().but(method="live", level="auto"), "--mode paper --method live --set solver.level=auto"),
        (MODES["quick"]().but(gain=1.5, decouple=False), "--mode quick --gain 1.5 --set compensation.decouple=false"),
        (MODES["best"]().but(guard=0.0, rate=2000.0), "--mode best --rate 2000Hz --set solver.guard=0.0"),
        (MODES["paper"]().but(grid=ControlGrid(height=0.18)), "--mode paper --height 180mm"),
        (MODES["paper"]().but(ramp=0.001), "--mode paper --set compensation.ramp=0.001"),
    ]:
        told = describe_settings(settings)
        assert told["options"] == options
        assert eval(told["python"], {"MODES": MODES, "Settings": Settings}) == settings
        assert f"{settings.solver.name}, {settings.target.rate:g} Hz" in told["line"]


def test_sound_is_the_sum_of_the_cells_at_one_level(scene, tmp_path):
    kept, time = tmp_path / "kept.npz", np.arange(1000) / 1000
    wave = np.sin(2 * np.pi * 100 * time)[:, None, None] * np.ones((1, 2, 2))
    np.savez(kept, rate=1000.0, original=7.0 + wave, again=0.01 * wave)
    data = TakeData(take=scene[0].take, comparison=str(kept))
    original, again = (soundfile.read(io.BytesIO(sound_of((data, stream)))) for stream in ("original", "again"))
    assert (original[1], len(original[0])) == (48000, 48000)
    np.testing.assert_allclose(original[0], again[0], atol=1e-4)
    assert original[0][5000:-5000].std() == pytest.approx(LOUDNESS, rel=0.01)
    with pytest.raises(InputError, match="play and compare it first"):
        sound_of((scene[0], "again"))


def test_unsolved_take_shows_its_future_target(scene):
    scene, _, recording = scene
    bare = TakeData(take=scene.take, stamp="2")
    _, wanted = stream(bare, "wanted")
    assert wanted.shape == (recording.frames, 256)
    assert facts(bare)["drive"] is None
    with pytest.raises(InputError, match="solve it first"):
        frames_of((bare, "played", 0))
    with pytest.raises(InputError, match="compare it first"):
        frames_of((bare, "again", 0))
    assert frames_of((bare, "samples", 5)) == b""
