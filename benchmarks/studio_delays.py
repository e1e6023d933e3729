"""Delays from a sample to the screen: sending, drawing, and composition of the picture.

The sensor is simulated on a serial line. It notes when it sends each frame, and presses one cell at known frames, so
that frame numbers of both sides can be matched. The browser's screencast provides composed pictures, each with the
number of its newest frame as black and white squares.
"""

import base64
import contextlib
import io
import itertools
import statistics
import time

import numpy as np

from benchmarks.live_outside import SerialSkin

EVERY = 4096
"""Frames between two presses of the marked cell."""

SQUARES, SIDE = 20, 8
"""Bits of a number, and pixels of the square for each bit."""

NUMBERED = f"""const pen = document.createElement('canvas'), now = () => performance.timeOrigin + performance.now();
    pen.width = {SQUARES * SIDE}; pen.height = {SIDE};
    Object.assign(pen.style, {{ position: 'fixed', left: 0, top: 0, zIndex: 99 }});
    document.body.append(pen);
    const ink = pen.getContext('2d');
    const show = (number) => {{
        for (let bit = 0; bit < {SQUARES}; bit++) {{
            ink.fillStyle = (number >> bit) & 1 ? '#fff' : '#000';
            ink.fillRect(bit * {SIDE}, 0, {SIDE}, {SIDE});
        }}
    }};"""
"""Script that shows a number as squares."""

LOGGED = f"""void (() => {{
    {NUMBERED}
    const room = studio.room, draw = room._draw, frames = studio.link.frames;
    studio.log = [];
    let came = 0;
    studio.link.frames = (bytes) => {{ frames(bytes); came = now(); }};
    room._draw = function () {{
        const before = room.drawn, begun = now();
        draw.call(room);
        if (room.drawn === before) return;
        studio.log.push([now(), room.newest, begun, came]);
        show(room.newest);
    }};
}})()"""
"""Script that logs for each picture: time of drawing, newest frame, start of drawing, arrival of its last frames."""

EMPTY = f"""void (() => {{
    {NUMBERED}
    globalThis.log = [];
    (function tick() {{ show(log.length); log.push([now(), log.length]); requestAnimationFrame(tick); }})();
}})()"""
"""Script of a page that only shows the number of ticks at each tick."""

MARKED = f"""(() => {{
    const {{ track }} = studio.room, rows = track.width, found = [];
    for (let frame = Math.max(0, track.last - 3 * {EVERY}); frame < track.last; frame++)
        found.push(track.values[(frame % track.capacity) * rows]);
    const most = found.indexOf(Math.max(...found));
    return Math.max(0, track.last - 3 * {EVERY}) + most;
}})()"""


def pressure(number):
    """A small signal that differs between frames, and a press at every multiple of `EVERY` frames."""
    felt = 5.0 * np.sin(np.arange(16) + 0.1 * number)
    felt[0] = 90.0 if number % EVERY == 0 else 0.0
    return felt


def delays(page, seconds, until):
    """Median, 95 % and 99 % of the delays in ms from sending a frame to the drawn and to the composed picture.

    `sample_to_drawn_ms` refers to the newest frame of each picture; `any_sample_to_drawn_ms` to every frame and the
    first picture that contains it, and is therefore longer by half a tick. A picture is drawn when its script has
    ended. The browser's time from there to the composed picture is also measured for an empty page.
    """
    skin = SerialSkin(pressure)
    try:
        page.evaluate("location.hash = '#record'")
        until(page, "studio.name === 'record' && studio.link.state.record.state === 'listening'")
        page.evaluate(f"studio.link.order('record', 'listen', {{sensor: {skin.name!r}}})")
        until(page, "studio.link.state.record.about?.sensor.startsWith('serial:') && studio.room.newest < 3000")
        until(page, f"studio.link.state.record.state === 'listening' && studio.room.newest > {EVERY} + 500")
        offset = _offset(page, skin)
        page.evaluate(LOGGED)
        clock = time.time_ns() / 1e6 - 1e3 * time.monotonic()  # noqa: TID251  # the browser's pictures have wall time
        time.sleep(seconds)
        log = [[at - clock, newest, begun - clock, came - clock] for at, newest, begun, came in _logged(page)]
        composed = _composed(page, seconds)
        later = {newest: at for at, newest, *_ in page.evaluate("studio.log")}
    finally:
        skin.close()
    sent = {frame - offset: 1e3 * at for frame, at in skin.pushed.items()}
    first = np.searchsorted([newest for _, newest, *_ in log], every := range(log[0][1] + 1, log[-1][1]))
    return {
        "sample_to_drawn_ms": _said([at - sent[newest] for at, newest, *_ in log]),
        "any_sample_to_drawn_ms": _said([log[k][0] - sent[n] for k, n in zip(first, every, strict=True)]),
        "of_it": {
            "in_the_page_ms": _said([came - sent[newest] for _, newest, _, came in log]),
            "waits_for_the_tick_ms": _said([begun - came for *_, begun, came in log]),
            "drawing_ms": _said([at - begun for at, _, begun, _ in log]),
        },
        "sample_to_composed_ms": _said([at - clock - sent[shown] for at, shown in composed if shown in sent]),
        "drawn_to_composed_ms": _said([at - later[shown] for at, shown in composed if shown in later]),
        "drawn_to_composed_of_an_empty_page_ms": _empty(page, seconds),
    }


def _logged(page):
    return page.evaluate("studio.log")[5:]


def _empty(page, seconds):
    """Time of the same browser to compose a page of the same size that only shows the number."""
    page.evaluate("location.hash = '#study'")
    empty = page.context.browser.new_page(viewport=page.viewport_size)
    try:
        empty.bring_to_front()
        empty.evaluate(EMPTY)
        composed = _composed(empty, seconds)
        drawn = {number: at for at, number in empty.evaluate("log")}
    finally:
        empty.close()
        page.bring_to_front()
    return _said([at - drawn[shown] for at, shown in composed if shown in drawn])


def _offset(page, skin):
    """Difference between frame numbers of the sender and of the page, which counts from the start of recording."""
    marked = page.evaluate(MARKED)
    behind = max(skin.pushed) - page.evaluate("studio.room.newest")
    # The sender is ahead by the earlier frames and by the delay; the nearest press gives the exact offset.
    return round((marked + behind) / EVERY) * EVERY - marked


def _composed(page, seconds):
    """(wall time in ms, shown number) of every picture that the browser composed."""
    from PIL import Image

    told = page.context.new_cdp_session(page)
    kept = []

    def take(frame):
        kept.append((1e3 * frame["metadata"]["timestamp"], frame["data"]))
        # A frame that arrives while the page closes cannot be acknowledged.
        with contextlib.suppress(Exception):
            told.send("Page.screencastFrameAck", {"sessionId": frame["sessionId"]})

    told.on("Page.screencastFrame", take)
    # Half the size, because encoding full pictures takes longer than the page itself and delays it.
    half = {"maxWidth": page.viewport_size["width"] // 2, "maxHeight": page.viewport_size["height"] // 2}
    told.send("Page.startScreencast", {"format": "jpeg", "quality": 90, "everyNthFrame": 1, **half})
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        page.wait_for_timeout(50)
    told.send("Page.stopScreencast")
    told.detach()
    found = []
    for at, data in kept[5:]:
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("L"))
        squares = picture[SIDE // 4, SIDE // 4 : SQUARES * SIDE // 2 : SIDE // 2] > 127
        found.append((at, int(squares @ (1 << np.arange(SQUARES)))))
    return found


def _said(found):
    if len(found) < 20:
        return None
    ordered = sorted(found)
    parts = {"half": 0.5, "95_percent": 0.95, "99_percent": 0.99}
    return {"pictures": len(ordered)} | {
        name: round(ordered[int(part * (len(ordered) - 1))], 1) for name, part in parts.items()
    }


SCRUBBED = """void (() => {
    const room = studio.room, draw = room._draw;
    studio.scrubbed = [];
    let since = 0;
    addEventListener('pointermove', (event) => { if (event.buttons) since ||= event.timeStamp; }, true);
    room._draw = function (state) {
        draw.call(room, state);
        if (since) { studio.scrubbed.push(performance.now() - since); since = 0; }
    };
})()"""


def scrubbed(page, moves=60):
    """Delay in ms from a mouse move over the whole recording to the drawn frame."""
    page.evaluate("studio.room.transport.pause()")
    page.evaluate(SCRUBBED)
    box = page.locator("#box-overview canvas, footer canvas").first.bounding_box()
    page.mouse.move(box["x"] + 5, box["y"] + box["height"] / 2)
    page.mouse.down()
    for number in itertools.islice(itertools.count(1), moves):
        page.mouse.move(box["x"] + 5 + number * (box["width"] - 10) / moves, box["y"] + box["height"] / 2)
        time.sleep(0.03)
    page.mouse.up()
    found = sorted(page.evaluate("studio.scrubbed"))
    half, most = statistics.median(found), found[int(0.95 * (len(found) - 1))]
    return {"scrub_to_drawn_half_ms": round(half, 1), "scrub_to_drawn_95_percent_ms": round(most, 1)}
