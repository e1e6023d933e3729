"""The real AdapTics Designer in Chromium, playing on the virtual array through `serve_adaptics`.

It needs a checkout of github.com/AdaptiveHaptics/AdapticsDesigner (GPL-3.0, no part of midair) after
`npm install` in it, and Chromium.
"""

from __future__ import annotations

import argparse
import functools
import http.server
import tempfile
import threading
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from benchmarks.remote import Here
from midair.devices import VirtualUnits, virtual_immediate
from midair.patterns import read_adaptics
from midair.rig import remote


class Pages(http.server.SimpleHTTPRequestHandler):
    """Files of the Designer."""

    extensions_map = http.server.SimpleHTTPRequestHandler.extensions_map | {
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
    }

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def same_pattern(page: Page, path: Path) -> str:
    """Open a file in the Designer, save it there, and compare what is read from both."""
    with page.expect_file_chooser() as chooser:
        page.evaluate("document.querySelector('.isection.file button.open').click()")
    chooser.value.set_files(path)
    page.wait_for_timeout(1000)
    with page.expect_download() as download:
        page.evaluate("document.querySelector('.isection.file button.download').click()")
    text = Path(download.value.path()).read_text(encoding="utf-8")
    written, saved = (read_adaptics(each, {}) for each in (path.read_text(encoding="utf-8"), text))
    same = (written.keys, written.spans, written.transform) == (saved.keys, saved.spans, saved.transform)
    return f"{path.name}: {len(written.keys)} key frames, saved by the Designer as they were: {same}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.designer", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="checkout of the Designer")
    parser.add_argument("--chromium", default="/usr/bin/chromium", help="browser (default /usr/bin/chromium)")
    parser.add_argument("--picture", help="PNG of the page while it plays")
    parser.add_argument("--pattern", type=Path, help=".adaptics file to open, play and save again in the Designer")
    parser.add_argument("--follow", help="tracker whose palm the Designer's 3D view shows, such as replay:hand.csv")
    options = parser.parse_args()
    pages = functools.partial(Pages, directory=options.folder / "src" / "client")
    web = http.server.ThreadingHTTPServer(("127.0.0.1", 0), pages)
    threading.Thread(target=web.serve_forever, daemon=True).start()
    units = VirtualUnits(kept=100_000)
    remote.server.immediate_array = lambda *_: virtual_immediate(units=units)
    with tempfile.TemporaryDirectory() as name:
        follow = {"follow": options.follow} if options.follow else {}
        served = Here(Path(name), units, serve=functools.partial(remote.serve_adaptics, port=0), patience=120, **follow)
        address, errors = served.url.partition("?")[0], list[str]()
        with sync_playwright() as play:
            page = play.chromium.launch(executable_path=options.chromium, args=["--no-sandbox"]).new_page()
            page.on("pageerror", lambda error: errors.append(str(error)))
            # Without the file pickers of the system, the page opens and saves files as any other page.
            page.add_init_script("delete window.showOpenFilePicker; delete window.showSaveFilePicker;")
            tab = "#centertab=threejscontainer" if options.follow else ""
            page.goto(f"http://127.0.0.1:{web.server_port}/{tab}")
            page.wait_for_selector(".isection.websocket input.websocketurl", state="attached")
            page.wait_for_timeout(2000)
            fill = "([box, at]) => { document.querySelector(box).value = at; }"
            page.evaluate(fill, [".isection.websocket input.websocketurl", address])
            state = "document.querySelector('.isection.websocket span.websocketstate').textContent"
            until = time.monotonic() + 60
            while page.evaluate(state) == "disconnected" and time.monotonic() < until:  # its scripts load
                page.evaluate("document.querySelector('.isection.websocket button.connect').click()")
                page.wait_for_timeout(500)
            page.wait_for_function(f"{state} == 'connected'")
            if options.pattern:
                print(same_pattern(page, options.pattern))
            before = len(units.frames)
            page.get_by_role("button", name="play_arrow").first.click()
            page.wait_for_timeout(1500)
            if options.picture:
                page.screenshot(path=options.picture)
            if options.follow:
                # Without a GPU the page stops drawing the view after some slow frames, until a click.
                page.locator(".threejscontainer").click()
                page.wait_for_timeout(1000)
                palm = "three_mah_dev_environment.scene.getObjectByName('Hand')"
                seen = page.evaluate(f"[{palm}.visible, ...{palm}.children[0].position.toArray()]")
                print("hand in its 3D view: {}, palm at ({:.3f}, {:.3f}, {:.3f}) m".format(*seen))
            playing = sum(intensity > 0 for _, intensity, _ in list(units.frames)[before:])
            page.close()
            time.sleep(0.3)
            print(f"{playing} frames with sound in 1.5 s; silent after the page closed: {not served.sounds()}")
            print(f"refused: {served.lines}; errors of the page: {errors}")
        served.close()
    web.shutdown()


if __name__ == "__main__":
    main()
