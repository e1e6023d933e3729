"""The page's own files."""

from pathlib import Path

WEB = Path(__file__).parent / "web"
"""Folder of view.js (canvases), transport.js (time) and page.js (a whole page of both): ES modules without others."""
