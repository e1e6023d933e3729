/* Panel Calibrate: channels identified by taps, and the response of each with its uncertainty. */

import { buttonOf, make, panel, rows, tried } from "/web/dom.js";
import { listed, takeOf, takesList } from "/web/take.js";

export default class Calibrate {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.channel = 0;
    this.name = takeOf(studio.address.take);
    this._build();
    this._offs = [
      this.link.on("takes", () => this._takes()),
      this.link.on("taps", taps => this._taps(taps)),
    ];
  }
  leave() {
    this.left = true;
    for (const off of this._offs) off();
    this._watch?.disconnect();
  }
  moved({ take: one }) {
    const take = takeOf(one);
    if (take && take !== this.name) {
      this.name = take;
      this.looked = "";
      this._takes();
    }
  }
  control() {
    this.tap.disabled = !this.link.controls;
  }
  _build() {
    this.list = takesList();
    this.tap = buttonOf(
      "Tap each cell in turn",
      "Finds which channel belongs to which cell",
      () => tried(this.link.order("calibrate", "taps")),
      { class: "main", id: "tap" },
    );
    this.cells = make("div.cells");
    this.found = make(
      "div",
      { role: "status", "aria-live": "polite" },
      make(
        "p.quiet",
        {},
        "Finds which channel belongs to which cell. The page names the next cell to tap; a virtual sensor simulates the taps.",
      ),
    );
    this.box = make("div.box");
    this.words = make("div.card");
    this.chosen = panel("Response", "", this.box);
    this.studio.main.append(
      make(
        "div.calibrate",
        {},
        make(
          "div.column.left",
          {},
          panel("Channels by tap", null, this.tap, this.found),
          Object.assign(panel("Sensor of a take", null, this.list), { className: "panel grow" }),
        ),
        make(
          "div.middle",
          {},
          this.chosen,
          panel("Cells", "sensitivity at 100 Hz, and result of the taps", this.cells),
        ),
        panel("Uncertainty", null, this.words),
      ),
    );
    this.control();
  }
  _takes() {
    const takes = this.link.state.takes ?? [];
    this.name ||= takes[0]?.name ?? "";
    listed(
      this.list,
      takes.map(row =>
        make(
          "li",
          {},
          make(
            "a",
            {
              href: `#calibrate/${encodeURI(row.name)}`,
              "aria-current": row.name === this.name ? "true" : null,
            },
            row.name.replace(/^sample:/, "").replace(/\.h5$/, ""),
            make("small", {}, row.sample ? "sample" : ""),
          ),
        ),
      ),
    );
    // A sample is listed before its file exists; a take that was recorded again has a new stamp.
    const stamp = takes.find(row => row.name === this.name)?.stamp.split("-")[0],
      looked = `${this.name} ${stamp}`;
    if (this.name && this.looked !== looked) {
      this.looked = looked;
      this._look();
    }
  }
  async _look() {
    const found = await tried(this.link.order("calibrate", "look", { take: this.name }));
    if (this.left) return;
    this.known = found;
    this._watch?.disconnect();
    this.box.replaceChildren();
    if (!found) {
      this.words.replaceChildren(
        make(
          "p.quiet",
          {},
          "This take has no calibration. midair calibrate measures one on a test bench or against a reference sensor.",
        ),
      );
      this.box.append(make("div.nothing", {}, "not calibrated"));
      this._cellsShown();
      return;
    }
    this.words.replaceChildren(
      ...(found.simulated ? [make("p", {}, make("strong.simulated", {}, "SIMULATED"))] : []),
      make(
        "p",
        { className: found.dead.length ? "bad" : "good" },
        found.dead.length
          ? `dead, or less than 5 % as sensitive as the others: channel ${found.dead.join(", ")}`
          : "no dead channels",
      ),
      ...found.rows.flatMap(([name, value]) => [make("h3", {}, name), make("div", {}, value)]),
    );
    this._cellsShown();
    const canvas = make("canvas", { role: "img", tabIndex: 0 });
    Object.assign(canvas.style, { position: "absolute", inset: 0, width: "100%", height: "100%" });
    this.box.append(canvas);
    this.canvas = canvas;
    this._watch = new ResizeObserver(() => this._draw());
    this._watch.observe(this.box);
  }
  _cellsShown() {
    const { known } = this,
      taps = this.link.state.taps,
      count = known ? known.sensitivity.length : (taps?.channel?.length ?? 0),
      columns = known?.columns ?? 4;
    this.cells.style.gridTemplateColumns = count ? `repeat(${columns}, 1fr)` : "";
    this.cells.replaceChildren(
      count ? "" : make("p.quiet", {}, "No sensitivities: this take has no calibration."),
      ...Array.from({ length: count }, (_, cell) => {
        const channel = taps?.state === "done" ? taps.channel[cell] : null,
          doubtful = taps?.state === "done" && taps.doubtful.includes(cell),
          dead = known?.dead.includes(cell) || channel === -1,
          due = taps?.cell === cell && taps.state === "listens";
        return make(
          `button.cell${due ? ".due" : doubtful ? ".doubtful" : dead ? ".dead" : ""}`,
          {
            "aria-pressed": cell === this.channel ? "true" : "false",
            title: "Shows the response of this channel",
            onclick: () => {
              this.channel = cell;
              this._cellsShown();
              this._draw();
            },
          },
          make(
            "span",
            {},
            `cell ${cell}`,
            make("br"),
            due
              ? "tap now"
              : channel === null
                ? `${known ? known.sensitivity[cell].toPrecision(3) : "–"} ${known?.unit ?? ""}`
                : channel === -1
                  ? "nothing answered"
                  : `channel ${channel}${doubtful ? ", not certain" : ""}`,
          ),
        );
      }),
    );
  }
  _taps(taps) {
    this._cellsShown();
    if (!taps) return;
    if (taps.state === "listens")
      this.found.replaceChildren(
        make(
          "p",
          {},
          taps.cell === null ? "Touch nothing for a second …" : `Tap cell ${taps.cell} now.`,
        ),
      );
    else if (taps.state === "failed") this.found.replaceChildren(make("p.bad", {}, taps.error));
    else
      this.found.replaceChildren(
        make(
          "p",
          { className: taps.in_order && !taps.findings.length ? "good" : "bad" },
          taps.in_order && !taps.findings.length
            ? "Every channel belongs to its cell and responds."
            : "",
        ),
        ...taps.findings.map(said => make("p.bad", {}, said)),
        rows([
          ["smallest margin", `${Math.min(...taps.margin).toFixed(1)} dB to the next channel`],
        ]),
      );
  }
  _draw() {
    const { known, canvas, box, channel } = this;
    if (!known || !canvas) return;
    const ratio = devicePixelRatio || 1,
      w = (canvas.width = box.clientWidth * ratio),
      h = (canvas.height = box.clientHeight * ratio),
      pen = canvas.getContext("2d"),
      style = getComputedStyle(box),
      ink = name => style.getPropertyValue(name);
    const { frequency, response, uncertainty, unit } = known,
      left = 58 * ratio,
      base = h - 22 * ratio,
      all = response.flat().filter(value => value > 0),
      top = Math.max(...all) * 1.3,
      bottom = Math.max(Math.min(...all) / 1.3, top / 1e4);
    const x = f =>
        left +
        (Math.log(f / frequency[0]) / Math.log(frequency.at(-1) / frequency[0])) *
          (w - left - 10 * ratio),
      y = v => (Math.log(top / Math.max(v, bottom)) / Math.log(top / bottom)) * base;
    pen.clearRect(0, 0, w, h);
    pen.font = `${11 * ratio}px system-ui, sans-serif`;
    pen.lineWidth = ratio / 2;
    pen.strokeStyle = ink("--view-line");
    pen.fillStyle = ink("--view-quiet");
    for (const f of [10, 20, 50, 100, 200, 500, 1000, 2000])
      if (f >= frequency[0] && f <= frequency.at(-1)) {
        pen.beginPath();
        pen.moveTo(x(f), 0);
        pen.lineTo(x(f), base);
        pen.stroke();
        pen.textAlign = "center";
        pen.fillText(`${f} Hz`, x(f), h - 6 * ratio);
      }
    for (let v = 10 ** Math.ceil(Math.log10(bottom)); v <= top; v *= 10) {
      pen.beginPath();
      pen.moveTo(left, y(v));
      pen.lineTo(w, y(v));
      pen.stroke();
      pen.textAlign = "right";
      pen.fillText(`${v.toExponential(0)}`, left - 4 * ratio, y(v) + 4 * ratio);
    }
    const line = (values, colour, width, alpha = 1) => {
      pen.globalAlpha = alpha;
      pen.strokeStyle = colour;
      pen.lineWidth = width * ratio;
      pen.beginPath();
      values.forEach((v, i) =>
        i ? pen.lineTo(x(frequency[i]), y(v)) : pen.moveTo(x(frequency[i]), y(v)),
      );
      pen.stroke();
      pen.globalAlpha = 1;
    };
    response.forEach(values => line(values, ink("--view-trace"), 1, 0.35));
    if (uncertainty) {
      pen.fillStyle = ink("--view-second");
      pen.globalAlpha = 0.3;
      pen.beginPath();
      response[channel].forEach((v, i) =>
        pen.lineTo(x(frequency[i]), y(v * (1 + uncertainty[channel][i]))),
      );
      [...response[channel].keys()]
        .reverse()
        .forEach(i =>
          pen.lineTo(x(frequency[i]), y(response[channel][i] * (1 - uncertainty[channel][i]))),
        );
      pen.fill();
      pen.globalAlpha = 1;
    }
    line(response[channel], ink("--view-second"), 2.2);
    this.chosen.aside.textContent =
      `${unit}; channel ${channel} ` +
      `bold${uncertainty ? ", its uncertainty (k = 2) around it" : ", no uncertainty: stated, not measured"}`;
    canvas.setAttribute(
      "aria-label",
      `Response of channel ${channel} over frequency, ${response[channel][0].toPrecision(2)} ` +
        `${unit} at ${frequency[0]} Hz to ${response[channel].at(-1).toPrecision(2)} ${unit} ` +
        `at ${Math.round(frequency.at(-1))} Hz`,
    );
  }
}
