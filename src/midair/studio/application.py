"""The studio as an ASGI application: pages, web files and one WebSocket."""

import asyncio
import contextlib
import gzip
import html
import re
import shutil
import tempfile
import time
from collections.abc import AsyncGenerator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self
from urllib.parse import unquote

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from midair.errors import InputError, MidairError
from midair.studio.folders import StudioFolder, unpack_folder
from midair.studio.jobs import NEVER, Jobs, StudioJob
from midair.studio.panels import PANELS, Panel, PanelContext, PlayPanel
from midair.studio.request_guard import NAMES, LoginTokens, RequestGuard
from midair.studio.room_air import RoomAir
from midair.studio.studio_state import LARGEST_ORDER, Page, StudioState
from midair.studio.take_data import frames_of, sound_of
from midair.studio.takes_list import TakesList
from midair.studio.work import methods_of_modes, warm_up
from midair.study import media_type
from midair.version import __version__
from midair.view import TABLES, WEB, colour_table

_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}


@dataclass(frozen=True, slots=True)
class WebFiles:
    """Pages, scripts and styles by name; no path is built from a request."""

    files: dict[str, tuple[str, bytes, bytes]]
    """Media type, contents, and contents compressed by gzip."""

    @classmethod
    def of(cls, paths: Iterable[Path], filled: Mapping[str, str] | None = None) -> Self:
        """Load web files and those of folders; the comment of a name in a page is replaced by the text `filled`."""
        found: dict[str, tuple[str, bytes, bytes]] = {}
        for path in (one for each in paths for one in (each.iterdir() if each.is_dir() else [each])):
            if path.suffix not in _TYPES:
                continue
            contents = path.read_bytes()
            if path.suffix == ".html":
                for name, text in (filled or {}).items():
                    contents = contents.replace(f"<!-- {name} -->".encode(), text.encode())
            found[path.name] = (_TYPES[path.suffix], contents, gzip.compress(contents, mtime=0))
        return cls(found)

    def answer(self, request: Request, name: str) -> Response:
        """Return a file, compressed if the browser accepts gzip."""
        if name not in self.files:
            return PlainTextResponse("not there\n", 404)
        kind, plain, packed = self.files[name]
        headers = {"vary": "accept-encoding"}
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(packed, media_type=kind, headers={**headers, "content-encoding": "gzip"})
        return Response(plain, media_type=kind, headers=headers)


OWN = Path(__file__).parent / "web"
AFTER = 0.5
"""Delay in s between the first page and the opening of the array, so that the first picture comes first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudioPlan:
    """Folder and devices of a studio."""

    folder: Path
    """The only folder that the studio reads and writes."""
    device: str = "virtual"
    """Name of the array."""
    sensor: str = "virtual:towel"
    """Name of the sensor."""
    array_calibration: Path | None = None
    """Calibration to solve for; the stored one of the array if None, the model's transducers if ``none``."""
    seed: int = 0
    """Random seed of the virtual rig."""


class Studio:
    """The panels, job queues and state that live as long as the server.

    `samples` is this session's folder for the samples and the files made from them, `port` that of the server.
    """

    def __init__(self, plan: StudioPlan, samples: Path, port: int) -> None:
        self.plan, self.keys = plan, LoginTokens(port=port)
        self.folder = StudioFolder.at(plan.folder)
        self.takes = TakesList(self.folder, samples)
        self.store = StudioState(lambda: self.playing.sounding)
        self.loop: asyncio.AbstractEventLoop | None = None
        self.jobs = Jobs(partial(self.later, self._show_job), name="work", warm=warm_up)
        self.reading = Jobs(partial(self.later, self._show_job), name="reading")
        self._shown: dict[int, StudioJob] = {}
        self._kept: dict[tuple[str, str, int], bytes] = {}
        self._began = False
        origins = tuple(f"http://{name}:{port}" for name in NAMES)
        self.air = RoomAir(self.store)
        self.playing = PlayPanel(
            self.store, self.takes, self.air, self.later, device=plan.device, seed=plan.seed, origins=origins
        )
        context = PanelContext(
            store=self.store,
            takes=self.takes,
            jobs=self.jobs,
            reading=self.reading,
            playing=self.playing,
            air=self.air,
            later=self.later,
            sensor=plan.sensor,
            array_calibration=plan.array_calibration,
            seed=plan.seed,
        )
        self.panels = context.panels
        for name in PANELS:
            panel = self.panels[name] = PANELS[name](context)
            self.store.left.append(panel.left)
        scripts = [panel.script for panel in self.panels.values()]
        self._files = WebFiles.of((*scripts, OWN, WEB), _tabs_and_scripts(self.panels))
        self.store.put(
            studio={
                "version": __version__,
                "folder": str(self.folder.path),
                "sensor": plan.sensor,
                "stop_port": self.playing.port,
                "stop_token": self.playing.token,
                "methods": methods_of_modes(),
            },
            jobs=[],
        )

    def later(self, act: Callable[..., Any], *values: Any) -> None:
        """Run `act(*values)` on the event loop; may be called from any thread."""
        if self.loop is not None and not self.loop.is_closed():
            self.loop.call_soon_threadsafe(act, *values)

    @asynccontextmanager
    async def running(self, _: Starlette) -> AsyncGenerator[None]:
        """Start the worker processes with the server and end them with it."""
        self.loop = asyncio.get_running_loop()
        self.reading.start()
        # Loading takes a moment; meanwhile the browser opens.
        tables = [asyncio.create_task(asyncio.to_thread(colour_table, name)) for name in TABLES]
        with contextlib.ExitStack() as ending:
            for end in (self.reading.close, self.jobs.close, self.playing.close):
                ending.callback(end)
            for panel in self.panels.values():
                ending.callback(panel.close)
            ending.callback(self.playing.lease.stop)
            for panel in self.panels.values():
                panel.start()
            yield
            for table in tables:
                table.cancel()
            await asyncio.wait(tables)

    def application(self) -> RequestGuard:
        """Return the ASGI application behind the request guard."""
        routes = [
            Route("/", self._index),
            Route("/favicon.ico", partial(self._web, name="icon.svg")),
            Route("/web/{name}", self._web),
            Route("/colours/{name}", self._colours),
            Route("/frames/{stream}/{second:int}", self._frames),
            Route("/sound/{stream}", self._sound),
            Route("/file/{name:path}", self._file),
            Route("/upload", self._upload, methods=["POST"]),
            WebSocketRoute("/socket", self._socket),
        ]
        told: Callable[[Request, Exception], Response] = lambda _, wrong: PlainTextResponse(f"{wrong}\n", 404)  # noqa: E731
        app = Starlette(routes=routes, lifespan=self.running, exception_handlers={MidairError: told})
        return RequestGuard(app, self.keys, stop_port=self.playing.port)

    def _begin(self) -> None:
        """Open the array after the first page has loaded, once per session."""
        if self.loop is not None and not self._began:
            self._began = True
            self.loop.call_later(AFTER, self.playing.start)

    def _show_job(self, job: StudioJob) -> None:
        self._shown[job.number] = job
        ended = [number for number, each in self._shown.items() if each.state not in ("waits", "runs")]
        for number in ended[:-8]:
            self._shown.pop(number)
        now = time.monotonic()
        self.store.put(jobs=[each.as_dict(now) for each in self._shown.values()])

    async def _index(self, request: Request) -> Response:
        self.store.put(takes=self.takes.rows())
        return self._files.answer(request, "index.html")

    async def _web(self, request: Request, name: str = "") -> Response:
        return self._files.answer(request, name or request.path_params["name"])

    async def _colours(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in TABLES:
            return PlainTextResponse("not there\n", 404)
        # The first table takes a second to load; "alive" messages must not wait for it.
        table = await asyncio.to_thread(colour_table, name)
        return Response(table.tobytes(), media_type="application/octet-stream")

    async def _frames(self, request: Request) -> Response:
        """One second of a stream of a take, as sections."""
        stream, second = request.path_params["stream"], request.path_params["second"]
        take = request.query_params.get("take", "")
        if stream not in ("samples", "wanted", "played", "phases", "original", "again"):
            return PlainTextResponse("not there\n", 404)
        data = self.takes.data(take)
        key = (f"{data.take} {data.stamp}", stream, second)
        if key not in self._kept:
            while len(self._kept) > 64:
                self._kept.pop(next(iter(self._kept)))
            order = data, stream, second
            self._kept[key] = await self.reading.result(f"frames of {take}", frames_of, order, after=NEVER)
        return Response(self._kept[key], media_type="application/octet-stream")

    async def _sound(self, request: Request) -> Response:
        """The sum of a take's cells as sound, original or re-recorded."""
        stream, take = request.path_params["stream"], request.query_params.get("take", "")
        if stream not in ("original", "again"):
            return PlainTextResponse("not there\n", 404)
        order = self.takes.data(take), stream
        found = await self.reading.result(f"sound of {take}", sound_of, order, after=NEVER)
        return Response(found, media_type="audio/wav")

    async def _file(self, request: Request) -> Response:
        """A file of the folder; a report is served in a sandbox."""
        name = request.path_params["name"]
        if name.startswith("sample:"):
            path = self.takes.beside(name.removesuffix(".report.html"), ".report.html")
            if not path.exists():
                raise InputError(f"{name}: expected a report, found none")
        else:
            path = self.folder.find(name)
        if not path.is_file():
            return PlainTextResponse("not a file\n", 404)
        if path.name.endswith("report.html"):
            policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox; frame-ancestors 'none'"
            return FileResponse(path, media_type="text/html", headers={"content-security-policy": policy})
        disposition = {"content-disposition": "attachment", "content-security-policy": "sandbox; default-src 'none'"}
        # Pictures and sounds of studies need their type to be shown in a page; a link still downloads them.
        return FileResponse(path, media_type=media_type(path) or "application/octet-stream", headers=disposition)

    async def _upload(self, request: Request) -> Response:
        name = unquote(request.headers.get("x-name", ""))
        try:
            page = int(request.headers.get("x-page", "0"))
            self.store.control.check(page)
            suffix = Path(name).suffix.lower()
            own = suffix == ".h5"
            # A file of another program waits in a folder of its own, with its name, for what it does not state.
            root = self.folder if own else self.takes.incoming_files
            folder = root if own else StudioFolder(Path(tempfile.mkdtemp(dir=root.path)))
            path = await folder.receive(name[:200], request.stream())
            if suffix == ".zip":
                try:
                    await self.reading.result("unpacking a project", unpack_folder, (str(path), str(self.folder.path)))
                finally:
                    shutil.rmtree(path.parent)
        except (MidairError, ValueError) as wrong:
            inside = re.escape(str(self.takes.incoming_files.path))
            return JSONResponse({"error": re.sub(rf"{inside}/\w+/", "", str(wrong))}, 400)
        self.store.put(takes=self.takes.rows())
        imports = not own and suffix != ".zip"
        return JSONResponse({"ok": root.name_of(path) if own or imports else "", "imports": imports})

    async def _socket(self, socket: WebSocket) -> None:
        await socket.accept()
        page = self.store.enter(socket)
        self._begin()
        sending = asyncio.create_task(self._send(page))
        orders: set[asyncio.Task[None]] = set()
        try:
            while True:
                text = await socket.receive_text()
                if len(text) > LARGEST_ORDER:
                    break
                # A request may take as long as a drive plays; "alive" messages must not wait for it.
                task = asyncio.create_task(self.store.on_message(page, text))
                orders.add(task)
                task.add_done_callback(orders.discard)
                # Without a pause, the other pages have their turn before the next message.
                await asyncio.sleep(page.pause(time.monotonic(), len(text)))
        except (WebSocketDisconnect, KeyError, RuntimeError):
            pass
        finally:
            self.store.leave(page)
            sending.cancel()
            with contextlib.suppress(Exception):
                await socket.close()

    async def _send(self, page: Page) -> None:
        with contextlib.suppress(Exception):
            while True:
                await page.wire.send_text(await self.store.next_text(page))


def _tabs_and_scripts(panels: dict[str, Panel]) -> dict[str, str]:
    """Return the parts of index.html that depend on the panels."""
    tab = '<a href="#{0}" data-room="{0}" data-script="/web/{1}">{2}</a>'
    tabs = [tab.format(name, each.script.name, html.escape(each.title)) for name, each in panels.items()]
    scripts = [f'<link rel="modulepreload" href="/web/{each.script.name}">' for each in panels.values()]
    return {"tabs": "\n    ".join(tabs), "scripts": "\n".join(scripts)}
