from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import NonFiniteError
from midair.files.native.provenance_json import from_json, to_json
from midair.model import Provenance, Recording, SensorGrid
from midair.recordings import Mending, edit, mend


def noise(frames=200, rate=1000.0, **says):
    samples = np.random.default_rng(frames).normal(size=(frames, 4, 4))
    life = Provenance(source="virtual:towel", simulated=True, notes={"object": "towel", "who": "me"}).then("record", {})
    return Recording(samples=samples, rate=rate, provenance=life, **says)


def test_a_fade_begins_and_ends_at_rest_and_keeps_the_middle():
    whole = noise(200)
    made = edit.fade(whole, 0.05, 0.02)
    rest = np.median(whole.samples, axis=0)
    samples = made.samples
    np.testing.assert_array_equal(samples[50:180], whole.samples[50:180])
    away = np.abs((samples - rest) / (whole.samples - rest)).reshape(200, -1)
    assert away[0].max() < 0.001
    assert (np.diff(away[:50], axis=0) > 0).all()
    assert away[24:26].mean() == pytest.approx(0.5, abs=0.02)
    assert away[-1].max() < 0.01
    assert made.provenance.steps[-1].settings == {"start_s": 0.05, "end_s": 0.02}
    np.testing.assert_array_equal(edit.fade(whole, 0, 0).samples, whole.samples)


@given(frames=st.integers(2, 60), place=st.floats(0.05, 0.95), rate=st.sampled_from([1000.0, 1000 / 3, 35.61, 7.0]))
def test_cut_and_join_again_give_the_same(frames, place, rate):
    whole = noise(frames, rate)
    middle = min(max(1, round(place * frames)), frames - 1) / rate
    parts = [edit.cut(whole, 0, middle), edit.cut(whole, middle)]
    again = edit.join(parts)
    np.testing.assert_array_equal(again.samples, whole.samples)
    assert (again.rate, again.sensor, again.unit) == (whole.rate, whole.sensor, whole.unit)
    assert again.provenance.steps[0] == whole.provenance.steps[0]
    assert (again.provenance.source, again.provenance.notes) == (whole.provenance.source, whole.provenance.notes)


def test_a_cut_of_a_cut_is_a_cut():
    whole = noise()
    np.testing.assert_array_equal(
        edit.cut(edit.cut(whole, 0.05, 0.15), 0.02, 0.06).samples, edit.cut(whole, 0.07, 0.11).samples
    )
    step = edit.cut(whole, 0.05, 0.15).provenance.steps[-1]
    assert (step.stage, dict(step.settings)) == ("cut", {"start_s": 0.05, "end_s": 0.15})


def test_join_keeps_common_steps_and_records_the_others_once():
    first, second = noise(100), edit.gain(noise(50), 2)
    other = Provenance(source="lsl:skin", notes={"object": "towel", "who": "you"})
    third = Recording(samples=np.ones((10, 4, 4)), rate=1000, provenance=other)
    joined = edit.join([first, second, third])
    assert joined.frames == 160
    life = joined.provenance
    assert life.source == "virtual:towel + lsl:skin"
    assert life.simulated
    assert life.notes == {"object": "towel"}
    parts = life.steps[-1].settings["parts"]
    assert [part[:2] for part in parts] == [("virtual:towel", 100), ("virtual:towel", 50), ("lsl:skin", 10)]
    assert parts[1][2] == (("record", ()), ("gain", (("factor", 2.0),)))
    assert from_json(to_json(life)) == life
    whole = noise()
    life = edit.join([edit.cut(whole, 0, 0.1), edit.cut(whole, 0.1)]).provenance
    assert [step.stage for step in life.steps] == ["record", "join"]
    assert life.steps[-1].settings["parts"][1][2] == (("cut", (("start_s", 0.1), ("end_s", 0.2))),)


def test_up_and_down_again_gives_the_band_back():
    """Tones within 94 % of half the lower rate come back to 0.2 %, away from the ends."""
    time = np.arange(2000) / 1000
    wave = np.sin(2 * np.pi * 40 * time) + np.cos(2 * np.pi * 251 * time) + np.sin(2 * np.pi * 460 * time)
    whole = Recording(samples=wave[:, None, None], rate=1000, sensor=SensorGrid(rows=1, columns=1))
    for rate in (4000.0, 2500.0, 48000.0, 1500.0):
        again = edit.resample(edit.resample(whole, rate), 1000)
        assert again.rate == 1000
        np.testing.assert_allclose(again.samples[300:1700], whole.samples[300:1700], atol=6e-3, err_msg=str(rate))


def test_resampling_states_the_exact_rate():
    """35.6118 Hz to 1000 Hz is not a small fraction: the rate is the requested one to a millionth, or the exact one."""
    made = edit.resample(noise(100, 35.6118143), 1000)
    assert abs(made.rate / 1000 - 1) < 1e-4
    assert made.provenance.steps[-1].settings == {"from_hz": 35.6118143, "to_hz": made.rate}
    assert made.duration == pytest.approx(100 / 35.6118143, abs=2 / 1000)


def test_trim_takes_the_ends_and_leaves_the_middle():
    samples = np.full((100, 4, 4), 0.3)
    samples[20, 1, 2] += 1
    samples[60, 3, 3] -= 2
    whole = Recording(samples=samples, rate=100)
    bare = edit.trim(whole, margin=0)
    np.testing.assert_array_equal(bare.samples, samples[20:61])
    assert bare.provenance.steps[-1].settings == {
        "start_s": 0.2, "end_s": 0.61, "level": pytest.approx(0.1), "margin_s": 0.0
    }  # fmt: skip
    assert edit.trim(whole, margin=0.05).frames == 51
    assert edit.trim(whole, margin=10).frames == 100
    assert edit.trim(whole, level=1.5, margin=0).frames == 1


def test_gain_of_all_or_of_each_channel():
    whole = noise()
    np.testing.assert_array_equal(edit.gain(edit.gain(whole, 4), 0.25).samples, whole.samples)
    factors = np.arange(16).reshape(4, 4) / 4
    made = edit.gain(whole, factors)
    np.testing.assert_array_equal(made.samples, whole.samples * factors)
    assert made.provenance.steps[-1].settings["factor"][1] == (1.0, 1.25, 1.5, 1.75)
    assert from_json(to_json(made.provenance)) == made.provenance


def test_mask_by_zero_or_by_the_neighbours():
    whole = noise()
    flat = whole.samples.reshape(200, 16)
    zero = edit.mask(whole, [5, 5, 0])
    np.testing.assert_array_equal(zero.samples.reshape(200, 16)[:, [0, 5]], 0)
    kept = [i for i in range(16) if i not in (0, 5)]
    np.testing.assert_array_equal(zero.samples.reshape(200, 16)[:, kept], flat[:, kept])
    assert zero.provenance.steps[-1].settings == {"channels": (0, 5), "fill": "zero"}
    made = edit.mask(whole, [5, 6], fill="neighbours").samples.reshape(200, 16)
    np.testing.assert_allclose(made[:, 5], flat[:, [1, 4, 9]].mean(axis=1))
    np.testing.assert_allclose(made[:, 6], flat[:, [2, 7, 10]].mean(axis=1))


def test_every_edit_adds_a_step_and_keeps_earlier_ones():
    whole = noise()
    made = [edit.cut(whole, 0.01), edit.join([whole, whole]), edit.resample(whole, 500), edit.trim(whole)]
    names = []
    for after in (each.provenance for each in [*made, edit.gain(whole, 2), edit.mask(whole, [1])]):
        names.append(after.steps[-1].stage)
        assert replace(after, steps=after.steps[:-1]) == whole.provenance, names[-1]
    assert names == ["cut", "join", "resample", "trim", "gain", "mask"]


TIME = np.arange(1500) / 1000
TOUCH = np.sin(2 * np.pi * 83.7 * TIME) + 0.5 * np.sin(2 * np.pi * 212 * TIME)
TOUCH += 0.05 * np.random.default_rng(0).standard_normal(1500)


def holed(frames, *, starts=(300, 700, 1100)):
    samples = np.stack([TOUCH, 3 + TOUCH], axis=1)
    for start in starts:
        samples[start : start + frames, 1] = np.nan
    return samples


def test_a_gap_follows_its_neighbourhood_and_the_rest_is_unchanged():
    for frames in (1, 5, 20):
        samples = holed(frames)
        missing = np.isnan(samples)
        filled = mend(samples, 1000, Mending()).samples
        np.testing.assert_array_equal(filled[~missing], samples[~missing])
        error = filled[missing] - (3 + TOUCH)[missing[:, 1]]
        # The noise alone, a twentieth, cannot be known.
        assert np.sqrt((error**2).mean()) < 0.15 * TOUCH.std(), frames


def test_a_line_is_a_line_ends_hold_the_nearest_number_and_silence_is_silent():
    samples = np.array([[0.0], [np.nan], [np.inf], [3.0], [-np.inf], [5.0]])
    np.testing.assert_allclose(mend(samples, 1000, Mending(fill="line")).samples.ravel(), np.arange(6.0))
    samples = TOUCH[:, None].copy()
    samples[:3] = samples[-2:] = np.nan
    filled = mend(samples, 1000, Mending()).samples.ravel()
    assert (filled[:3] == TOUCH[3]).all()
    assert (filled[-2:] == TOUCH[-3]).all()
    samples = np.zeros((200, 1))
    samples[100:105] = np.nan
    assert (mend(samples, 1000, Mending()).samples == 0).all()
    short = np.array([[1.0], [np.nan], [3.0]])
    assert mend(short, 1000, Mending()).samples[1, 0] == 2


def test_the_journal_has_each_gap_and_a_longer_one_is_refused_with_its_place():
    journal = mend(holed(4, starts=(700, 300)), 1000, Mending()).journal
    rows = [(row.kind, row.frame, row.frames, row.channel) for row in journal]
    assert rows == [("mended", 300, 4, 1), ("mended", 700, 4, 1)]
    assert mend(TOUCH[:, None], 1000, Mending()).journal == ()
    with pytest.raises(NonFiniteError, match=r"20 ms at most, got 21 frames \(21 ms\) from 0\.3 s on in channel 1"):
        mend(holed(21), 1000, Mending())
    assert np.isfinite(mend(holed(21), 1000, Mending(longest=21e-3)).samples).all()
