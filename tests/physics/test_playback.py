"""Playback simulation: against slow loops, closed forms, and finer steps."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import ControlGrid, Drive, Medium, TransducerArray
from midair.physics import (
    PlaybackChain,
    TransducerDynamics,
    Transducers,
    check_frame_rate,
    envelope,
    playback_response,
    radiate,
    radiation_pressure,
    simulate,
    transfer_matrix,
)

ARRAY = TransducerArray(
    position=np.random.default_rng(9).uniform(-0.05, 0.05, (12, 3)) * [1, 1, 0], normal=np.tile([0, 0, 1.0], (12, 1))
)
GRID = ControlGrid(rows=3, columns=3, pitch=11e-3)
G = transfer_matrix(GRID, ARRAY)
SPREAD = {"gain": 0.9, "gain_spread": 0.1, "resonance_spread": 200.0, "quality_spread": 0.1}
VARIED = Transducers.varied(12, seed=1, **SPREAD)


def drive(frames=20, rate=1000.0, seed=0, largest=np.pi):
    rng = np.random.default_rng(seed)
    phase = np.cumsum(rng.uniform(-largest, largest, (frames, 12)), axis=0)
    return Drive(phase=phase, level=rng.uniform(0, 1, (frames, 12)), rate=rate, array=ARRAY)


def exact(**settings):
    return PlaybackChain(phase_bits=None, precision="double", **settings)


def slow(told, chain, steps):
    """One transducer, one tick after another, by dq/dt = pole (q - s c) with c held for the tick; no ramps."""
    pressure = []
    q = np.zeros(12, complex)
    for frame in range(told.frames):
        for _ in range(steps):
            for n in range(12):
                settled = chain.transducers.response[n] * told.q[frame, n]
                q[n] = settled + (q[n] - settled) * np.exp(chain.transducers.pole[n] / (told.rate * steps))
            pressure.append(radiation_pressure(G @ q, Medium()))
    return np.array(pressure)


def test_agrees_with_the_slow_loop_also_in_single_precision_and_in_means_over_points():
    chain = exact(transducers=VARIED)
    np.testing.assert_allclose(simulate(drive(), G, chain=chain, rate=4000.0), slow(drive(), chain, 4), rtol=1e-9)
    fine = simulate(drive(), G, chain=exact(transducers=VARIED), rate=16000.0)
    coarse = simulate(drive(), G, chain=PlaybackChain(phase_bits=None, transducers=VARIED), rate=16000.0)
    assert 0 < np.abs(coarse - fine).max() < 1e-5 * fine.max()
    weights = np.random.default_rng(3).random((4, 9))
    points = simulate(drive(), G, chain=exact(transducers=VARIED), rate=4000.0)
    cells = simulate(drive(), G, chain=exact(transducers=VARIED), rate=4000.0, weights=weights)
    np.testing.assert_allclose(cells, points @ weights.T, rtol=1e-9)


def test_without_anything_in_between_it_is_the_field_of_each_frame_with_phases_rounded_as_the_firmware_does():
    told = drive()
    still = radiation_pressure(told.q @ G.T, Medium())
    np.testing.assert_allclose(simulate(told, G, chain=exact(), rate=2000.0), np.repeat(still, 2, axis=0), rtol=1e-9)
    ideal = simulate(told, G, chain=exact(hold="ideal"), rate=4000.0)
    np.testing.assert_allclose(ideal[::4][2:-2], np.maximum(still, 0)[2:-2], atol=2e-2 * still.max())
    told = drive()
    coarse = simulate(told, G, chain=PlaybackChain(phase_bits=2, precision="double"), rate=1000.0)
    quarter = np.round(told.phase / (np.pi / 2)) * (np.pi / 2)
    np.testing.assert_allclose(
        coarse, radiation_pressure((told.level * np.exp(1j * quarter)) @ G.T, Medium()), rtol=1e-9
    )


def test_a_small_modulation_agrees_with_the_response():
    """Level 0.5 (1 + .01 cos) makes pressure 1 + .02 cos; at 250 Hz that much of it is left, and that much later."""
    rate, f, dynamics = 2000.0, 250.0, TransducerDynamics()
    time = np.arange(400) / rate
    told = Drive(phase=np.zeros((400, 12)), level=0.5 + 0.005 * np.cos(2 * np.pi * f * time), rate=rate, array=ARRAY)
    pressure = simulate(told, G, chain=exact(transducers=Transducers.alike(12)), rate=64000.0)[6400:, 4]
    at = (np.arange(6400, 12800) + 1) / 64000.0
    found = 2 * np.mean(pressure * np.exp(-2j * np.pi * f * at)) / np.mean(pressure) / 0.02
    wanted = playback_response(np.array(f), rate, dynamics=dynamics)
    # averages of 32 samples a frame stand for the integral over the hold
    assert found == pytest.approx(complex(wanted), rel=0.01)


def test_the_response_of_ramps_is_that_of_their_steps_twice():
    f = np.array([0.0, 100.0, 470.0])
    still = TransducerDynamics(time_constant=1e-9, detuning=0.0)
    ramped = playback_response(f, 1000.0, dynamics=still, ramp=1e-3)
    np.testing.assert_allclose(np.abs(ramped), np.sinc(f / 1000) ** 2, rtol=1e-4)
    slow = playback_response(f, 1e9, dynamics=TransducerDynamics(detuning=0.0))
    np.testing.assert_allclose(np.abs(slow), 1 / np.sqrt(1 + (2 * np.pi * f * 188e-6) ** 2), rtol=1e-9)


def test_frames_last_whole_periods_of_the_ultrasound(subtests):
    for rate, periods in [(1000.0, 40), (2000.0, 20), (4000.0, 10), (8000.0, 5), (40e3, 1), (800.0, 50)]:
        with subtests.test(rate=rate):
            assert check_frame_rate(rate) == periods


STILL = Transducers.alike(12, TransducerDynamics(detuning=0.0))


def test_transducers_that_are_alike_follow_the_envelope():
    told = drive()
    q = np.concatenate([some for some, _ in radiate(told, exact(transducers=Transducers.alike(12)), 7)])
    np.testing.assert_allclose(q, envelope(told.q, told.rate, 7, TransducerDynamics()), atol=1e-12)


def test_neither_the_size_of_the_blocks_nor_where_a_drive_goes_on_matters(subtests):
    for together in [1, 13, 4096]:
        with subtests.test(together=together):
            chain = exact(transducers=VARIED, phase_ramp=0.4e-3, level_ramp=0.2e-3)
            parts = [q for q, _ in radiate(drive(), chain, 5, together=together)]
            whole = [q for q, _ in radiate(drive(), chain, 5)]
            assert len(parts) == {1: 20, 13: 10, 4096: 1}[together]
            np.testing.assert_allclose(np.concatenate(parts), np.concatenate(whole), atol=1e-12)
    chain = exact(transducers=VARIED, phase_ramp=0.4e-3, level_ramp=0.2e-3)
    told = drive(frames=6)
    before, after = (replace(told, phase=told.phase[part], level=told.level[part]) for part in (slice(4), slice(4, 6)))
    ((whole, _),) = radiate(told, chain, 5)
    ((_, moment),) = radiate(before, chain, 5)
    ((rest, _),) = radiate(after, chain, 5, start=moment)
    np.testing.assert_allclose(rest, whole[20:], atol=1e-12)
    ((cold, _),) = radiate(after, chain, 5)
    assert np.abs(cold - whole[20:]).max() > 0.1


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


def test_silencer_ramps_agree_with_a_tick_by_tick_loop(subtests):
    """Ticks are 1/160 kHz: the silencer's own are 1/40 kHz. Longer ramps than a frame are cut short by the next."""
    for phase_ramp, level_ramp in [(0.25e-3, 0.25e-3), (1e-3, 0.25e-3), (1.6e-3, 1.2e-3)]:
        with subtests.test(phase_ramp=phase_ramp):
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


def test_a_silencer_takes_the_dip_away_and_goes_the_short_way_round():
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
    told = Drive(phase=np.array([[6.2] * 12, [0.1] * 12]), level=np.ones(2), rate=1000.0, array=ARRAY)
    q = np.concatenate([some for some, _ in radiate(told, exact(phase_ramp=1e-3), 10)])[10:, 0]
    np.testing.assert_allclose(
        np.unwrap(np.angle(q)), 6.2 - 2 * np.pi + (0.1 + 2 * np.pi - 6.2) * np.arange(1, 11) / 10
    )
