"""Remote control: clients play checked drives through JSON over WebSocket, or through OSC (docs/remote.md)."""

from .adaptics import serve_adaptics as serve_adaptics
from .messages import MESSAGES as MESSAGES
from .player import FramePlayer as FramePlayer
from .server import serve as serve
