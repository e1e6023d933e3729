from dataclasses import replace

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import Drive, TransducerArray
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, envelope, radiate

ARRAY = TransducerArray(
    position=np.random.default_rng(9).uniform(-0.05, 0.05, (12, 3)) * [1, 1, 0], normal=np.tile([0, 0, 1.0], (12, 1))
)
SPREAD = {"gain": 0.9, "gain_spread": 0.1, "resonance_spread": 200.0, "quality_spread": 0.1}
VARIED = Transducers.varied(12, seed=1, **SPREAD)
STILL = Transducers.alike(12, TransducerDynamics(detuning=0.0))


def drive(frames=20, rate=1000.0, seed=0, largest=np.pi):
    rng = np.random.default_rng(seed)
    phase = np.cumsum(rng.uniform(-largest, largest, (frames, 12)), axis=0)
    return Drive(phase=phase, level=rng.uniform(0, 1, (frames, 12)), rate=rate, array=ARRAY)


def exact(**settings):
    return PlaybackChain(phase_bits=None, precision="double", **settings)


def test_transducers_that_are_alike_follow_the_envelope():
    told = drive()
    q = np.concatenate([some for some, _ in radiate(told, exact(transducers=Transducers.alike(12)), 7)])
    np.testing.assert_allclose(q, envelope(told.q, told.rate, 7, TransducerDynamics()), atol=1e-12)


@pytest.mark.parametrize("together", [1, 13, 4096])
def test_the_size_of_the_blocks_does_not_matter(together):
    chain = exact(transducers=VARIED, phase_ramp=0.4e-3, level_ramp=0.2e-3)
    parts = [q for q, _ in radiate(drive(), chain, 5, together=together)]
    whole = [q for q, _ in radiate(drive(), chain, 5)]
    assert len(parts) == {1: 20, 13: 10, 4096: 1}[together]
    np.testing.assert_allclose(np.concatenate(parts), np.concatenate(whole), atol=1e-12)


def ramped(told, chain, substeps):
    """The command at the end of each fine step while a silencer moves it, by the tick."""
    phase, level, out = told.phase[0].copy(), np.zeros(12), []
    for frame in range(told.frames):
        turn = np.angle(np.exp(1j * (told.phase[frame] - phase)))
        rise = told.level[frame] - level
        for k in range(1, substeps + 1):
            at = k / (told.rate * substeps)
            now = phase + turn * min(1.0, at / chain.phase_ramp)
            loud = level + rise * min(1.0, at / chain.level_ramp)
            out.append(loud * np.exp(1j * now))
        phase, level = now, loud
    return np.array(out)


@pytest.mark.parametrize(("phase_ramp", "level_ramp"), [(0.25e-3, 0.25e-3), (1e-3, 0.25e-3), (1.6e-3, 1.2e-3)])
def test_silencer_ramps_agree_with_a_tick_by_tick_loop(phase_ramp, level_ramp):
    """Ticks are 1/160 kHz: the silencer's own are 1/40 kHz. Longer ramps than a frame are cut short by the next."""
    told = drive(largest=2.0)
    chain = exact(transducers=VARIED, phase_ramp=phase_ramp, level_ramp=level_ramp)
    decay = np.exp(VARIED.pole / 160e3)
    q, fine = np.zeros(12, complex), []
    for command in ramped(told, chain, 160):
        settled = VARIED.response * command
        q = settled + (q - settled) * decay
        fine.append(q)
    found = np.concatenate([some for some, _ in radiate(told, chain, 16)])
    assert np.abs(found - np.array(fine)[9::10]).max() < 0.02


@pytest.mark.parametrize(
    ("step", "dip", "intensity"), [(np.pi / 4, 0.9239, 0.945), (np.pi / 2, 0.7071, 0.81), (np.pi, 0.0, 0.63)]
)
def test_one_phase_step_in_closed_form(step, dip, intensity):
    """|q| falls to cos(step / 2), mean intensity over the frame to .945, .81 and .63."""
    told = Drive(
        phase=np.concatenate([np.zeros((20, 12)), np.full((1, 12), step)]), level=np.ones(21), rate=1000.0, array=ARRAY
    )
    q = np.concatenate([some for some, _ in radiate(told, exact(transducers=STILL), 2000)])[-2000:, 0]
    assert np.abs(q).min() == pytest.approx(dip, abs=2e-3)
    assert np.mean(np.abs(q) ** 2) == pytest.approx(intensity, abs=0.01)


def test_a_silencer_takes_the_dip_away():
    """A half turn spread over 1 ms: never below a third, where the bare step goes through zero."""
    told = Drive(
        phase=np.repeat([0.0, 3.1, 3.1], [20, 1, 1])[:, None] * np.ones(12), level=np.ones(22), rate=1000.0, array=ARRAY
    )
    bare, spread = (
        np.abs(
            np.concatenate([q for q, _ in radiate(told, exact(transducers=STILL, phase_ramp=ramp), 100)])[2000:, 0]
        ).min()
        for ramp in (0.0, 1e-3)
    )
    assert bare < 0.05
    assert spread > 0.8


def test_a_ramp_goes_the_short_way_round():
    told = Drive(phase=np.array([[6.2] * 12, [0.1] * 12]), level=np.ones(2), rate=1000.0, array=ARRAY)
    q = np.concatenate([some for some, _ in radiate(told, exact(phase_ramp=1e-3), 10)])[10:, 0]
    np.testing.assert_allclose(
        np.unwrap(np.angle(q)), 6.2 - 2 * np.pi + (0.1 + 2 * np.pi - 6.2) * np.arange(1, 11) / 10
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"hold": "linear"}, "hold step or ideal"),
        ({"precision": "half"}, "single or double"),
        ({"phase_bits": 0}, "phase bits: expected 1 to 16"),
        ({"phase_ramp": -1.0}, "ramps: expected 0 s or more"),
        ({"hold": "ideal", "transducers": STILL}, "expected step with ramps or transducers"),
        ({"hold": "ideal", "phase_ramp": 1e-3}, "expected step with ramps or transducers"),
    ],
)
def test_chains_that_cannot_be_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        PlaybackChain(**settings)


def test_phases_are_rounded_and_held_for_the_frame():
    told = drive(frames=3)
    q = np.concatenate([some for some, _ in radiate(told, PlaybackChain(phase_bits=3, precision="double"), 4)])
    rounded = np.round(told.phase / (np.pi / 4)) * (np.pi / 4)
    np.testing.assert_allclose(q, np.repeat(told.level * np.exp(1j * rounded), 4, axis=0), atol=1e-12)


def test_a_drive_goes_on_from_where_the_last_one_stopped():
    chain = exact(transducers=VARIED, phase_ramp=0.4e-3, level_ramp=0.2e-3)
    told = drive(frames=6)
    before, after = (replace(told, phase=told.phase[part], level=told.level[part]) for part in (slice(4), slice(4, 6)))
    ((whole, _),) = radiate(told, chain, 5)
    ((_, moment),) = radiate(before, chain, 5)
    ((rest, _),) = radiate(after, chain, 5, start=moment)
    np.testing.assert_allclose(rest, whole[20:], atol=1e-12)
    ((cold, _),) = radiate(after, chain, 5)
    assert np.abs(cold - whole[20:]).max() > 0.1


def test_a_single_step_follows_the_exponential():
    told = Drive(phase=np.zeros((1, 12)), level=np.ones(1), rate=1000.0, array=ARRAY)
    ((q, _),) = radiate(told, exact(transducers=VARIED), 10)
    time = np.arange(1, 11)[:, None] / 10e3
    np.testing.assert_allclose(q, VARIED.response * (1 - np.exp(VARIED.pole * time)), rtol=1e-9)
