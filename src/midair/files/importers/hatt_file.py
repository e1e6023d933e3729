"""Recordings of the Penn Haptic Texture Toolkit (Culbertson et al., doi 10.1109/HAPTICS.2014.6775475), XML.

An element SampleRate in Hz; Accel with the numbers of one axis, or with the elements x, y and z; Speed, ForceNormal and
ForceTangential likewise. The capitals of a name do not matter. Written by a description of others, not tried on a file
of the toolkit.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError
from midair.files.opened_take import Format, ImportedData, ImportOptions


def read_hatt(path: Path, _: ImportOptions) -> ImportedData:
    """Read the acceleration; the median of force and speed become notes."""
    content = path.read_bytes()
    if b"<!" in content.replace(b"<!--", b""):
        # Declared entities can grow without limit.
        raise BrokenFileError("expected XML without declarations, got <!; remove them")
    elements = list(ElementTree.fromstring(content).iter())
    named = {each.tag.rpartition("}")[2].lower(): each for each in reversed(elements)}
    if "accel" not in named or "samplerate" not in named:
        raise BrokenFileError(f"expected elements Accel and SampleRate, got {', '.join(sorted(named))[:200]}")
    axes = {each.tag.rpartition("}")[2].lower(): _numbers(each) for each in named["accel"]}
    axes = axes or {"accel": _numbers(named["accel"])}
    medians = {name: _numbers(named[name]) for name in ("speed", "forcenormal") if name in named}
    return ImportedData(
        samples=np.stack(list(axes.values()), axis=1),
        form="XML of HaTT",
        rate=float(_numbers(named["samplerate"])[0]),
        names=tuple(axes),
        notes={f"median {name}": f"{np.median(each):.4g}" for name, each in medians.items() if len(each)},
    )


def _numbers(element: ElementTree.Element) -> Array:
    return np.array((element.text or "").replace(",", " ").split(), np.float64)


HATT = Format(name="HaTT", read=read_hatt, memory=4)
