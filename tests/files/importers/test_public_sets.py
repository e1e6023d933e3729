"""Files of public sets, written to the letter of what their owners or others document; none of them is theirs."""

import numpy as np
import pytest

from midair.errors import BrokenFileError, ShapeError
from midair.files import load, open_take

ACCEL = "time,X,Y,Z\n0.0009990528727670048,0.014,0.067,-0.96\n0.0012090528727670066,0.034,0.048,-0.946\n"
AXES = "<x>1 2 3</x><y>4 5 6</y><z>7 8 9</z>"
XML = "<Texture><SampleRate>10000</SampleRate><Accel>{}</Accel><Speed>90 100 110</Speed></Texture>"


def test_cluster_acceleration_states_texture_and_speed(tmp_path):
    more = "".join(f"{0.0012 + i / 6000},{i % 2},0.0,{i}\n" for i in range(1, 600))
    (path := tmp_path / "62_135_50_500_0.csv").write_text(ACCEL + more)
    take = open_take(path, channels=["Z"], scale=30.0)
    assert take.recording.rate == 6000
    notes = take.recording.provenance.notes
    assert (notes["texture"], notes["speed"], notes["force_mn"], notes["repeat"]) == ("62", "50 mm/s", "500", "0")
    assert take.report[0].startswith("Named as a file of the Cluster Haptic Texture Dataset: texture 62")
    with pytest.raises(ShapeError, match=r"3 channels \(X, Y, Z\)"):
        open_take(path, scale=30.0)


def test_lmt_is_known_by_its_file_names(tmp_path):
    (path := tmp_path / "G1EpoxyRasterPlate_Movement_X_train1.txt").write_text("0.5\n-0.5\n0.25\n")
    recording = load(path, rate=10000.0, scale=2.0)
    assert recording.samples.ravel().tolist() == [1.0, -1.0, 0.5]
    assert recording.provenance.notes["material"] == "G1EpoxyRasterPlate"


@pytest.mark.parametrize(("inner", "names"), [("1 2 3", ["accel"]), (AXES, ["x", "y", "z"])])
def test_hatt_has_rate_axes_and_medians(inner, names, tmp_path):
    (path := tmp_path / "Carpet.xml").write_text(XML.format(inner))
    recording = load(path, channels=names[:1], scale=2.0)
    assert recording.rate == 10000
    np.testing.assert_array_equal(recording.samples.ravel(), [2, 4, 6])
    assert recording.provenance.notes["median speed"] == "100"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<!DOCTYPE x [<!ENTITY a "b">]><x/>', "without declarations"),
        ("<x><SampleRate>1</SampleRate></x>", "elements Accel and SampleRate, got samplerate, x"),
        ("<x>", "expected a HaTT file, got"),
        (XML.format("1 b"), "could not convert string to float: 'b'"),
        (XML.format("<x>1 2</x><y>1</y>"), "must have the same shape"),
    ],
)
def test_hatt_refuses_other_xml(text, said, tmp_path):
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(BrokenFileError, match=said):
        load(tmp_path / "a.xml", scale=1.0)
