"""Files of the Penn Haptic Texture Toolkit, written to the letter of what others document; none of them is theirs."""

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import load

AXES = "<x>1 2 3</x><y>4 5 6</y><z>7 8 9</z>"
XML = "<Texture><SampleRate>10000</SampleRate><Accel>{}</Accel><Speed>90 100 110</Speed></Texture>"


@pytest.mark.parametrize(("inner", "names"), [("1 2 3", ["accel"]), (AXES, ["x", "y", "z"])])
def test_hatt_has_rate_axes_and_medians(inner, names, tmp_path):
    (path := tmp_path / "Carpet.xml").write_text(XML.format(inner))
    recording = load(path, channels=names[:1], scale=2.0)
    assert recording.rate == 10000
    np.testing.assert_array_equal(recording.samples.ravel(), [2, 4, 6])
    assert recording.provenance.notes["median speed"] == "100"


def test_hatt_refuses_other_xml(tmp_path, subtests):
    for text, said in [
        ('<!DOCTYPE x [<!ENTITY a "b">]><x/>', "without declarations"),
        ("<x><SampleRate>1</SampleRate></x>", "elements Accel and SampleRate, got samplerate, x"),
        ("<x>", "expected a HaTT file, got"),
        (XML.format("1 b"), "could not convert string to float: 'b'"),
        (XML.format("<x>1 2</x><y>1</y>"), "must have the same shape"),
    ]:
        with subtests.test(said=said):
            (tmp_path / "a.xml").write_text(text)
            with pytest.raises(BrokenFileError, match=said):
                load(tmp_path / "a.xml", scale=1.0)
