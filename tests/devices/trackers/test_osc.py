"""Packets of Open Sound Control, against the package python-osc."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.devices.trackers.osc import osc_messages


def built(values, stamp=None):
    pytest.importorskip("pythonosc")
    from pythonosc.osc_bundle_builder import OscBundleBuilder
    from pythonosc.osc_message_builder import OscMessageBuilder

    message = OscMessageBuilder(address="/palm/7")
    for value in values:
        message.add_arg(*value) if isinstance(value, tuple) else message.add_arg(value)
    if stamp is None:
        return message.build().dgram
    bundle = OscBundleBuilder(stamp)
    bundle.add_content(message.build())
    bundle.add_content(message.build())
    return bundle.build().dgram


def test_messages_and_bundles_of_python_osc_are_read():
    values = [0.5, 3, True, "a word", (0.1, "d")]
    assert list(osc_messages(built(values))) == [(None, "/palm/7", [0.5, 3.0, "a word", 0.1])]
    read = list(osc_messages(built(values, 1.7e9)))
    assert [one[1:] for one in read] == [("/palm/7", [0.5, 3.0, "a word", 0.1])] * 2
    assert read[0][0] == pytest.approx(1.7e9, abs=1e-5)


@given(st.binary(max_size=200), st.sampled_from([b"", b"#bundle\0", b"/palm\0\0\0,fff\0\0\0\0"]))
def test_no_bytes_do_harm(data, head):
    try:
        for _, address, numbers in osc_messages(head + data):
            assert address.startswith("/")
            assert len(numbers) <= len(data)
    except (ValueError, struct.error, IndexError):
        pass
