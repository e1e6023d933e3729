/* The WebSocket: receives the state and numbered changes of it, answers, and frames as bytes;
   sends requests.

   link.state          sections of the server's state by name
   link.on(name, act)  calls act(section) at once if it exists, and at every change
   link.order(room, order, with)  a promise of the answer; its error has a message for the user
   link.stop()         STOP, two ways at once */

export class Link extends EventTarget {
  constructor() {
    super();
    this.state = {};
    this.page = 0;
    this._number = 0;
    this._ids = 0;
    this._waiting = new Map();
    this._acts = new Map();
    this.frames = () => {};
    this.open = false;
    this._drew = 0;
    this._connect();
    // Sent from the main thread, so that a page that hangs sends nothing.
    setInterval(() => this._alive(), 100);
    document.addEventListener("visibilitychange", () => this._alive());
    addEventListener("pagehide", () => this._socket.close());
  }
  get controls() {
    return this.page > 0 && this.state.control?.holder === this.page;
  }
  on(name, act) {
    if (!this._acts.has(name)) this._acts.set(name, new Set());
    this._acts.get(name).add(act);
    if (this.state[name] !== undefined) act(this.state[name]);
    return () => this._acts.get(name).delete(act);
  }
  order(room, order, given = {}) {
    return new Promise((resolve, reject) => {
      if (!this.open) {
        reject(new Error("the studio does not respond; check that it still runs in its terminal"));
        return;
      }
      const id = ++this._ids;
      this._waiting.set(id, { resolve, reject });
      this._send({ id, room, order, with: given });
    });
  }
  stop() {
    const { stop_port: port, stop_token: token } = this.state.studio ?? {};
    const answers = [this.order("play", "stop")];
    // The player's own port responds even if the server hangs.
    if (port)
      answers.push(
        fetch(`http://127.0.0.1:${port}/stop`, {
          method: "POST",
          body: token,
          signal: AbortSignal.timeout(6000),
        }).then(answer => {
          if (!answer.ok) throw new Error("the player refused the request");
          return true;
        }),
      );
    return Promise.any(answers);
  }
  /** Return credit for messages that were drawn. */
  drew(count) {
    if (count && this.open) this._send({ drew: count });
  }
  _alive() {
    if (this.open) this._send({ alive: document.visibilityState === "visible" });
  }
  _send(said) {
    if (this._socket.readyState === WebSocket.OPEN) this._socket.send(JSON.stringify(said));
  }
  _connect() {
    this._socket = new WebSocket(`ws://${location.host}/socket`);
    this._socket.binaryType = "arraybuffer";
    this._socket.onopen = () => {
      this.open = true;
      this._alive();
      this.dispatchEvent(new Event("open"));
    };
    this._socket.onmessage = ({ data }) => {
      if (typeof data === "string") this._hear(JSON.parse(data));
      else this.frames(data);
    };
    this._socket.onclose = () => {
      const was = this.open;
      this.open = false;
      for (const { reject } of this._waiting.values())
        reject(new Error("the studio closed the connection"));
      this._waiting.clear();
      if (was) this.dispatchEvent(new Event("close"));
      setTimeout(() => this._connect(), 1000);
    };
  }
  _hear(said) {
    if (said.whole) {
      this.page = said.page;
      this._number = said.number;
      this.state = said.whole;
      for (const [name, acts] of this._acts)
        if (name in this.state) for (const act of acts) act(this.state[name]);
      return;
    }
    if (said.set) {
      if (said.number !== this._number + 1) {
        this._send({ whole: true });
        return;
      } // a change was missed
      this._number = said.number;
      Object.assign(this.state, said.set);
      for (const name of Object.keys(said.set))
        for (const act of this._acts.get(name) ?? []) act(said.set[name]);
      return;
    }
    const waiting = this._waiting.get(said.id);
    if (!waiting) return;
    this._waiting.delete(said.id);
    if (said.error) waiting.reject(new Error(said.error));
    else waiting.resolve(said.ok);
  }
}
