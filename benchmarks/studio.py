"""Measure the studio against its own browser: frame rate of drawing and CPU share of the server.

``python -m benchmarks.studio --seconds 10`` starts a server on the virtual rig in a separate process, and Chromium
without a GPU, both on this machine. Every figure has a reference from the same browser in the same run.
``--takes 1000 --part reproduce`` does so with a folder of 1000 takes.
"""

import argparse
import contextlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

import midair
from midair.files import save
from midair.model import Recording

PARTS = ("start", "reproduce", "play", "record", "live", "deaths")

TICKS = """void (studio.ticks ?? (studio.ticks = 0,
    (function tick() { studio.ticks++; requestAnimationFrame(tick); })()))"""


def until(page, script, timeout=180.0):
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        try:
            if found := page.evaluate(script):
                return found
        except Exception as wrong:
            if "destroyed" not in str(wrong) and "not defined" not in str(wrong):
                raise
        time.sleep(0.02)
    raise TimeoutError(script)


def cpu(processes):
    return sum(sum(each.cpu_times()[:2]) for each in processes)


def measured(page, server, seconds, drawn):
    """Drawn pictures over ticks of the browser, and the server's share of a core, over `seconds`."""
    page.evaluate(TICKS)
    before, spent, began = page.evaluate(f"[studio.ticks, {drawn}]"), cpu([server]), time.monotonic()
    time.sleep(seconds)
    after, lasted = page.evaluate(f"[studio.ticks, {drawn}]"), time.monotonic() - began
    ticks, pictures = after[0] - before[0], after[1] - before[1]
    return {
        "ticks_a_second": round(ticks / lasted, 1),
        "pictures_of_ticks_percent": round(100 * pictures / max(1, ticks), 1),
        "server_cpu_percent": round(100 * (cpu([server]) - spent) / lasted, 1),
    }


@contextlib.contextmanager
def opened(takes=0):
    """Start a studio with some takes and a page; yields the page, the server's process, and the durations."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        if takes:
            noise = np.random.default_rng(0).normal(size=(300, 4, 4))
            save(Recording(samples=noise, rate=1000, unit="Pa"), first := Path(folder) / "take-0001.h5")
            for number in range(2, takes + 1):
                shutil.copyfile(first, first.with_name(f"take-{number:04d}.h5"))
        # The browser is started before, like that of a user.
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto("about:blank")
        received = {}
        page.on("requestfinished", lambda asked: received.__setitem__(asked.url, asked))
        began = time.monotonic()
        words = [sys.executable, "-m", "midair", "studio", folder, "--no-browser"]
        studio = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            link = studio.stdout.readline().strip()
            took = {"command_to_link_s": round(time.monotonic() - began, 2)}
            at = time.monotonic()
            page.goto(link, wait_until="commit")
            until(page, "globalThis.studio?.link?.page > 0")
            took["page_answers_s"] = round(time.monotonic() - at, 2)
            page.evaluate("location.hash = '#reproduce/sample:orbit'")
            until(page, f"document.querySelectorAll('.takes a').length > {takes}")
            took["takes_listed_s"] = round(time.monotonic() - at, 2)
            until(page, "(globalThis.studio?.drawn ?? 0) > 0")
            took["first_picture_s"] = round(time.monotonic() - at, 2)
            until(page, "!!studio.room.played && studio.room.take.played.last > 0")
            took["played_beside_it_s"] = round(time.monotonic() - at, 2)
            took["web_received_kb"] = round(_bytes_of(received) / 1000, 1)
            yield page, psutil.Process(studio.pid), took
            browser.close()
        finally:
            studio.terminate()
            studio.wait(15)


def _bytes_of(received):
    """Bytes of pages, scripts and styles on the network."""
    ours = [one for url, one in list(received.items()) if "/web/" in url or url.endswith("/")]
    return sum(one.sizes()["responseBodySize"] for one in ours)


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="observation time of each panel in s")
    parser.add_argument("--part", nargs="+", choices=PARTS, default=PARTS, help="only these parts")
    parser.add_argument("--takes", type=int, default=0, help="number of takes in the folder")
    given = parser.parse_args()
    figures = {"load": [round(each, 1) for each in os.getloadavg()]}
    if set(given.part) - {"deaths"}:
        with opened(given.takes) as (page, server, took):
            figures |= took
            for part, measure in ROOMS.items():
                if part in given.part:
                    figures[part] = measure(page, server, given.seconds)
                    print(f"{part}: {figures[part]}", file=sys.stderr)
            figures["server_memory_mb"] = round(server.memory_info().rss / 2**20)
    print(json.dumps(figures, indent=1))
    if "deaths" in given.part:
        from benchmarks.studio_deaths import deaths

        deaths()


def reproduce(page, server, seconds):
    """Target beside the played field, all frames."""
    found = measured(page, server, seconds, "studio.drawn")
    draws = []
    for _ in range(50):
        draws.append(page.evaluate("studio.drawing"))
        time.sleep(0.02)
    return found | {"a_picture_ms": round(statistics.median(draws), 1)}


def play(page, *_):
    """Times from a click on a take of 1 s to its first checked part, and from the press of Play to its sound."""
    until(page, "studio.link.state.player?.state === 'ready'")
    found = {}
    for mode in ("best", "quick"):
        take = f"{mode}.h5"
        midair.record("virtual:towel", 1.0, path=Path(page.evaluate("studio.link.state.studio.folder")) / take)
        page.evaluate("studio.link.order('reproduce', 'list')")
        until(page, f"studio.link.state.takes.some((row) => row.name === '{take}')", 60)
        page.evaluate(f"studio.go('reproduce', '{take}')")
        until(page, f"studio.room.take?.name === '{take}' && studio.room.take.facts")
        page.get_by_label("Mode").select_option(mode)
        clicked = time.monotonic()
        page.get_by_role("button", name="Play on array").click()
        until(page, "!document.querySelector('#hold').disabled")
        checked = time.monotonic()
        page.locator("#hold").click(delay=900)
        until(page, "studio.link.state.player.emitting")
        found[f"{mode}_click_to_checked_s"] = round(checked - clicked, 2)
        found[f"{mode}_press_to_sound_s"] = round(time.monotonic() - checked, 2)
        until(page, "studio.link.state.player.state === 'ready'")
        page.locator("#exposure").get_by_role("button", name="Close").click()
    return found


def record(page, server, seconds):
    """Frames of the virtual sensor as they arrive."""
    page.evaluate("location.hash = '#record'")
    until(page, "studio.room?.newest > 500 && studio.link.state.record.state === 'listening'")
    first = page.evaluate("[studio.room.track.lost, studio.room.newest]")
    found = measured(page, server, seconds, "studio.room.drawn")
    last = page.evaluate("[studio.room.track.lost, studio.room.newest]")
    return found | {"frames": last[1] - first[1], "frames_missing": last[0] - first[0]}


def live(page, server, seconds, attempts=3):
    """Live touch and its sound field; repeated if a busy machine has ended it, and the ends are reported."""
    until(page, "studio.link.state.player?.state === 'ready'")
    page.evaluate("studio.link.order('record', 'listen', {sensor: 'virtual:towel'}); location.hash = '#live'")
    ended = []
    while not _felt(page):
        # The page's main thread may have stopped for half a second; the array then falls silent, as required.
        ended.append(page.evaluate("studio.link.state.live.said || document.querySelector('#hold').textContent"))
        if len(ended) == attempts:
            return {"ended": ended}
    first = page.evaluate("[studio.room.track.lost + studio.room.sound.lost, studio.room.track.last]")
    found = measured(page, server, seconds, "studio.room.drawn")
    last = page.evaluate("[studio.room.track.lost + studio.room.sound.lost, studio.room.track.last]")
    state, goes = page.evaluate("[studio.link.state.live, studio.link.state.live_goes]")
    found |= {
        "frames": last[1] - first[1],
        "frames_missing": last[0] - first[0],
        "plays_still": state["state"] == "plays",
        "ended_before": ended,
    }
    found |= {name: goes[name] for name in ("late", "lost", "hurried") if name in goes}
    page.keyboard.press("Escape")
    return found


def _felt(page):
    """Check the exposure, hold the button and wait for drawn frames; return whether live touch plays."""
    until(page, "studio.name === 'live' && !document.querySelector('#live-check').disabled")
    page.locator("#live-check").click()
    until(page, "!document.querySelector('#hold').disabled")
    before = page.evaluate("studio.room.drawn")
    page.locator("#hold").click(delay=900)
    opens = "studio.link.state.live.state !== 'idle'"
    with contextlib.suppress(TimeoutError):
        until(page, opens, 10.0)
    until(page, f"!({opens}) || (studio.link.state.live.state === 'plays' && studio.room.drawn > {before} + 10)")
    return page.evaluate("studio.link.state.live.state === 'plays'")


ROOMS = {"reproduce": reproduce, "play": play, "record": record, "live": live}

if __name__ == "__main__":
    main()
