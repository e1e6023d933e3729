"""Remote control: clients play checked drives through JSON over WebSocket, or through OSC (docs/remote.md)."""
