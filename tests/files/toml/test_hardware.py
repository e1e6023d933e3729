from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import BrokenFileError, FileError
from midair.files import (
    load_palm,
    load_placement,
    load_profiles,
    load_sensor,
    load_stage,
    load_tracker,
    save_sensor,
    save_tracker,
)
from midair.model import Palm, SensorGrid, SensorWiring

EXAMPLE = Path(__file__).parents[3] / "docs" / "data" / "stage.toml"

SENSOR = """
name = "palm sensor 3"
rows = 2
columns = 3
pitch_mm = 12.5
unit = "V"
full_scale = 1.25
sensitivity = 0.02
order = [5, 4, 3, 2, 1, 0]
"""

PROFILE = """
[[profile]]
name = "mine"
title = "t"
source = "s"
evidence = "e"
[[profile.place]]
name = "ear"
position_mm = [0, 0, 500]
reach_mm = 0
limit_db = 100
"""

UNITS = """
name = "corner"
[[unit]]
position_mm = [0, 0, 0]
[[unit]]
position_mm = [192.0, 0.0, 50]
rotation_deg = [0, -30, 90]
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "skin.toml"


def test_a_sensor_written_by_hand(path):
    path.write_text(SENSOR)
    assert load_sensor(path) == SensorWiring(
        grid=SensorGrid(rows=2, columns=3, pitch=12.5e-3, name="palm sensor 3"),
        order=(5, 4, 3, 2, 1, 0),
        unit="V",
        full_scale=1.25,
        sensitivity=0.02,
    )
    path.write_text("")
    assert load_sensor(path) == SensorWiring(grid=SensorGrid(name="skin"))
    save_sensor(SensorWiring(grid=SensorGrid(rows=2, columns=2), order=(3, 1, 0, 2)), path)
    assert path.read_text().endswith("order = [\n  3, 1,\n  0, 2,\n]\n")
    with pytest.raises(FileError):
        save_sensor(SensorWiring(), path / "no folder" / "s.toml")


@pytest.mark.long
@given(
    data=st.data(),
    size=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    pitch=st.integers(1, 200_000),
    name=st.text(st.characters(codec="utf-8"), max_size=20),
    unit=st.sampled_from(["V", "count", "Pa"]),
    numbers=st.tuples(*[st.none() | st.floats(1e-9, 1e9)] * 2),
)
def test_a_written_sensor_is_read_back(data, size, pitch, name, unit, numbers, tmp_path_factory):
    wiring = SensorWiring(
        grid=SensorGrid(rows=size[0], columns=size[1], pitch=pitch * 1e-6, name=name),
        order=tuple(data.draw(st.permutations(range(size[0] * size[1])))),
        unit=unit,
        full_scale=numbers[0],
        sensitivity=numbers[1],
    )
    path = tmp_path_factory.getbasetemp() / "s.toml"
    save_sensor(wiring, path)
    back = load_sensor(path)
    assert back.grid.pitch == pytest.approx(wiring.grid.pitch, rel=1e-12)
    assert (back.grid.shape, back.grid.name) == (wiring.grid.shape, name)
    assert (back.order, back.unit, back.full_scale, back.sensitivity) == (wiring.order, unit, *numbers)


def test_a_stage_is_read_in_metres():
    setup = load_stage(EXAMPLE)
    assert setup.heading == "+x"
    assert setup.start == pytest.approx((-0.18, -0.06))
    assert (setup.contact, setup.clear, setup.approach, setup.back) == pytest.approx((-0.0225, -0.02, 0.005, 0.1))
    assert setup.travel[2] == pytest.approx((-0.06, 0.0))
    assert setup.homing == "switches"
    setup.check(0.12)


def test_units_are_placed_and_the_array_is_centred(path):
    path.write_text(UNITS)
    placement = load_placement(path)
    assert (placement.name, placement.units) == ("corner", 2)
    np.testing.assert_allclose(placement.position[1], [0.192, 0, 0.05])
    np.testing.assert_allclose(np.degrees(placement.rotation[1]), [0, -30, 90])
    np.testing.assert_allclose(placement.array().position.mean(axis=0), 0, atol=1e-12)


def test_invalid_files_are_one_clear_line(path, subtests):
    for load, text, complaint in [
        (load_sensor, "rows = 4\nrow = 3", "row: expected one of columns, "),
        (load_sensor, 'rows = "4"', "rows: expected int, got '4'"),
        (load_sensor, "rows = true", "rows: expected int, got True"),
        (load_sensor, "rows = 1.5", "rows: expected int, got 1.5"),
        (load_sensor, 'unit = "mV"', "unit: expected V or count or Pa, got 'mV'"),
        (load_sensor, "order = [0, 0.5]", "order: expected"),
        (load_sensor, "order = [0, 1]", "expected 16 different numbers"),
        (load_sensor, "pitch_mm = 0", "pitch: expected 1e-06 to 0.2 m"),
        (load_sensor, "pitch_mm = nan", "pitch: expected 1e-06 to 0.2 m"),
        (load_sensor, "sensitivity = 0", "sensitivity: expected a number other than 0"),
        (load_sensor, "name = ", "expected a TOML file that describes a sensor, got"),
        (load_placement, "", "unit is missing"),
        (load_placement, "unit = 3", r"unit: expected tables \[\[unit\]\], got 3"),
        (load_placement, "unit = [3]", "unit 0: expected a table, got 3"),
        (load_placement, "[[unit]]\nposition_mm = [0, 0]", "unit 0.position_mm: expected"),
        (load_placement, "[[unit]]\nposition_mm = [0, 0, true]", "unit 0.position_mm: expected"),
        (load_placement, "[[unit]]\nposition_mm = [0, 0, nan]", "unit position: expected finite"),
        (load_placement, "[[unit]]\nposition = [0, 0, 0]", "unit 0.position: expected one of position_mm"),
        (load_placement, "columns = 3\n[[unit]]\nposition_mm = [0, 0, 0]", "columns"),
        (load_palm, "", "one of disc_mm and outline_mm, got none"),
        (load_palm, "disc_mm = 80\noutline_mm = [[0, 0], [1, 1], [1, 0]]", "got both"),
        (load_palm, "disc_mm = -1", "diameter of the palm"),
        (load_palm, "disc_mm = 2000", "diameter of the palm: expected above 0 and at most 1 m"),
        (load_palm, "outline_mm = [[0, 0], [1, 1]]", "three corners"),
        (load_tracker, "turn = 1", "turn: expected one of offset_mm"),
        (load_tracker, "offset_mm = [1, 2]", "offset_mm: expected"),
        (load_tracker, "uncertainty_mm = -1", "uncertainty of the tracker"),
    ]:
        path.write_text(text)
        with subtests.test(text=text), pytest.raises(BrokenFileError, match=complaint) as refused:
            load(path)
        assert str(refused.value).startswith(str(path))
        assert "\n" not in str(refused.value)


WHOLE = {load_stage: EXAMPLE.read_text(encoding="utf-8"), load_profiles: PROFILE}


def test_invalid_values_are_named(path, subtests):
    for load, old, new, complaint in [
        (load_stage, "contact_mm = -22.5", "", "contact_mm is missing"),
        (load_stage, "contact_mm = -22.5", 'contact_mm = "deep"', "contact_mm: expected float"),
        (load_stage, "contact_mm = -22.5", "contact_mm = -10", "clear_mm: expected a height above contact_mm"),
        (load_stage, '"+x"', '"x"', "heading: expected .x or -x or .y or -y"),
        (load_stage, "z_mm", "w_mm", "travel.w_mm: expected one of"),
        (load_stage, "[-60.0, 0.0]", "[0.0, -60.0]", "travel.z_mm: expected the smaller value first"),
        (load_stage, "[travel]", "[[travel]]", "travel: expected a table"),
        (load_stage, 'heading = "+x"', 'heading = "+x"\nhoming = "never"', "homing: expected switches or by hand"),
        (load_profiles, "reach_mm = 0", "", "reach_mm"),
        (load_profiles, "reach_mm = 0", "reach_mm = -1", "reach_mm"),
        (load_profiles, "limit_db = 100", "limit_db = nan", "finite"),
        (load_profiles, "limit_db = 100", "limit_db = 'loud'", "loud"),
        (load_profiles, "limit_db = 100", "limit_db = 100\nlimt = 3", "limt"),
        (load_profiles, "limit_db = 100", "limit_db = 100\nenforced = false", "at least one"),
        (load_profiles, "[0, 0, 500]", "[0, 0]", "position_mm"),
        (load_profiles, 'evidence = "e"', "", "evidence"),
        (load_profiles, 'evidence = "e"', 'evidence = "e"\nduty = 1.5', "at most 1"),
        (load_profiles, 'evidence = "e"', 'evidence = "e"\nwarming_k = nan', "above 0 K"),
        (load_profiles, "[[profile]]", "[[profile]", "TOML"),
        (load_profiles, "[[profile]]\n", "[[profiles]]\n", "profile"),
    ]:
        assert old in WHOLE[load]
        path.write_text(WHOLE[load].replace(old, new), encoding="utf-8")
        with subtests.test(new=new), pytest.raises(BrokenFileError, match=complaint):
            load(path)


def test_a_palm_and_a_tracker_are_read(path):
    path.write_text("disc_mm = 60\npitch_mm = 2")
    disc = load_palm(path)
    np.testing.assert_array_equal(disc.inside, Palm.disc(60e-3, pitch=2e-3).inside)
    assert (disc.name, disc.pitch) == ("skin", pytest.approx(2e-3))
    path.write_text('name = "a"\noutline_mm = [[-30, -30], [30, -30], [30, 30], [-30, 30]]')
    square = load_palm(path)
    assert square.name == "a"
    assert square.inside[1:-1, 1:-1].all()
    path.write_text("rotation_deg = [0, 0, 90]\noffset_mm = [0, -120, 15]\n")
    placement = load_tracker(path)
    np.testing.assert_allclose(placement.points(np.array([0.1, 0, 0.2])), [0, -0.02, 0.215], atol=1e-12)
    save_tracker(placement, path)
    np.testing.assert_allclose(load_tracker(path).rotation, placement.rotation, atol=1e-7)


def test_profiles_of_midair_state_source_and_evidence():
    profiles = load_profiles()
    assert list(profiles) == ["occupational-110", "public-100"]
    for each in profiles.values():
        assert any(year in each.source for year in ("1984", "2005", "2010"))
        assert "thin" in each.evidence
        assert {place.name for place in each.places} == {"left ear", "right ear", "bystander", "palm"}
        assert not each.places[-1].enforced


def test_a_user_profile(path):
    path.write_text(PROFILE)
    mine = load_profiles(path)["mine"]
    assert mine.places[0].position == (0, 0, 0.5)
    assert mine.places[0].enforced
    assert (mine.duty, mine.warming) == (0.5, 6.0)
    path.write_text(PROFILE.replace('title = "t"', 'title = "t"\nduty = 0.8\nwarming_k = 2.5'))
    own = load_profiles(path)["mine"]
    assert (own.duty, own.warming) == (0.8, 2.5)
