"""Interactive views of frames, used by the studio, notebooks and standalone pages; also films and sound files."""

from midair.view.audio import AudibleChannel, audible, heard_together
from midair.view.colours import TABLES, colour_table
from midair.view.film import Film, ffmpeg, write_gif, write_mp4
from midair.view.frame_encoding import Kind, Section, counted, pack, phase_counts, unpack
from midair.view.interpolated_field import InterpolatedField, finer, finer_points
from midair.view.page_payload import check_size, metadata, sections, size_of
from midair.view.pages import WEB, inlined, one_module, sealed, show_page, style
from midair.view.palm_film import PalmMaps, film_of_palm
from midair.view.view_data import (
    Channels,
    Part,
    Sound,
    ViewData,
    played_field,
    show_comparison,
    show_drive,
    show_recording,
    show_target,
)
from midair.view.widget import framed_page, in_notebook

__all__ = [
    "check_size",
    "in_notebook",
    "framed_page",
    "heard_together",
    "PalmMaps",
    "Part",
    "write_mp4",
    "write_gif",
    "ffmpeg",
    "Film",
    "audible",
    "AudibleChannel",
    "Channels",
    "InterpolatedField",
    "Kind",
    "Section",
    "ViewData",
    "Sound",
    "TABLES",
    "WEB",
    "metadata",
    "colour_table",
    "counted",
    "finer",
    "finer_points",
    "inlined",
    "one_module",
    "pack",
    "film_of_palm",
    "phase_counts",
    "played_field",
    "sealed",
    "sections",
    "show_comparison",
    "show_drive",
    "show_page",
    "show_recording",
    "show_target",
    "size_of",
    "style",
    "unpack",
]
