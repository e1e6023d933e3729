"""Remote control: clients play checked drives through JSON over WebSocket, or through OSC."""

from .server import serve as serve
