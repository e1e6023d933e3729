"""The files of the page, read once and kept, packed for the way."""

import gzip
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}


@dataclass(frozen=True, slots=True)
class WebFiles:
    """Pages, scripts and styles by their names: no path is put together from what was sent.

    Attributes
    ----------
    files : dict of str to (str, bytes, bytes)
        Type, contents, and contents packed by gzip.
    """

    files: dict[str, tuple[str, bytes, bytes]]

    @classmethod
    def of(cls, folders: Iterable[Path]) -> Self:
        """All that some folders have."""
        found: dict[str, tuple[str, bytes, bytes]] = {}
        for path in (path for folder in folders for path in folder.iterdir() if path.suffix in _TYPES):
            contents = path.read_bytes()
            found[path.name] = (_TYPES[path.suffix], contents, gzip.compress(contents, mtime=0))
        return cls(found)

    def answer(self, request: Request, name: str) -> Response:
        """A file, packed where the browser takes it so."""
        if name not in self.files:
            return PlainTextResponse("not there\n", 404)
        kind, plain, packed = self.files[name]
        headers = {"vary": "accept-encoding"}
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(packed, media_type=kind, headers={**headers, "content-encoding": "gzip"})
        return Response(plain, media_type=kind, headers=headers)
