import asyncio

import numpy as np
import pytest

from midair.studio.panels.record_panel import Feed
from midair.studio.studio_state import Page
from midair.view import Kind, Section, pack, unpack


class Wire:
    def __init__(self):
        self.got, self.hangs = [], False

    async def send_bytes(self, data):
        while self.hangs:
            await asyncio.sleep(0.001)
        self.got.extend([data])


def block(first, frames=8):
    values = np.full((frames, 3), first % 100, np.int16)
    return [pack([Section(kind=Kind.SAMPLES, values=values, first=first)])]


def frames_of(messages):
    return [each.first + i for data in messages for each in unpack(data) for i in range(len(each.values))]


async def settle():
    for _ in range(5):
        await asyncio.sleep(0)


def test_slow_page_gets_one_joined_message_and_delays_no_other_page():
    async def run():
        feed, quick, slow = Feed(), Page(1, Wire()), Page(2, Wire(), credit=2)
        for page in (quick, slow):
            feed.enter(page)
        await settle()
        for first in range(0, 80, 8):
            feed.add(block(first))
            await settle()
            quick.credit = 24
        assert len(quick.wire.got) == 10
        assert len(slow.wire.got) == 2, "no more under way than it has credit for"
        assert feed.waiting == 8
        slow.credit += 2
        feed.remind(slow)
        await settle()
        assert len(slow.wire.got) == 3
        assert frames_of(slow.wire.got) == frames_of(quick.wire.got) == list(range(80))
        assert feed.waiting == 0, "what every page has is forgotten"
        assert [unpack(data)[0].number for data in slow.wire.got] == [1, 2, 3]
        assert {each.number for each in unpack(slow.wire.got[-1])} == {3}
        feed.close()

    asyncio.run(run())


@pytest.mark.long
def test_hanging_page_delays_no_other_page_and_at_most_a_minute_is_kept():
    async def run():
        feed, quick, stuck = Feed(), Page(1, Wire()), Page(2, Wire())
        stuck.wire.hangs = True
        for page in (quick, stuck):
            feed.enter(page)
        await settle()
        for first in range(0, 8 * 7300, 8):
            feed.add(block(first))
            if first % 800 == 0:
                quick.credit = 24
                await settle()
        await settle()
        assert frames_of(quick.wire.got)[-1] == 8 * 7300 - 1
        assert feed.waiting == 7200
        feed.leave(stuck)
        assert feed.waiting == 0
        feed.close()

    asyncio.run(run())


def test_new_page_starts_with_the_current_frame():
    async def run(pages):
        feed, page = Feed(), Page(1, Wire())
        feed.add(block(0))
        for _ in range(pages):
            feed.enter(page)
        await settle()
        feed.add(block(8))
        await settle()
        assert frames_of(page.wire.got) == list(range(8, 16)) * pages
        feed.close()

    for pages in (0, 1):
        asyncio.run(run(pages))
