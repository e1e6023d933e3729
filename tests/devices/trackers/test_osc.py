"""Packets of Open Sound Control, made by python-osc and by hand."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import build_msg
from pythonosc.parsing.osc_types import write_string

from midair.devices import osc_messages
from midair.errors import InputError


def bundle(stamp, *contents):
    builder = OscBundleBuilder(stamp)
    for each in contents:
        builder.add_content(each)
    return builder.build()


def raw(tags, data=b""):
    return write_string("/palm") + write_string("," + tags) + data


def test_every_value_has_its_place_and_a_bundle_in_a_bundle_the_later_time():
    values = [0.5, 3, True, "a word", False, None]
    assert osc_messages(build_msg("/palm/7", values).dgram) == [(None, "/palm/7", values)]
    data = struct.pack(">qdi", -(2**40), 0.1, 65) + write_string("symbol") + struct.pack(">f", 2.0)
    assert osc_messages(raw("hdcISTf", data)) == [(None, "/palm", [-(2**40), 0.1, 65, None, "symbol", True, 2.0])]
    assert osc_messages(write_string("/midair/stop")) == [(None, "/midair/stop", [])]
    one = build_msg("/one", [1])
    inner = bundle(0, one, bundle(1.7e9 + 1, one))
    read = osc_messages(bundle(1.7e9, one, inner, one).dgram)
    assert [(each[1], each[2]) for each in read] == [("/one", [1])] * 4
    assert [each[0] for each in read] == pytest.approx([1.7e9, 1.7e9, 1.7e9 + 1, 1.7e9], abs=1e-5)
    assert osc_messages(bundle(0, one).dgram)[0][0] is None


@given(st.binary(max_size=200), st.sampled_from([b"", b"#bundle\0", b"/palm\0\0\0,fff\0\0\0\0", raw("sbdh")]))
def test_no_bytes_do_harm(data, head):
    try:
        for _, address, values in osc_messages(head + data):
            assert address.startswith("/")
            assert len(values) <= len(head + data)
    except InputError as wrong:
        assert len(str(wrong)) < 200
