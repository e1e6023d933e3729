"""Ultraleap's tracking service: a real WebSocket that sends frames of protocol version 6."""

import json
import threading
import time

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve


def frame(number, stamp, values, confidence=1.0, hand=7):
    """A frame with one hand; `values` are m with z up, `stamp` s."""
    x, y, z, nx, ny, nz, dx, dy, dz = values
    place, axes = [1e3 * x, 1e3 * z, -1e3 * y], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    still = {"r": axes, "s": 1.0, "t": [0, 0, 0]}
    box = {"center": [0, 200, 0], "size": [235, 235, 147]}
    palm = {
        "palmPosition": place,
        "palmNormal": [nx, nz, -ny],
        "direction": [dx, dz, -dy],
        "stabilizedPalmPosition": place,
    }
    size = {"palmWidth": 85.0, "grabStrength": 0.0, "pinchStrength": 0.0, "sphereCenter": [0, 0, 0], "sphereRadius": 50}
    arm = {"armBasis": axes, "armWidth": 60.0, "elbow": [0, 0, 0], "wrist": [0, 0, 0]}
    moves = {"palmVelocity": [0, 0, 0], "stabilizedPalmPosition": place}
    seen = {"id": hand, "type": "right", "confidence": confidence, "timeVisible": number / 110}
    about = {"currentFrameRate": 110.0, "id": number, "timestamp": round(stamp * 1e6), "interactionBox": box}
    one = {**seen, **palm, **size, **still, **arm, **moves}
    return {**about, **still, "gestures": [], "pointables": [], "hands": [one]}


class LeapServer:
    """Sends to each client that has asked for frames in the background or in focus."""

    def __init__(self, port=0):
        self.clients = []
        self.asked = threading.Event()
        self.paths = []
        self._server = serve(self._serve, "127.0.0.1", port, compression=None)
        self.port = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def _serve(self, client):
        self.paths.append(client.request.path)
        client.send(json.dumps({"serviceVersion": "5.0.0", "version": 6}))
        try:
            for message in client:
                said = json.loads(message)
                if said.get("background") or said.get("focused"):
                    if client not in self.clients:
                        self.clients.append(client)
                    self.asked.set()
        except ConnectionClosed:
            pass

    def send(self, content):
        text = content if isinstance(content, str) else json.dumps(content)
        for client in list(self.clients):
            try:
                client.send(text)
            except ConnectionClosed:
                self.clients.remove(client)

    def play(self, palm, *, most=None):
        """The poses of a path at their times."""
        begun = time.monotonic()
        for number, (at, *values, confidence) in enumerate(palm.rows.tolist()[:most]):
            time.sleep(max(0.0, begun + at - palm.time[0] - time.monotonic()))
            self.send(frame(number, 1000 + at, values, confidence))

    def close(self):
        self._server.shutdown()
        for client in list(self.clients):
            client.close()
        self._thread.join(5)
