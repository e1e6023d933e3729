"""Static files of the page, loaded and compressed once."""

import gzip
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

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
