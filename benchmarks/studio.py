"""The studio against its own browser: pictures drawn of the browser's ticks, delay of samples, the server's share.

``python -m benchmarks.studio --seconds 10``: a server on the virtual rig in a process of its own, and Chromium without
a GPU, both on this machine. Every figure stands beside what the same browser did in the same run.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

PARTS = ("rooms", "deaths")

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
    """Pictures over ticks, and the server's part of a core, over so many seconds."""
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


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="for how long each room is watched")
    parser.add_argument(
        "--part", nargs="+", choices=("rooms", "deaths"), default=("rooms", "deaths"), help="only these"
    )
    given = parser.parse_args()
    if "rooms" in given.part:
        rooms(given.seconds)
    if "deaths" in given.part:
        from benchmarks.studio_deaths import deaths

        deaths()


def rooms(seconds):
    from playwright.sync_api import sync_playwright

    figures: dict = {"load": [round(each, 1) for each in os.getloadavg()]}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        began = time.monotonic()
        words = [sys.executable, "-m", "midair", "studio", folder, "--no-browser"]
        studio = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            link = studio.stdout.readline().strip()
            figures["command_to_link_s"] = round(time.monotonic() - began, 2)
            server = psutil.Process(studio.pid)
            browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            opened = time.monotonic()
            page.goto(link)
            until(page, "globalThis.studio?.link?.page > 0")
            figures["page_answers_s"] = round(time.monotonic() - opened, 2)
            until(page, "(globalThis.studio?.drawn ?? 0) > 0")
            figures["first_picture_s"] = round(time.monotonic() - opened, 2)
            until(page, "!!studio.room.played && studio.room.take.played.last > 0")
            figures["played_beside_it_s"] = round(time.monotonic() - opened, 2)
            figures["reproduce"] = measured(page, server, seconds, "studio.drawn")
            draws = []
            for _ in range(50):
                draws.append(page.evaluate("studio.drawing"))
                time.sleep(0.02)
            figures["a_picture_ms"] = round(statistics.median(draws), 1)
            page.evaluate("location.hash = '#record'")
            until(page, "studio.room?.newest > 500 && studio.link.state.record.state === 'listening'")
            first = page.evaluate("[studio.room.track.lost, studio.room.newest]")
            figures["record"] = measured(page, server, seconds, "studio.room.drawn")
            last = page.evaluate("[studio.room.track.lost, studio.room.newest]")
            delays = sorted(page.evaluate("studio.room.delays"))
            figures["record"] |= {
                "frames": last[1] - first[1],
                "frames_missing": last[0] - first[0],
                "arrived_to_drawn_half_ms": round(statistics.median(delays), 1),
                "arrived_to_drawn_99_percent_ms": round(delays[int(0.99 * (len(delays) - 1))], 1),
            }
            figures["server_memory_mb"] = round(server.memory_info().rss / 2**20)
            browser.close()
        finally:
            studio.terminate()
            studio.wait(15)
    from midair.studio.application import OWN
    from midair.view import WEB

    size = sum(path.stat().st_size for place in (OWN, WEB) for path in Path(place).iterdir())
    figures["web_kb"] = round(size / 1000)
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
