import asyncio

import numpy as np
import pytest

from midair.studio.feed import Feed
from midair.studio.studio_state import Page
from midair.view import unpack


class Wire:
    def __init__(self):
        self.sent = []

    async def send_bytes(self, data):
        self.sent.extend(unpack(data))


@pytest.fixture
def page():
    return Page(number=1, wire=Wire())


@pytest.fixture
def feed(page):
    made = Feed(lambda: [page])
    made._rate = 1000.0
    return made


def block(first, frames=8):
    return first, (np.arange(first, first + frames, dtype=np.float32)[:, None] * np.ones((1, 2), np.float32))


def send(feed, page, times=1):
    for _ in range(times):
        asyncio.run(feed._send(page))


def frames_of(page):
    return [frame for section in page.wire.sent for frame in range(section.first, section.first + len(section.values))]


def test_every_frame_is_sent_once_and_in_order(feed, page):
    for first in range(0, 80, 8):
        feed.add(*block(first))
        send(feed, page)
    assert frames_of(page) == list(range(80))
    section = page.wire.sent[-1]
    assert np.abs(section.values * section.unit - block(72)[1]).max() <= section.unit


def test_slow_page_gets_its_credit_and_later_one_joined_message(feed, page):
    page.credit = 3
    for first in range(0, 80, 8):
        feed.add(*block(first))
        send(feed, page)
    assert len(page.wire.sent) == 3
    page.credit = 1
    send(feed, page, 2)
    assert len(page.wire.sent) == 4
    assert frames_of(page) == list(range(80))
    assert [section.number for section in page.wire.sent] == [1, 2, 3, 4]


def test_lost_frames_are_a_gap_between_two_messages(feed, page):
    feed.add(*block(0))
    feed.add(*block(20))
    send(feed, page, 3)
    assert [(section.first, len(section.values)) for section in page.wire.sent] == [(0, 8), (20, 8)]


def test_restarted_sensor_starts_again_at_frame_0(feed, page):
    feed.add(*block(64))
    send(feed, page)
    feed.add(*block(0))
    send(feed, page)
    assert [section.first for section in page.wire.sent] == [64, 0]


def test_at_most_a_minute_waits_for_a_page(feed, page):
    page.credit = 0
    for first in range(0, 100_000, 1000):
        feed.add(*block(first, 1000))
    assert sum(len(rows) for _, rows in feed._blocks) <= 61_000
