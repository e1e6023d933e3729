import contextlib
import http.client
import json
import os
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from midair.studio import Studio, StudioPlan
from midair.studio.takes_list import SAMPLES
from midair.studio.work import SolveRequest, make_sample, solve_take

PORT = 8345
ROOT = f"http://127.0.0.1:{PORT}"
UNTOUCHED = {"held", "orbit.drive.h5", *(f"{name}.h5" for name in SAMPLES)}
"""Files in the folder of the samples that no test changes."""

SOCKET = f"ws://127.0.0.1:{PORT}/socket"


@pytest.fixture
def folder(tmp_path):
    """The folder of a studio in this process."""
    (made := tmp_path / "folder").mkdir()
    return made


@pytest.fixture
def studio(folder, tmp_path):
    (samples := tmp_path / "samples").mkdir()
    made = Studio(StudioPlan(folder=folder), samples, PORT)
    yield made
    for each in (made.panels["live"], made.playing, made.jobs, made.reading):
        each.close()


@pytest.fixture
def client(studio):
    with warnings.catch_warnings():
        # Starlette recommends another client library, which is not needed otherwise.
        warnings.simplefilter("ignore")
        from starlette.testclient import TestClient
    client = TestClient(studio.application(), base_url=ROOT)
    client.cookies.set(studio.keys.cookie, studio.keys.session)
    return client


class PageClient:
    """A page that can send any message."""

    def __init__(self, socket):
        self.socket, self.number = socket, 0
        self.state = json.loads(socket.receive_text())

    @property
    def page(self):
        return self.state["page"]

    def order(self, room, order, **given):
        self.number += 1
        return self.say({"id": self.number, "room": room, "order": order, "with": given})

    def say(self, said):
        self.socket.send_text(json.dumps(said))
        while True:
            answer = json.loads(self.socket.receive_text())
            if "set" in answer:
                self.state["whole"] |= answer["set"]
            elif answer.get("id") == said.get("id", 0):
                return answer


@pytest.fixture
def talk(client):
    with client.websocket_connect(SOCKET, headers={"origin": ROOT}) as socket:
        yield PageClient(socket)


class RunningStudio:
    """A studio that runs: its process, its folder, and the link that it printed."""

    def __init__(self, place, *words):
        self.folder, self.state, self.words, self._cookie = place / "folder", place / "state", words, ""
        self.folder.mkdir(parents=True, exist_ok=True)
        (place / "session").mkdir(exist_ok=True)
        command = [Path(sys.executable).with_name("midair"), "studio", str(self.folder), "--no-browser", *words]
        environment = {**os.environ, "MIDAIR_STATE": str(self.state), "TMPDIR": str(place / "session")}
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        self.link = self.process.stdout.readline().strip()
        self.root = self.link.partition("/enter")[0]
        self.address = f"ws://{self.root.removeprefix('http://')}/socket"
        assert self.link.startswith("http://127.0.0.1:"), "one line with the link, flushed"

    @property
    def samples(self):
        """Folder of the samples and of what is made from them."""
        (found,) = (self.state.parent / "session").glob("midair-studio-*")
        return found

    def ask(self, method, path, body=None, headers=()):
        """Send a request as the studio's own page; returns the answer and its text."""
        line = http.client.HTTPConnection(self.root.removeprefix("http://"))
        line.request(method, path, body, {"Origin": self.root, **dict(headers)})
        answer = line.getresponse()
        text = answer.read()
        line.close()
        return answer, text

    def enter(self):
        """Open the link, the first time; returns the cookie."""
        if not self._cookie:
            answer, _ = self.ask("GET", self.link.removeprefix(self.root))
            self._cookie = answer.getheader("set-cookie").partition(";")[0]
        return self._cookie

    def connect(self, cookie):
        """Open a page."""
        from websockets.sync.client import connect

        return connect(self.address, additional_headers={"Cookie": cookie}, origin=self.root, max_size=None)

    def renewed(self):
        """Remove what a test made, and end its jobs; False if more than that is left of it."""
        if self.process.poll() is not None:
            return False
        with self.connect(self.enter()) as socket, contextlib.suppress(TimeoutError):
            state, end = json.loads(socket.recv(10))["whole"], time.monotonic() + 20

            def order(room, order, **given):
                socket.send(json.dumps({"id": 1, "room": room, "order": order, "with": given}))

            def until(true):
                while not true():
                    state.update(json.loads(socket.recv(end - time.monotonic())).get("set", {}))

            def running():
                return [one["number"] for one in state["jobs"] if one["state"] in ("waits", "runs")]

            until(lambda: len(state["control"]["pages"]) == 1 and sum(one["sample"] for one in state["takes"]) == 4)
            until(lambda: state["player"]["state"] in ("starts", "ready"))
            order("control", "take")
            order("air", "state", temperature="", humidity=None)
            order("study", "end")
            for number in running():
                order("jobs", "cancel", number=number)
            until(lambda: not running() and not state["air"]["temperature"] and not state.get("session"))
            made = {*self.folder.iterdir(), *self.state.glob("*"), *self.samples.iterdir()}
            for one in made - {self.samples / name for name in UNTOUCHED}:
                shutil.rmtree(one) if one.is_dir() else one.unlink()
            return state["live"]["state"] == "idle"
        return False

    def close(self):
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(15)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.process.stdout.close()


@pytest.fixture(scope="session")
def used_studios():
    """Studios that a test has used, and whether another one may take each."""
    made = {}
    yield made
    for each in made:
        each.close()


@pytest.fixture
def studio_at(used_studios, tmp_path_factory):
    """Take a studio that another test has used, with an empty folder and samples that are not solved, or start one."""
    taken = {}

    def open_studio(*words, new=False):
        found = next((one for one, free in used_studios.items() if free and not new and one.words == words), None)
        one = found or RunningStudio(tmp_path_factory.mktemp("studio"), *words)
        taken[one], used_studios[one] = new, False
        return one

    yield open_studio
    for one, new in taken.items():
        used_studios[one] = not new and one.renewed()
        if not used_studios[one]:
            one.close()


class Look:
    """A page with its console errors and waits: the security policy forbids Playwright's own text predicates."""

    def __init__(self, page, studio, towel_drive):
        self.page, self.studio, self.towel_drive, self.wrong, self.elsewhere = page, studio, towel_drive, [], []
        page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda wrong: self.wrong.append(str(wrong)))
        page.on("request", lambda asked: self._asked(asked.url, studio.root))

    def _asked(self, url, root):
        if not url.startswith((root, "http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:")):
            self.elsewhere.append(url)

    def until(self, script, *, timeout=60.0):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            try:
                if found := self.page.evaluate(script):
                    return found
            except Exception as wrong:
                if "destroyed" not in str(wrong) and "not defined" not in str(wrong):
                    raise
            time.sleep(0.05)
        shown = self.page.evaluate("document.body.innerText.slice(0, 1000)")
        state = self.page.evaluate("JSON.stringify(globalThis.studio?.link.state ?? {}).slice(0, 1000)")
        raise AssertionError(f"{script}: not within {timeout} s; {self.wrong}; {shown}; {state}")

    def serious(self):
        """Serious findings of axe on accessibility, with the elements."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page).response["violations"]
        return [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")]

    def shown(self, name, folder, *sizes):
        """Show the page in each scheme and width; then keep a picture, and find it accessible and not too wide."""
        from axe_playwright_python.sync_playwright import Axe

        for scheme, width in sizes:
            self.page.emulate_media(color_scheme=scheme)
            self.page.set_viewport_size({"width": width, "height": 800})
            yield scheme
            self.page.screenshot(path=f"{os.environ.get('MIDAIR_PICTURES', folder)}/{name}-{scheme}-{width}.png")
            assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert Axe().run(self.page).response["violations"] == []

    def unhelped(self):
        """Names of the controls without a line of help."""
        return self.page.evaluate(
            """[...document.querySelectorAll('button, input:not([type=file]), select, textarea')]
            .filter((one) => !one.title && !document.getElementById(one.getAttribute('aria-describedby'))?.textContent)
            .map((one) => one.getAttribute('aria-label') ?? (one.labels?.[0] ?? one).innerText)"""
        )

    def towel(self):
        """Open the sample towel with a drive."""
        self.until("studio.link.state.takes?.some((row) => row.name === 'sample:towel')", timeout=240)
        shutil.copy(self.towel_drive, self.studio.samples)
        self.page.evaluate("studio.link.order('reproduce', 'list')")
        self.go("#reproduce/sample:towel")
        self.until("studio.room?.take?.name === 'sample:towel' && studio.room.take.played.last > 0", timeout=240)

    def take(self, name):
        """Open a take in Reproduce by its address."""
        self.go(f"#reproduce/{name}")
        self.until(f"studio.room?.take?.name === {name!r} && !!studio.room.take.facts", timeout=120)

    def press(self, *keys):
        """Press keys one after the other."""
        for key in keys:
            self.page.keyboard.press(key)

    def go(self, address):
        self.page.evaluate(f"location.hash = {address!r}")

    def hold_to_begin(self):
        """Hold the button that arms live touch."""
        self.hold_to_play()
        self.until("studio.link.state.live.state !== 'idle'")

    def hold_to_play(self):
        """Hold the button that arms."""
        self.until("!document.querySelector('#hold').disabled")
        box = self.page.locator("#hold").bounding_box()
        self.page.mouse.move(box["x"] + 8, box["y"] + 8)
        self.page.mouse.down()
        self.until("!document.querySelector('#hold.held')", timeout=5)
        self.page.mouse.up()


@pytest.fixture(scope="session")
def towel_drive(made_once):
    """A drive of the sample towel that is solved quickly."""

    def fill(folder):
        make_sample((str(folder), "towel"), lambda *_: None)
        files = {"take": str(folder / "towel.h5"), "drive": str(folder / "towel.drive.h5")}
        solve_take(SolveRequest(**files, choices=(("method", "live"), ("level", "auto"))), lambda *_: None)

    return made_once("towel_of_studio", fill) / "towel.drive.h5"


@pytest.fixture
def look(chromium, towel_drive):
    contexts, pages = [], []

    def open_page(studio, *, context=None, at="reproduce", **how):
        how = {"viewport": {"width": 1280, "height": 800}, "reduced_motion": "reduce"} | how
        if context is None:
            context = chromium.new_context(**how)
            contexts.append(context)
        name, _, value = studio.enter().partition("=")
        context.add_cookies([{"name": name, "value": value, "url": studio.root}])
        pages.append(seen := Look(context.new_page(), studio, towel_drive))
        seen.page.goto(studio.root)
        seen.until("globalThis.studio?.link?.page > 0")
        seen.go(f"#{at}")
        return seen

    yield open_page
    for context in contexts:
        context.close()
    assert [one.wrong + one.elsewhere for one in pages if one.wrong or one.elsewhere] == []
