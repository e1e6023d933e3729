"""Interactive views of frames, used by the studio, notebooks and standalone pages; also films and sound files."""

from midair.view.audio import ChannelSound, channel_sound, comparison_sounds
from midair.view.colours import TABLES, colour_table
from midair.view.film import Film, ffmpeg, write_gif, write_mp4
from midair.view.frame_encoding import Kind, Section, encode_counts, pack, phase_counts, unpack
from midair.view.interpolated_field import InterpolatedField, finer_points, fit_interpolation
from midair.view.page_payload import check_size, metadata, sections, size_of
from midair.view.pages import WEB, one_module, page_parts, show_page, style, with_content_policy
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
from midair.view.widget import iframe_page, in_notebook

__all__ = [
    "check_size",
    "in_notebook",
    "iframe_page",
    "comparison_sounds",
    "PalmMaps",
    "Part",
    "write_mp4",
    "write_gif",
    "ffmpeg",
    "Film",
    "channel_sound",
    "ChannelSound",
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
    "encode_counts",
    "fit_interpolation",
    "finer_points",
    "page_parts",
    "one_module",
    "pack",
    "film_of_palm",
    "phase_counts",
    "played_field",
    "with_content_policy",
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
