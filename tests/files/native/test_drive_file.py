from dataclasses import replace

import h5py
import numpy as np
import pytest

from midair.devices import intensity_bytes, phase_bytes
from midair.errors import BrokenFileError, FileError, MismatchError, NonFiniteError
from midair.files import load_prediction, load_solution, load_target, save_solution, save_solutions, store_prediction
from midair.model import AmplitudeFrames, ControlGrid, Drive, Solution, TransducerArray
from midair.streaming import LazyFrames


@pytest.fixture
def path(solution, target, tmp_path):
    save_solution(solution, tmp_path / "towel.drive.h5", target=target)
    return tmp_path / "towel.drive.h5"


def test_returns_the_saved_drive_bit_by_bit_and_its_target(path, solution, target):
    again = load_solution(path)
    for name in ("phase", "level"):
        np.testing.assert_array_equal(getattr(again.drive, name), getattr(solution.drive, name))
    for name in ("position", "normal", "unit"):
        np.testing.assert_array_equal(getattr(again.drive.array, name), getattr(solution.drive.array, name))
    for name in ("pressure", "frequency", "name"):
        assert getattr(again.drive.array, name) == getattr(solution.drive.array, name)
    np.testing.assert_array_equal(again.error, solution.error)
    np.testing.assert_array_equal(again.iterations, solution.iterations)
    assert again.status == solution.status
    for name in ("rate", "acoustics", "provenance"):
        assert getattr(again.drive, name) == getattr(solution.drive, name)
    again = load_target(path)
    assert again is not None
    np.testing.assert_allclose(again.amplitude, target.amplitude, rtol=2**-13)
    assert (again.rate, again.grid, again.provenance) == (target.rate, target.grid, target.provenance)


def test_a_target_has_13_binary_digits_and_is_saved_again_unchanged(solution, target, tmp_path):
    exact = np.random.default_rng(0).lognormal(mean=5, sigma=2, size=target.amplitude.shape)
    exact[0, :3] = 0, 1, 1234.5
    first, again = tmp_path / "a.drive.h5", tmp_path / "b.drive.h5"
    save_solution(solution, first, target=replace(target, amplitude=exact))
    stored = load_target(first)
    np.testing.assert_allclose(stored.amplitude, exact, rtol=2**-13)
    assert stored.amplitude[0, :3].tolist() == [0, 1, 1234.5]
    save_solution(solution, again, target=stored)
    np.testing.assert_array_equal(load_target(again).amplitude, stored.amplitude)


def test_refuses_the_target_of_other_frames(solution, target, tmp_path):
    other = AmplitudeFrames(amplitude=target.amplitude[:3], rate=1000, grid=target.grid)
    with pytest.raises(MismatchError, match="expected 4 frames at 1000 Hz as in the drive, got 3"):
        save_solution(solution, tmp_path / "a.drive.h5", target=other)
    assert list(tmp_path.iterdir()) == []


def with_phases_in_radians(path, phase):
    """As for arrays other than AUTD3."""
    with h5py.File(path, "r+") as file:
        file.pop("phase_step", None), file.pop("phase", None)
        file["phase"] = phase
        file["phase"].attrs["units"] = "rad"


def test_reads_phases_in_radians_if_they_are_finite(path, solution):
    phase = solution.drive.phase + 1e-3
    with_phases_in_radians(path, phase)
    for streamed in (False, True):
        np.testing.assert_array_equal(load_solution(path, streamed=streamed).drive.phase, phase)
    phase[2, 3] = np.nan
    with_phases_in_radians(path, phase)
    with pytest.raises(NonFiniteError, match=r"towel\.drive\.h5: phase: expected finite numbers, got nan at \(2, 3\)"):
        load_solution(path)
    with pytest.raises(NonFiniteError, match=r"got nan at \(2, 3\)"):
        load_solution(path, streamed=True).drive.phase.read(1, 4)


def test_a_stored_drive_is_what_the_units_play(tmp_path):
    """Any phases and levels: the bytes on the wire are those of the drive before it was stored."""
    rng, array = np.random.default_rng(1), TransducerArray.autd3(columns=1, rows=1)
    phase = np.cumsum(rng.normal(0, 0.1, (500, array.count)), axis=0) - 3
    level = np.clip(np.cumsum(rng.normal(0, 0.01, phase.shape), axis=0) + 0.5, 0, 1)
    drive = Drive(phase=phase, level=level, rate=4000, array=array)
    whole = Solution(drive=drive, error=np.zeros(500), iterations=np.zeros(500), status=("converged",) * 500)
    save_solution(whole, tmp_path / "a.drive.h5")
    for streamed in (False, True):
        again = load_solution(tmp_path / "a.drive.h5", streamed=streamed).drive
        np.testing.assert_array_equal(phase_bytes(again, 1), phase_bytes(drive, 1))
        np.testing.assert_array_equal(intensity_bytes(again, 1), intensity_bytes(drive, 1))
        np.testing.assert_array_equal(phase_bytes(again, 1)[70:200], phase_bytes(drive, 1)[70:200])
    # Deflate finds little in the noise of a random walk, whose steps need 4 of the 8 bits.
    with h5py.File(tmp_path / "a.drive.h5") as file:
        for name, whole in (("phase_step", phase), ("level_step", level)):
            assert file[name].id.get_storage_size() < whole.nbytes / 8


def test_phases_of_other_boards_are_not_rounded(tmp_path):
    array = TransducerArray(position=[[0, 0, 0], [0.01, 0, 0]], normal=[[0, 0, 1], [0, 0, 1]])
    drive = Drive(phase=[[0.1234567, -9.0]], level=[[0.5, 0.123]], rate=1000, array=array)
    whole = Solution(drive=drive, error=np.zeros(1), iterations=np.zeros(1), status=("converged",))
    save_solution(whole, tmp_path / "a.drive.h5")
    again = load_solution(tmp_path / "a.drive.h5").drive
    np.testing.assert_array_equal(again.phase, drive.phase)
    np.testing.assert_array_equal(again.level, drive.level)


@pytest.mark.parametrize(
    ("name", "read", "words"),
    [
        ("grid_rows", load_target, "expected grid_rows beside grid_columns"),
        ("air_density_kg_m3", load_solution, "expected air_density_kg_m3 in a midair drive"),
        ("level", load_solution, "either level or transducer_level"),
    ],
)
def test_refuses_a_target_without_grid_an_incomplete_air_and_no_level(path, name, read, words):
    with h5py.File(path, "r+") as file:
        del (file if name in file else file.attrs)[name]
    with pytest.raises(BrokenFileError, match=words):
        read(path)


@pytest.mark.long
@pytest.mark.parametrize("own_levels", [False, True])
def test_a_drive_in_parts_is_stored_as_a_whole_and_read_in_parts(tmp_path, own_levels):
    rng, array = np.random.default_rng(0), TransducerArray.autd3(columns=1, rows=1)
    shape = (2500, array.count) if own_levels else (2500,)
    level = rng.integers(0, 256, shape) / 255
    drive = Drive(
        phase=rng.integers(0, 256, (2500, array.count)) / (256 / (2 * np.pi)), level=level, rate=500, array=array
    )
    status = ("converged", "silent", "stalled", "iterations", "converged") * 500
    whole = Solution(drive=drive, error=rng.uniform(0, 1, 2500), iterations=np.arange(2500), status=status)
    amplitude = rng.integers(0, 2**13, (2500, 4)) / 8  # 13 binary digits
    target = AmplitudeFrames(amplitude=amplitude, rate=500, grid=ControlGrid(rows=2, columns=2))

    def part(first, last):
        some = replace(drive, phase=drive.phase[first:last], level=level[first:last])
        told = {name: getattr(whole, name)[first:last] for name in ("error", "iterations", "status")}
        return Solution(drive=some, **told)

    parts = (part(first, min(first + 700, 2500)) for first in range(0, 2500, 700))
    save_solutions(parts, tmp_path / "a.drive.h5", frames=2500, target=target)
    for streamed in (False, True):
        again = load_solution(tmp_path / "a.drive.h5", streamed=streamed)
        assert isinstance(again.drive.phase, LazyFrames) == streamed
        np.testing.assert_array_equal(again.drive.phase, drive.phase)
        np.testing.assert_array_equal(again.drive.level, level)
        np.testing.assert_array_equal(again.error, whole.error)
        np.testing.assert_array_equal(again.iterations, whole.iterations)
        assert again.status == status
        wanted = load_target(tmp_path / "a.drive.h5", streamed=streamed)
        np.testing.assert_array_equal(wanted.amplitude, target.amplitude)


def test_a_drive_whose_parts_end_too_early_leaves_nothing(tmp_path):
    array = TransducerArray.autd3(columns=1, rows=1)

    def parts(*errors):
        drive = Drive(phase=np.zeros((5, array.count)), level=np.ones(5), rate=500, array=array)
        yield Solution(drive=drive, error=np.zeros(5), iterations=np.zeros(5), status=("converged",) * 5)
        for error in errors:
            raise error

    with pytest.raises(KeyboardInterrupt):
        save_solutions(parts(KeyboardInterrupt), tmp_path / "a.drive.h5", frames=10)
    with pytest.raises(MismatchError, match="a drive of 10 frames, got 5"):
        save_solutions(parts(), tmp_path / "a.drive.h5", frames=10)
    assert list(tmp_path.iterdir()) == []


def test_a_prediction_needs_no_lock_and_an_error_of_the_disk_is_that_of_the_file(path, monkeypatch):
    fcntl, resource = pytest.importorskip("fcntl"), pytest.importorskip("resource")
    with path.open() as file:
        fcntl.flock(file, fcntl.LOCK_SH)  # on disks without locks HDF5's own fails as it does now
        store_prediction(path, {"felt": 8})
    assert load_prediction(path) == {"felt": 8}

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size, before[1]))
    try:
        with pytest.raises(FileError, match=r"towel\.drive\.h5: cannot be written: File too large"):
            store_prediction(path, {"felt": "8" * 20_000})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
