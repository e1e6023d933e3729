import pytest

from midair.errors import BrokenFileError
from midair.files import load_profiles

TOML = """
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


def test_profiles_of_midair_state_source_and_evidence():
    profiles = load_profiles()
    assert list(profiles) == ["occupational-110", "public-100"]
    for each in profiles.values():
        assert any(year in each.source for year in ("1984", "2005", "2010"))
        assert "thin" in each.evidence
        assert {place.name for place in each.places} == {"left ear", "right ear", "bystander", "palm"}
        assert not each.places[-1].enforced


@pytest.fixture
def profiles_of(tmp_path):
    """The profiles of a text in a file."""

    def read(text):
        (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
        return load_profiles(tmp_path / "mine.toml")

    return read


def test_a_user_profile(profiles_of):
    mine = profiles_of(TOML)["mine"]
    assert mine.places[0].position == (0, 0, 0.5)
    assert mine.places[0].enforced
    assert (mine.duty, mine.warming) == (0.5, 6.0)
    own = profiles_of(TOML.replace('title = "t"', 'title = "t"\nduty = 0.8\nwarming_k = 2.5'))["mine"]
    assert (own.duty, own.warming) == (0.8, 2.5)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("reach_mm = 0", "", "reach_mm"),
        ("reach_mm = 0", "reach_mm = -1", "reach_mm"),
        ("limit_db = 100", "limit_db = nan", "finite"),
        ("limit_db = 100", "limit_db = 'loud'", "loud"),
        ("limit_db = 100", "limit_db = 100\nlimt = 3", "limt"),
        ("limit_db = 100", "limit_db = 100\nenforced = false", "at least one"),
        ("[0, 0, 500]", "[0, 0]", "position_mm"),
        ('evidence = "e"', "", "evidence"),
        ('evidence = "e"', 'evidence = "e"\nduty = 1.5', "at most 1"),
        ('evidence = "e"', 'evidence = "e"\nwarming_k = nan', "above 0 K"),
        ("[[profile]]", "[[profile]", "TOML"),
        ("[[profile]]\n", "[[profiles]]\n", "profile"),
    ],
)
def test_wrong_profiles_are_refused(old, new, word, profiles_of):
    assert old in TOML
    with pytest.raises(BrokenFileError, match=word):
        profiles_of(TOML.replace(old, new, 1))
