"""A drive on the virtual rig gives the same recording as a re-recording, and the same palm fidelity as a loop."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from midair.errors import MismatchError
from midair.evaluate import advance, compare
from midair.files import open_take, save
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Drive,
    Medium,
    Palm,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
)
from midair.physics import SKINS, PlaybackChain, Transducers, focus_amplitude, focus_phase
from midair.pipeline import calibrated_pressure, reproduce, required_lead
from midair.rig import Session, VirtualRig, aligned_pair, pressure_of, record, rerecord_drive
from midair.rig.correction.drive_rerecording import compare as compare_played
from midair.rig.correction.drive_rerecording import palm_of_drive
from midair.settings import Settings, paper_mode
from midair.solvers import solve
from midair.targets import add_lead, decouple, interpolation_matrix

SPOT = Palm.disc(50e-3)
SMALL = paper_mode().but(grid=ControlGrid(rows=4, columns=4, pitch=11e-3), method="glide")


@pytest.fixture(scope="module")
def made():
    rig = VirtualRig(seed=3)
    with rig.touched_by("sponge", duration=0.3) as sensor:
        original = calibrated_pressure(record(sensor, 0.3).recording, sensor.calibration, SMALL).cut(0.2, 0.06)
    asked = add_lead(original, required_lead(SMALL))
    return rig, original, asked, reproduce(asked, rig.array, SMALL).solution.drive


@pytest.mark.long
def test_the_recording_equals_that_of_play(made):
    rig, _, _, drive = made
    heard = rerecord_drive(drive, rig)
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        again = Session.on(array, sensor, None).rerecord(drive)
    np.testing.assert_array_equal(heard.recording.samples, again.samples)
    assert heard.recording.provenance.simulated
    assert heard.calibration is not None


@pytest.mark.long
def test_another_seed_is_another_array(made):
    _, original, asked, drive = made
    judged = (required_lead(SMALL), original.frames / original.rate)
    first, second = (
        palm_of_drive(asked, drive, VirtualRig(seed=seed), SPOT).fidelity(judged=judged) for seed in (3, 4)
    )
    assert first.pressure != second.pressure
    assert first.outside == pytest.approx(second.outside, abs=0.1)


RIG = VirtualRig()
PALM = Palm.disc(85e-3, pitch=5e-3)


def beating(place):
    """A focus at a place of the palm that swells at 100 Hz, for .1 s, and the same at the middle as the cells' wish."""
    phase = focus_phase(RIG.array, np.array([*place, 0.2]))
    swell = 0.5 + 0.25 * np.sin(2 * np.pi * 100 * np.arange(100) / 1000)
    drive = Drive(
        phase=np.tile(phase, (100, 1)),
        level=np.tile(np.sqrt(swell)[:, None], (1, RIG.array.count)),
        rate=1000.0,
        array=RIG.array,
        acoustics=Acoustics(),
    )
    asked = np.zeros((100, 4, 4))
    asked[:, 1:3, 1:3] = (swell - 0.5)[:, None, None]
    return PressureFrames(pressure=asked, rate=1000.0, sensor=SensorGrid()), drive


@pytest.mark.long
@pytest.mark.parametrize("beside", [False, True])
def test_a_focus_beside_the_square_presses_outside_and_moves_the_skin_otherwise(beside):
    asked, drive = beating((0.036, 0.0) if beside else (0.0, 0.0))
    found = palm_of_drive(asked, drive, RIG, PALM, chain=PlaybackChain()).fidelity(judged=(0.02, 0.06))
    # A focus is narrower than what cells make of one.
    assert found.outside > 0.9 if beside else found.outside < 0.01
    assert found.range[1] < -10 if beside else found.range[0] > -5


# The same figures by a second simulator, which shares no code with `midair.physics`: sound is added up source by
# source, envelopes are SciPy's filters, and skin is a slab whose waves are solved as equations of four unknowns.

POINT = Acoustics(medium=Medium(), directivity="point")
POINT_RIG = VirtualRig(acoustics=POINT)
FINE, STEPS, FRAMES = Palm.disc(85e-3, pitch=3e-3), 8, 220
JUDGED = slice(80 * STEPS, 140 * STEPS)
SIDE, FADE = 144, 60.0


@pytest.fixture(scope="module")
def played():
    """A drive for cells that swing at frequencies of their own, and their wish."""
    grid, time = ControlGrid(rows=8, columns=8, pitch=22e-3 / 3), np.arange(FRAMES) / 1000
    rng = np.random.default_rng(3)
    swing = np.sin(2 * np.pi * (time[:, None] * rng.uniform(40, 300, 16) + rng.uniform(0, 1, 16)))
    # All sound swells and fades: steps in it would make two filters differ.
    swell = np.hanning(FRAMES)
    cells = PressureFrames(pressure=(swell[:, None] * swing).reshape(-1, 4, 4), rate=1000.0)
    push = (1.2 + swing) @ interpolation_matrix(cells.sensor, grid).T
    peak = focus_amplitude(grid, POINT_RIG.array, acoustics=POINT)
    amplitude = 0.15 * peak * np.sqrt(push / push.max())
    target = AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=grid)
    drive = solve(target, POINT_RIG.array, method="fast", acoustics=POINT, quiet_palm=0.03).drive
    return cells, replace(drive, level=np.sqrt(swell) * drive.level)


def sound_on(points, drive):
    """Radiation pressure at each step, from 8-bit phases that are held and transducers that follow, alpha = 2."""
    medium, array = drive.acoustics.medium, drive.array
    away = np.linalg.norm(points[:, None] - array.position[None], axis=2)
    k = 2 * np.pi * array.frequency / medium.speed
    reach = array.pressure * np.exp((1j * k - medium.attenuation) * away) / away
    told = drive.level.reshape(FRAMES, -1) * np.exp(2j * np.pi * np.round(drive.phase / (2 * np.pi) * 256) / 256)
    told = np.repeat(np.broadcast_to(told, drive.phase.shape), STEPS, axis=0)
    fades = np.exp((-1 / POINT_RIG.dynamics.time_constant + 1j * POINT_RIG.dynamics.detuning) / (1000.0 * STEPS))
    q = lfilter([1 - fades], [1, -fades], told, axis=0)
    return np.abs(q @ reach.T) ** 2 / (medium.density * medium.speed**2)


def banded(x):
    return sosfiltfilt(butter(8, (20, 470), "bandpass", fs=1000 * STEPS, output="sos"), x, axis=0, padlen=300)


def moved_by(tissue, loads):
    """Displacements where the loads are, by waves on a periodic slab; a deep one is .3 m thick.

    Loads fade as exp(-FADE t), at a complex frequency, and what they move is lifted again: so that waves that come
    round from the slab's ends, 50 ms and more later, are faint.
    """
    side, frames = FINE.inside.shape[0], loads[0].shape[0]
    fade = np.exp(-FADE * np.arange(frames) / (1000.0 * STEPS))[:, None]
    wide = np.zeros((2, frames, side, side))
    wide[:, :, FINE.inside] = np.array(loads) * fade
    spectrum = np.fft.rfft(wide, 2 * frames, axis=1)
    frequency = np.fft.rfftfreq(2 * frames, 1 / (1000.0 * STEPS))
    ripple = 2 * np.pi * np.fft.fftfreq(SIDE, FINE.pitch)
    lengths, place = np.unique(np.round(np.hypot(*np.meshgrid(ripple, ripple)), 6), return_inverse=True)
    out = np.zeros_like(spectrum)
    for index in np.flatnonzero(frequency < 560):
        answer = np.zeros(len(lengths), complex)
        answer[1:] = slab(tissue, lengths[1:], 2 * np.pi * frequency[index] - 1j * FADE)
        whole = np.fft.fft2(spectrum[:, index], (SIDE, SIDE)) * answer[place.reshape(SIDE, SIDE)]
        out[:, index] = np.fft.ifft2(whole)[:, :side, :side]
    return np.fft.irfft(out, axis=1)[:, :frames, FINE.inside] / fade


def slab(tissue, k, omega):
    """Waves down and up of both kinds; no shear and unit pressure on top, no displacement below (volume stays)."""
    mu, h = tissue.stiffness + 1j * omega * tissue.viscosity, tissue.depth or 0.3
    b = np.sqrt(k**2 - tissue.density * omega**2 / mu + 0j)
    s, ea, eb, jk, one = k**2 + b**2, np.exp(-k * h), np.exp(-b * h), 1j * k, np.ones_like(k)
    matrix = [
        [-2 * jk * k, 2 * jk * k * ea, -s, -s * eb],
        [s, s * ea, -2 * jk * b, 2 * jk * b * eb],
        [jk * ea, jk * one, b * eb, -b],
        [-k * ea, k * one, jk * eb, jk * one],
    ]
    right = np.zeros((len(k), 4, 1), complex)
    right[:, 1] = -1 / mu
    waves = np.linalg.solve(np.moveaxis(np.array(matrix), 2, 0), right)[..., 0]
    return -k * waves[:, 0] + k * ea * waves[:, 1] + jk * (waves[:, 2] + eb * waves[:, 3])


def decibels(x, y):
    gain = (x * y).sum() / (x**2).sum()
    return 10 * np.log10(gain**2 * (x**2).sum() / ((y - gain * x) ** 2).sum())


@pytest.mark.long
def test_a_second_simulator_finds_the_same_within_a_decibel(played):
    cells, drive = played
    chain = PlaybackChain(transducers=Transducers.alike(POINT_RIG.array.count, POINT_RIG.dynamics))
    found = palm_of_drive(cells, drive, POINT_RIG, FINE, chain=chain).fidelity(judged=(0.08, 0.06))
    grid = FINE.grid(POINT_RIG.height)
    points = grid.position[FINE.inside.ravel()]
    came = banded(sound_on(points, drive))
    # What cells of 16 squares would hear of tents between them is their wish: the tents' heights.
    heights = decouple(cells).pressure.reshape(FRAMES, 16)
    tents = np.maximum(1 - np.abs(points[:, 0, None] - cells.sensor.x) / 11e-3, 0)
    across = np.maximum(1 - np.abs(points[:, 1, None] - cells.sensor.y) / 11e-3, 0)
    spread = (across[:, :, None] * tents[:, None, :]).reshape(len(points), 16)
    times = np.arange(FRAMES * STEPS) / STEPS
    ramp = np.sinc(times[:, None] - np.arange(FRAMES)) @ heights
    wanted = banded(ramp @ spread.T)
    # One delay for all: the one at which they are most alike.
    delays = range(0, 4 * STEPS)
    best = max(delays, key=lambda late: (wanted[JUDGED] * np.roll(came, -late, axis=0)[JUDGED]).sum())
    came = np.roll(came, -best, axis=0)
    beyond = (np.abs(points[:, :2]) > 27.5e-3).any(axis=1)
    power = (came[JUDGED] ** 2).sum(axis=0)
    outside = power[beyond].sum() / power.sum()
    assert 10 * np.log10(found.outside / outside) == pytest.approx(0, abs=1)
    assert found.pressure == pytest.approx(decibels(wanted[JUDGED], came[JUDGED]), abs=1)
    for name, tissue in SKINS.items():
        other = decibels(*moved_by(tissue, (wanted, came))[:, JUDGED])
        assert found.displacement[name] == pytest.approx(other, abs=1), name


def test_a_delay_of_a_perfect_chain_costs_nothing(tmp_path):
    """300 us of delay: cut out first and moved then, its ends would be lost."""
    rng, settings = np.random.default_rng(4), Settings().but(band=(20.0, 470.0))
    life = Provenance(source="bench")
    save(Recording(samples=rng.normal(0, 5, (300, 4, 4)), rate=1000.0, unit="Pa", provenance=life), tmp_path / "a.h5")
    original = pressure_of(tmp_path / "a.h5", settings)
    asked = add_lead(original, 0.1)
    for delay in (-0.0003, 0.0, 0.0003):
        played = life.then("lead", {"lead_s": 0.1}).then("play", {"rate_hz": 1000.0})
        heard = advance(np.asarray(asked.pressure), -delay, 1000.0)
        (again := tmp_path / "b.h5").unlink(missing_ok=True)
        save(Recording(samples=heard, rate=1000.0, unit="Pa", provenance=played), again)
        pair = aligned_pair(original, open_take(again), settings)
        assert pair.piece.frames == pair.original.frames == 300
        found = compare(pair.original, pair.heard, first=pair.first)
        assert abs(found.delay - delay) < 5e-5
        assert found.waveform_error < 0.002, delay


def test_pressures_of_other_durations_are_not_compared():
    long, short = (PressureFrames(pressure=np.ones((count, 4, 4)), rate=1000.0) for count in (400, 40))
    with pytest.raises(MismatchError, match=r"expected the original's 0\.4 s, got 0\.04 s; cut\(\) both"):
        compare_played(long, short)
