from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from midair.devices import ExposureChoices, check_exposure
from midair.errors import InputError
from midair.files import profile_named
from midair.model import ControlGrid, Drive, Provenance, Recording, TransducerArray
from midair.physics import Transducers, focus_amplitude, transfer_matrix
from midair.pipeline import (
    calibrated_pressure,
    compensate_envelope,
    reproduce,
    reproduce_stream,
    resample_pressure,
    target_amplitude,
    under_ears,
    weaker_settings,
)
from midair.settings import Settings, quiet_mode
from midair.solvers import QuietPalm, solve
from midair.targets import Circle

SMALL = TransducerArray.autd3(columns=1, rows=1)


def recording(frequency=100.0, rate=1000.0):
    time = np.arange(500) / rate
    samples = np.zeros((500, 4, 4))
    samples[:, 1, 2] = 30 * np.sin(2 * np.pi * frequency * time)
    return Recording(samples=samples, rate=rate, unit="Pa", provenance=Provenance(source="test"))


def test_the_stages_are_in_the_order_of_the_paper_and_progress_reaches_the_end():
    settings = Settings().but(iterations=3)
    pressure = calibrated_pressure(recording(), None, settings).cut(0.1, 0.02)
    seen = []
    made = reproduce(pressure, SMALL, settings, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (20, 20)
    stages = [step.stage for step in made.solution.drive.provenance.steps]
    assert stages == ["calibrate", "cut", "settings", "prepare", "solve"]
    assert made.target.frames == made.solution.drive.frames == 20
    assert made.strength() == pytest.approx(made.target.amplitude.max() / focus_amplitude(ControlGrid(), SMALL))


def test_another_rate_keeps_the_wave():
    pressure = resample_pressure(calibrated_pressure(recording(), None, Settings()), 2000.0)
    assert (pressure.rate, pressure.frames) == (2000, 1000)
    middle = pressure.pressure[300:700, 1, 2]
    time = np.arange(300, 700) / 2000
    np.testing.assert_allclose(middle, 30 * np.sin(2 * np.pi * 100 * time), atol=0.4)
    assert pressure.provenance.steps[-1].stage == "resample"


def played(**settings):
    """Provenance steps of a reproduction at 4 kHz."""
    settings = {"iterations": 1} | settings if "method" not in settings else settings
    chosen = Settings().but(rate=4000.0, grid=ControlGrid(rows=6, columns=6, pitch=11e-3), **settings)
    pressure = calibrated_pressure(recording(), None, chosen).cut(0.1, 0.01)
    made = reproduce(pressure, SMALL, chosen)
    assert made.target.frames == made.solution.drive.frames == 40
    assert made.solution.drive.rate == 4000
    return made.solution.drive.provenance.steps


def test_each_choice_adds_its_step_in_its_place():
    steps = played(mapping="slow-bias", decouple=True, precompensate=True, circle=Circle())
    begin = ["calibrate", "resample", "cut", "settings"]
    assert [step.stage for step in steps] == [*begin, "decouple", "prepare", "precompensate sound", "solve"]
    prepared = steps[5].settings
    assert prepared["mapping"] == "slow-bias"
    assert "not validated on people" in str(prepared["motion"])
    # Pressure is compensated before it is mapped.
    stages = [step.stage for step in played(precompensate=True, compensate="pressure")]
    assert stages == [*begin, "precompensate", "prepare", "solve"]


def test_with_a_slow_bias_sound_stays_positive_where_pressure_was_compensated():
    chosen = Settings().but(mapping="slow-bias", precompensate=True, compensate="pressure", decouple=True)
    pressure = calibrated_pressure(recording(), None, chosen)
    target = target_amplitude(pressure, chosen).amplitude[100:-100]
    peaks = target.max(axis=0)
    assert target.min() >= 0
    # nothing is cut: sound vanishes at the troughs only, a few frames of 300 that reach 3 % of the peak
    assert (target[:, peaks > 0.1 * peaks.max()] < 0.03 * peaks.max()).mean() < 0.1


def test_a_solution_too_large_for_memory_is_refused(monkeypatch):
    monkeypatch.setattr("midair.ram.available_memory", lambda: 50_000_000)
    settings = Settings().but(grid=ControlGrid(rows=64, columns=64))
    pressure = calibrated_pressure(recording(), None, settings).cut(0.1, 0.02)
    monkeypatch.setattr("midair.solvers.planes.transfer_matrix", None)  # which would be called, and is nothing
    wanted = r"0\.05 GB of free memory, got 15936 transducers x 4096 points, .* GB; use"
    for way in (reproduce, reproduce_stream):
        with pytest.raises(InputError, match=wanted):
            way(pressure, TransducerArray.autd3(columns=8, rows=8), settings)


@pytest.mark.long
def test_a_stated_strength_takes_the_place_of_the_gain():
    for mapping in ("half-wave", "slow-bias"):
        chosen = Settings().but(iterations=1, mapping=mapping, precompensate=True, strength=0.3, gain=7.0)
        pressure = calibrated_pressure(recording(), None, chosen).cut(0.1, 0.02)
        made = reproduce(pressure, SMALL, chosen)
        known = Settings.of(made.solution.drive.provenance).target
        again = Settings().but(iterations=1, mapping=mapping, precompensate=True, gain=known.gain)
        strengths = [made.strength(), known.strength]
        strengths += [reproduce(pressure, SMALL, each).strength() for each in (chosen.but(gain=1.0), again)]
        assert strengths == pytest.approx([0.3] * 4), mapping


def measured():
    """A unit with measured transducers, each with its own pole."""
    found = Transducers.varied(SMALL.count, seed=5, gain_spread=0.05, resonance_spread=50, quality_spread=0.05)
    return replace(SMALL, response=found.response, pole=found.pole)


def test_envelopes_of_a_nominal_array_are_predicted_on_request():
    """With a quiet palm, the correction also covers the points of the palm."""
    settings = Settings().but(rate=2000.0, mapping="slow-bias", method="fast", predict=True)
    settings = settings.but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3))
    pressure = resample_pressure(calibrated_pressure(recording(), None, settings).cut(0.1, 0.01), 2000.0)
    target = target_amplitude(pressure, settings)
    plain = solve(target, SMALL, method="fast", acoustics=settings.acoustics)
    corrected, quiet = (
        next(compensate_envelope(iter([plain]), target, SMALL, settings.but(quiet_palm=weight))).drive
        for weight in (0.0, 0.1)
    )
    G = transfer_matrix(QuietPalm().points(settings.target.grid), SMALL, acoustics=settings.acoustics)
    beside = [float((np.abs(drive.q @ G.T) ** 4).sum()) for drive in (corrected, quiet)]
    assert not np.array_equal(plain.drive.phase, corrected.phase)
    assert beside[1] < 0.5 * beside[0]
    unchanged = next(compensate_envelope(iter([plain]), target, SMALL, settings.but(predict=False)))
    assert unchanged is plain


def test_envelopes_of_a_measured_array_are_predicted():
    for mapping, foreseen in [("slow-bias", 1), ("half-wave", 0)]:
        settings = Settings().but(
            rate=2000.0, mapping=mapping, method="fast", grid=ControlGrid(rows=6, columns=6, pitch=11e-3)
        )
        pressure = resample_pressure(calibrated_pressure(recording(), None, settings).cut(0.1, 0.01), 2000.0)
        made = reproduce(pressure, measured(), settings).solution.drive
        plain = reproduce(pressure, replace(measured(), pole=np.zeros(0)), settings).solution.drive
        assert [step.stage for step in made.provenance.steps].count("foresee the array") == foreseen
        assert np.array_equal(made.phase, plain.phase) is not bool(foreseen)
        _, parts = reproduce_stream(pressure, measured(), settings)
        np.testing.assert_array_equal(np.concatenate([part.drive.phase for part in parts]), made.phase)


def quiet(limit, gain=1.0):
    """A reproduction by one unit under a level at the ears."""
    chosen = quiet_mode().but(ears=limit, gain=gain, grid=ControlGrid(rows=6, columns=6, pitch=11e-3))
    return reproduce(calibrated_pressure(recording(), None, chosen).cut(0.1, 0.01), SMALL, chosen).solution.drive


@pytest.mark.long
def test_a_drive_is_as_strong_as_the_level_at_the_ears_permits():
    drive = quiet(100.0)
    assert -1.5 < under_ears(drive, 100.0) <= 0
    fitted = Settings.of(drive.provenance)
    assert fitted.target.gain < 1
    assert fitted.target.ears == 100.0
    device = SimpleNamespace(name="units", array=SMALL, gated=True, steps_a_turn=256)
    admitted = check_exposure(drive, device, ExposureChoices(profile=profile_named("occupational-110").under(100.0)))
    assert admitted.outcome == "kept"
    # A gain that is low enough stays.
    weak = Settings.of(quiet(100.0, gain=0.1 * fitted.target.gain).provenance)
    assert weak.target.gain == pytest.approx(0.1 * fitted.target.gain)


def test_a_drive_above_its_level_is_solved_with_less_gain(monkeypatch):
    monkeypatch.setattr("midair.pipeline.under_ears", lambda drive, limit: 2.0)
    drive = Drive(phase=np.zeros((2, SMALL.count)), level=np.ones(2), rate=1000.0, array=SMALL)
    assert weaker_settings(drive, Settings().but(ears=110.0)).target.gain == pytest.approx(10**-0.21)
    assert weaker_settings(drive, Settings()) is None
    with pytest.raises(InputError, match=r"ears: expected a drive below 110 dB, got one 2\.0 dB above it"):
        played(ears=110.0, method="fast")
    with pytest.raises(InputError, match="ears: expected a faster method, got lm; use --mode quiet"):
        played(ears=110.0, method="lm")
