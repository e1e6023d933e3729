"""The stroke that a page shows before the samples are computed, stored with the program.

It is the beginning of a sample, with identical frames. ``python -m midair.studio.demo_stroke`` computes the file again.
"""

import json
import lzma
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from midair.files import write_file

KEPT = Path(__file__).parent / "first-stroke.xz"

FIRST = "towel"
"""Name of the sample that the stroke is taken from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoStroke:
    """Facts and frames of the stroke, as a page requests them."""

    facts: Mapping[str, Any]
    """As returned by `take_data.facts`."""
    streams: Mapping[tuple[str, int], bytes]
    """Packed sections by name of the stream ("samples", "wanted") and second."""

    @classmethod
    def load(cls, path: Path = KEPT) -> Self:
        """Load the stroke that is stored with the program."""
        head, _, rest = lzma.decompress(path.read_bytes()).partition(b"\n")
        said, at = json.loads(head), 0
        streams: dict[tuple[str, int], bytes] = {}
        for stream, second, size in said["streams"]:
            streams[stream, second] = rest[at : at + size]
            at += size
        return cls(facts=said["facts"], streams=streams)

    def save(self, path: Path = KEPT) -> None:
        """Write the stroke as a compressed file."""
        sizes = [[stream, second, len(data)] for (stream, second), data in self.streams.items()]
        head = json.dumps({"facts": self.facts, "streams": sizes}).encode()
        write_file(path, lzma.compress(b"\n".join([head, b"".join(self.streams.values())]), preset=9))


def demo_stroke() -> DemoStroke:
    """Record the sample; its target has only 8 bits, since the page replaces it soon."""
    from midair.studio.take_data import TakeData, facts, frames_of
    from midair.studio.work import make_sample
    from midair.view import encode_counts, pack, unpack

    with tempfile.TemporaryDirectory() as folder:
        make_sample((folder, FIRST), lambda _stage, _done, _total: None)
        data = TakeData(take=str(Path(folder) / f"{FIRST}.h5"))
        about = facts(data)
        streams: dict[tuple[str, int], bytes] = {}
        for second in range(int(about["frames"] // about["rate_hz"]) + 1):
            streams["samples", second] = frames_of((data, "samples", second))
            [wanted] = unpack(frames_of((data, "wanted", second)))
            values = wanted.values * wanted.unit
            streams["wanted", second] = pack(
                [encode_counts(values, wanted.kind, dtype="u1", first=wanted.first, rate=about["rate_hz"])]
            )
    return DemoStroke(facts=about, streams=streams)


if __name__ == "__main__":
    demo_stroke().save()
