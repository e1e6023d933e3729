from dataclasses import fields, replace

import h5py
import numpy as np
import pytest
from tests.model.test_calibration import calibration as measured

from midair.errors import BrokenFileError, NonFiniteError, UnknownFormatError
from midair.files import (
    contents,
    load_array_calibration,
    load_calibration,
    open_take,
    save,
    save_array_calibration,
    save_calibration,
)
from midair.model import Provenance, TransducerArray


def same(one, other):
    for name in ("frequency", "response", "noise"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.sensor, one.unit, one.date) == (other.sensor, other.unit, other.date)
    assert one.provenance == other.provenance
    assert (one.version, one.identifier) == (other.version, other.identifier)
    for part in ("measurement", "crosstalk", "linearity"):
        same_part(getattr(one, part), getattr(other, part))


def same_part(one, other):
    assert type(one) is type(other)
    for field in fields(other) if other is not None else ():
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


@pytest.mark.parametrize("left_out", [(), ("measurement",), ("crosstalk", "linearity"), ("measurement", "linearity")])
def test_returns_what_was_saved_alone_or_with_a_recording(recording, calibration, tmp_path, left_out):
    part = replace(calibration, **dict.fromkeys(left_out))
    save_calibration(part, tmp_path / "a.calibration.h5")
    save(recording, tmp_path / "a.h5", calibration=part)
    for name in ("a.calibration.h5", "a.h5"):
        same(load_calibration(tmp_path / name), part)


def test_half_a_measurement_and_a_non_finite_uncertainty_are_refused(calibration, tmp_path):
    save_calibration(calibration, path := tmp_path / "a.calibration.h5")
    with h5py.File(path, "a") as file:
        file["phase_uncertainty"][0, 0, 0] = np.nan
    with pytest.raises(NonFiniteError, match=r"a\.calibration\.h5.*phase uncertainty"):
        load_calibration(path)
    with h5py.File(path, "a") as file:
        del file["coherence"]
    with pytest.raises(BrokenFileError, match="expected coherence beside"):
        load_calibration(path)


ARRAY = TransducerArray.autd3(columns=1, rows=1)


@pytest.fixture
def known():
    rng, count = np.random.default_rng(0), ARRAY.count
    parts = {f"{name}_uncertainty": rng.random(count) for name in ("strength", "phase", "resonance", "quality")}
    parts["pole"] = -5000 + 100 * rng.normal(size=count) + 1j * rng.normal(size=count)
    life = Provenance(source="bench", simulated=True).then("measure array", {"seconds": 8.0})
    return measured(ARRAY, **parts, level_uncertainty=0.02, date="2026-11-22", provenance=life)


def test_is_read_as_it_was_written_and_a_cut_file_is_refused(known, tmp_path):
    save_array_calibration(known, tmp_path / "a.array.h5")
    again = load_array_calibration(tmp_path / "a.array.h5")
    for name in ("response", "pole", "strength_uncertainty", "phase_uncertainty", "resonance_uncertainty", "dead"):
        np.testing.assert_array_equal(getattr(again, name), getattr(known, name))
    np.testing.assert_array_equal(again.quality_uncertainty, known.quality_uncertainty)
    assert again.array.same_as(ARRAY)
    assert (again.level_uncertainty, again.date, again.provenance) == (0.02, "2026-11-22", known.provenance)
    assert contents(tmp_path / "a.array.h5").kind == "array"
    path = tmp_path / "a.array.h5"
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(BrokenFileError):
        load_array_calibration(path)


def test_names_and_kinds_are_checked(known, tmp_path):
    with pytest.raises(UnknownFormatError, match=r"\.array\.h5"):
        save_array_calibration(known, tmp_path / "a.h5")
    save_array_calibration(known, tmp_path / "a.array.h5")
    with pytest.raises(UnknownFormatError, match="load_array_calibration"):
        open_take(tmp_path / "a.array.h5")
    (tmp_path / "a.array.h5").rename(tmp_path / "a.h5")
    with pytest.raises(BrokenFileError, match="midair array"):
        open_take(tmp_path / "a.h5")
