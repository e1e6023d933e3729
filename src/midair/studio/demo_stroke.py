"""The stroke that a page shows first, kept with the program: nothing has to be simulated before there is a picture.

It is the beginning of the sample that the studio makes meanwhile, frame by frame the same. ``python -m
midair.studio.demo_stroke`` makes the file anew.
"""

import json
import lzma
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from midair.files import whole_file

KEPT = Path(__file__).parent / "first-stroke.xz"

FIRST = "towel"
"""The sample that it is of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoStroke:
    """What a page asks of a take, answered before the take is there.

    Attributes
    ----------
    facts : mapping
        As `scenes.facts` tells them.
    streams : mapping of (str, int) to bytes
        Sections of the samples and of what is wanted, by stream and second.
    """

    facts: Mapping[str, Any]
    streams: Mapping[tuple[str, int], bytes]

    @classmethod
    def load(cls, path: Path = KEPT) -> Self:
        """The one that is kept with the program."""
        head, _, rest = lzma.decompress(path.read_bytes()).partition(b"\n")
        said, at = json.loads(head), 0
        streams: dict[tuple[str, int], bytes] = {}
        for stream, second, size in said["streams"]:
            streams[stream, second] = rest[at : at + size]
            at += size
        return cls(facts=said["facts"], streams=streams)

    def save(self, path: Path = KEPT) -> None:
        """Keep it."""
        sizes = [[stream, second, len(data)] for (stream, second), data in self.streams.items()]
        head = json.dumps({"facts": self.facts, "streams": sizes}).encode()
        with whole_file(path) as partial:
            partial.write_bytes(lzma.compress(b"\n".join([head, b"".join(self.streams.values())]), preset=9))


def demo_stroke() -> DemoStroke:
    """Record the sample, and keep what a page asks of it; what is wanted in 8 bits, since it is soon replaced."""
    from midair.studio.take_data import TakeData, facts, frames_of
    from midair.studio.work import make_sample
    from midair.view import counted, pack, unpack

    with tempfile.TemporaryDirectory() as folder:
        make_sample((folder, FIRST), _untold)
        scene = TakeData(take=str(Path(folder) / f"{FIRST}.h5"))
        about = facts(scene)
        streams: dict[tuple[str, int], bytes] = {}
        for second in range(int(about["frames"] // about["rate_hz"]) + 1):
            streams["samples", second] = frames_of((scene, "samples", second))
            [wanted] = unpack(frames_of((scene, "wanted", second)))
            values = wanted.values * wanted.unit
            streams["wanted", second] = pack(
                [counted(values, wanted.kind, dtype="u1", first=wanted.first, rate=about["rate_hz"])]
            )
    return DemoStroke(facts=about, streams=streams)


def _untold(stage: str, done: int, total: int) -> None:
    """Nobody looks on."""


if __name__ == "__main__":
    demo_stroke().save()
