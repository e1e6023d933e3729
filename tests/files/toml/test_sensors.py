import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import BrokenFileError, FileError, MissingFileError
from midair.files import load_sensor, save_sensor
from midair.files.toml.sensors import sensor_text
from midair.model import SensorGrid, SensorWiring

FULL = """
name = "palm sensor 3"
rows = 2
columns = 3
pitch_mm = 12.5
unit = "V"
full_scale = 1.25
sensitivity = 0.02
order = [5, 4, 3, 2, 1, 0]
"""


def test_a_file_written_by_hand(tmp_path):
    (tmp_path / "palm.toml").write_text(FULL)
    assert load_sensor(tmp_path / "palm.toml") == SensorWiring(
        grid=SensorGrid(rows=2, columns=3, pitch=12.5e-3, name="palm sensor 3"),
        order=(5, 4, 3, 2, 1, 0),
        unit="V",
        full_scale=1.25,
        sensitivity=0.02,
    )


def test_an_empty_file_is_the_papers_sensor_in_counts(tmp_path):
    (tmp_path / "skin.toml").write_text("")
    assert load_sensor(tmp_path / "skin.toml") == SensorWiring(grid=SensorGrid(name="skin"))


sizes = st.tuples(st.integers(1, 6), st.integers(1, 6))


@given(
    data=st.data(),
    size=sizes,
    pitch=st.integers(1, 200_000),
    name=st.text(st.characters(codec="utf-8"), max_size=20),
    unit=st.sampled_from(["V", "count", "Pa"]),
    numbers=st.tuples(*[st.none() | st.floats(1e-9, 1e9)] * 2),
)
def test_a_written_sensor_is_read_back(data, size, pitch, name, unit, numbers, tmp_path_factory):
    rows, columns = size
    wiring = SensorWiring(
        grid=SensorGrid(rows=rows, columns=columns, pitch=pitch * 1e-6, name=name),
        order=tuple(data.draw(st.permutations(range(rows * columns)))),
        unit=unit,
        full_scale=numbers[0],
        sensitivity=numbers[1],
    )
    path = tmp_path_factory.mktemp("sensor") / "s.toml"
    save_sensor(wiring, path)
    back = load_sensor(path)
    assert back.grid.pitch == pytest.approx(wiring.grid.pitch, rel=1e-12)
    assert (back.grid.shape, back.grid.name) == (wiring.grid.shape, name)
    assert (back.order, back.unit, back.full_scale, back.sensitivity) == (wiring.order, unit, *numbers)


def test_the_text_shows_the_order_as_a_grid():
    assert sensor_text(SensorWiring(grid=SensorGrid(rows=2, columns=2), order=(3, 1, 0, 2))).endswith(
        "order = [\n  3, 1,\n  0, 2,\n]\n"
    )


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("rows = 4\nrow = 3", "expected the keys .*, got row"),
        ('rows = "4"', "rows: expected a number, got '4'"),
        ("rows = true", "rows: expected a number, got True"),
        ("unit = 3", "unit: expected text, got 3"),
        ('unit = "mV"', "expected one of V, count, Pa, got 'mV'"),
        ("order = [0, 0.5]", "order: expected whole numbers in brackets"),
        ("order = [0, 1]", "expected 16 different numbers"),
        ("rows = 1.5", "got 1.5 x 4"),
        ("pitch_mm = 0", "pitch: expected 1e-06 to 0.2 m"),
        ("pitch_mm = nan", "pitch: expected 1e-06 to 0.2 m"),
        ("sensitivity = 0", "sensitivity: expected a number other than 0"),
        ("name = ", "expected a TOML file that describes a sensor, got"),
    ],
)
def test_invalid_files_are_one_clear_line(text, complaint, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(BrokenFileError, match=complaint) as told:
        load_sensor(path)
    assert str(told.value).startswith(str(path))
    assert "\n" not in str(told.value)


def test_missing_files_and_other_bytes(tmp_path):
    with pytest.raises(MissingFileError, match="found no file"):
        load_sensor(tmp_path / "none.toml")
    (tmp_path / "noise.toml").write_bytes(bytes(range(128, 256)))
    with pytest.raises(BrokenFileError, match="expected a TOML file"):
        load_sensor(tmp_path / "noise.toml")
    with pytest.raises(FileError):
        save_sensor(SensorWiring(), tmp_path / "no folder" / "s.toml")
