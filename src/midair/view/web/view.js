/* All canvases of midair, and the tracks that they draw. One file without imports, since a notebook
   needs a single file.

   decode(buffer)            the sections of frame_encoding.py, objects with
                             {kind, type, number, time, first, frames, width, unit, values}
   Track                     consecutive frames of one kind: a whole take, or the end of a live feed
   SparseTrack               irregular frames (phases at 15 Hz): `at(frame)` is the last up to it
   Picture(box, {...})       a canvas as large as its box; `.draw(state)` paints it
     FieldPicture            complex field or magnitude: colours by magnitude or by phase
     CellsPicture            signal of each cell of the sensor
     TracesPicture           all channels around the playhead, one track over another
     PhasesPicture           phases of the transducers at their positions
     SpectrogramPicture      one channel, frequency over time
     OverviewPicture         the whole take: playhead, loop, marks; can be dragged
     BarPicture              colour scale

   state: {frame, from, channel, span, phase, loop: {from, to, on}, marks}. `from` to `frame` are
   the frames since the last picture: fields and cells show their rms, or one frame if both are
   equal. A picture keeps its content until the next draw. */

export const KINDS = { samples: 1, field: 2, phases: 3, meters: 4, marks: 5 };
const TYPES = { 1: Int8Array, 2: Int16Array, 3: Float32Array, 4: Uint8Array };
const HEADER = 32;

/** Decode the sections that frame_encoding.py packs. */
export function decode(buffer) {
  const bytes =
    buffer instanceof ArrayBuffer
      ? buffer
      : buffer.buffer.slice(buffer.byteOffset, buffer.byteOffset + buffer.byteLength);
  const view = new DataView(bytes),
    sections = [];
  for (let at = 0; at < bytes.byteLength;) {
    if (bytes.byteLength - at < HEADER)
      throw new Error(`section at byte ${at}: expected a header of ${HEADER} bytes`);
    const kind = view.getUint8(at + 2),
      type = view.getUint8(at + 3),
      Values = TYPES[type];
    if (
      view.getUint8(at) !== 0x6d ||
      view.getUint8(at + 1) !== 1 ||
      !(kind >= 1 && kind <= 5) ||
      !Values
    )
      throw new Error(`section at byte ${at}: unknown version or type; reload the page`);
    const frames = view.getUint16(at + 24, true),
      width = view.getUint16(at + 26, true);
    const end = at + HEADER + frames * width * Values.BYTES_PER_ELEMENT;
    if (end > bytes.byteLength) throw new Error(`section at byte ${at}: incomplete data`);
    sections.push({
      kind,
      type,
      frames,
      width,
      number: view.getUint32(at + 4, true),
      time: view.getFloat64(at + 8, true),
      first: Number(view.getBigUint64(at + 16, true)),
      unit: view.getFloat32(at + 28, true),
      // A copy: sections are not aligned, but typed arrays must begin at a multiple of their
      // element size.
      values: new Values(bytes.slice(at + HEADER, end)),
    });
    at = end;
  }
  return sections;
}

/** Bytes of a base64 text. */
export function bytesOf(text) {
  const raw = atob(text),
    bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

/** Consecutive frames of one kind; the last `capacity` frames are kept. A lost frame is NaN. */
export class Track {
  constructor({ rate, capacity, unit = "", name = "", label = "" }) {
    Object.assign(this, { rate, capacity, unit, name, label });
    this.first = this.last = 0; // kept: first to last - 1
    this.width = 0;
    this.lost = 0;
    this.version = 0; // counts the sections; a number from the start, since `top` is cached by it
  }
  add(section) {
    if (!this.values) {
      this.width = section.width;
      this.values = new section.values.constructor(this.capacity * section.width);
      this.units = new Float32Array(this.capacity);
      this.first = this.last = section.first;
    }
    if (section.first > this.last) {
      this.lost += section.first - this.last;
      for (let f = Math.max(this.last, section.first - this.capacity); f < section.first; f++)
        this.units[f % this.capacity] = NaN;
    }
    for (let i = 0; i < section.frames; i++) {
      const slot = (section.first + i) % this.capacity;
      this.values.set(
        section.values.subarray(i * this.width, (i + 1) * this.width),
        slot * this.width,
      );
      this.units[slot] = section.unit;
    }
    this.last = Math.max(this.last, section.first + section.frames);
    this.first = Math.max(this.first, this.last - this.capacity);
    this.version++;
    return this;
  }
  has(frame) {
    return frame >= this.first && frame < this.last;
  }
  /** One value of one frame; NaN if the frame is missing. */
  value(frame, index) {
    if (!this.has(frame)) return NaN;
    const slot = frame % this.capacity;
    return this.values[slot * this.width + index] * this.units[slot];
  }
  /** Copy the values of a frame into `out`; false if it is missing. */
  read(frame, out) {
    if (!this.has(frame)) return false;
    const slot = frame % this.capacity,
      unit = this.units[slot],
      at = slot * this.width;
    if (Number.isNaN(unit)) return false;
    for (let i = 0; i < this.width; i++) out[i] = this.values[at + i] * unit;
    return true;
  }
  /** Largest magnitude of one frame. */
  loudness(frame) {
    if (!this.has(frame)) return 0;
    const slot = frame % this.capacity,
      at = slot * this.width;
    let most = 0;
    for (let i = 0; i < this.width; i++) most = Math.max(most, Math.abs(this.values[at + i]));
    return most * this.units[slot] || 0;
  }
  /** Largest magnitude of all kept frames, for colour scales. */
  get top() {
    if (this._toppedAt !== this.version) {
      this._top = 0;
      for (let f = this.first; f < this.last; f++)
        this._top = Math.max(this._top, this.loudness(f));
      this._toppedAt = this.version;
    }
    return this._top;
  }
}

/** Frames at irregular times. */
export class SparseTrack {
  constructor({ capacity = Infinity } = {}) {
    this.capacity = capacity;
    this.rows = [];
  }
  add(section) {
    for (let i = 0; i < section.frames; i++)
      this.rows.push({
        frame: section.first + i,
        values: section.values.subarray(i * section.width, (i + 1) * section.width),
      });
    if (this.rows.length > this.capacity) this.rows.splice(0, this.rows.length - this.capacity);
    return this;
  }
  at(frame) {
    let low = 0,
      high = this.rows.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.rows[middle].frame <= frame) low = middle + 1;
      else high = middle;
    }
    return low ? this.rows[low - 1].values : null;
  }
}

/** A table of 256 colours (768 bytes: red, green, blue) for pixels and for CSS. */
export class Colours {
  constructor(bytes) {
    this.pixels = new Uint32Array(256); // little-endian: alpha, blue, green, red
    this.css = [];
    for (let i = 0; i < 256; i++) {
      const [r, g, b] = bytes.subarray(3 * i, 3 * i + 3);
      this.pixels[i] = (255 << 24) | (b << 16) | (g << 8) | r;
      this.css.push(`rgb(${r} ${g} ${b})`);
    }
  }
}

const INK = {
  ink: "--view-ink",
  quiet: "--view-quiet",
  line: "--view-line",
  ground: "--view-ground",
  trace: "--view-trace",
  second: "--view-second",
  accent: "--view-accent",
};
const FALLBACK = {
  ink: "#1b1f24",
  quiet: "#57606a",
  line: "#8c959f",
  ground: "#ffffff",
  trace: "#0b62a8",
  second: "#b4500a",
  accent: "#b35900",
};

/** A canvas as large as its box, in device pixels, with a text description for screen readers. */
export class Picture {
  constructor(box, { label, role = "img" }) {
    this.box = box;
    this.label = label;
    this.canvas = box.ownerDocument.createElement("canvas");
    Object.assign(this.canvas.style, {
      position: "absolute",
      inset: "0",
      width: "100%",
      height: "100%",
      display: "block",
    });
    if (getComputedStyle(box).position === "static") box.style.position = "relative";
    this.canvas.setAttribute("role", role);
    this.canvas.tabIndex = 0;
    this.said = box.ownerDocument.createElement("span"); // the value under pointer or arrows
    this.said.className = "view-said";
    this.said.setAttribute("aria-live", "polite");
    box.append(this.canvas, this.said);
    this.context = this.canvas.getContext("2d");
    this.state = null;
    this._watch = new ResizeObserver(([entry]) => this._fit(entry));
    try {
      this._watch.observe(box, { box: "device-pixel-content-box" });
    } catch {
      this._watch.observe(box);
    }
    this._schemes = ["(prefers-color-scheme: dark)", "print"].map(query => matchMedia(query));
    this._repaint = () => {
      this._ink = null;
      this._stale?.();
      this.draw();
    };
    for (const scheme of this._schemes) scheme.addEventListener("change", this._repaint);
    this.canvas.addEventListener("pointermove", event => this._tell(event.offsetX, event.offsetY));
    this.canvas.addEventListener("pointerleave", () => {
      this.said.textContent = "";
    });
    this.canvas.setAttribute("aria-label", label); // a description is added with the first picture
  }
  /** Paint a state, or the last one again. */
  draw(state = this.state) {
    this.state = state;
    if (!state || !this.canvas.width || !this.canvas.height) return;
    this.paint(this.context, this.canvas.width, this.canvas.height, state);
    const now = performance.now();
    // For screen readers: update the description at most once per second.
    clearTimeout(this._later);
    if (!(now - this._named < 1000)) this._name();
    else this._later = setTimeout(() => this._name(), 1000);
  }
  remove() {
    clearTimeout(this._later);
    this._watch.disconnect();
    for (const scheme of this._schemes) scheme.removeEventListener("change", this._repaint);
    this.canvas.remove();
    this.said.remove();
  }
  get summary() {
    return "";
  }
  /** Text of the value at a position of the canvas, in CSS pixels. */
  valueAt() {
    return "";
  }
  /** Device pixels per CSS pixel. */
  get ratio() {
    // Cached: every text needs it, and reading the width of the canvas forces a layout of the page.
    const key = `${this.canvas.width} ${devicePixelRatio}`;
    if (this._ratioOf !== key)
      Object.assign(this, {
        _ratioOf: key,
        _ratio: this.canvas.width / (this.canvas.clientWidth || this.canvas.width) || 1,
      });
    return this._ratio;
  }
  get colour() {
    if (!this._ink) {
      const style = getComputedStyle(this.box);
      this._ink = Object.fromEntries(
        Object.entries(INK).map(([name, property]) => [
          name,
          style.getPropertyValue(property).trim() || FALLBACK[name],
        ]),
      );
    }
    return this._ink;
  }
  text(
    words,
    x,
    y,
    { align = "left", base = "middle", size = 11, weight = "", colour = this.colour.quiet } = {},
  ) {
    const { context } = this;
    context.font = `${weight} ${size * this.ratio}px system-ui, sans-serif`;
    context.textAlign = align;
    context.textBaseline = base;
    context.fillStyle = colour;
    context.fillText(words, x, y);
  }
  clear(width, height, colour = this.colour.ground) {
    this.context.fillStyle = colour;
    this.context.fillRect(0, 0, width, height);
  }
  say(words) {
    const now = performance.now();
    clearTimeout(this._saying);
    const put = () => {
      this._said = performance.now();
      this.said.textContent = words;
    };
    if (!(now - this._said < 1000)) put();
    else this._saying = setTimeout(put, 1000 - (now - this._said));
  }
  _tell(x, y) {
    const words = this.valueAt(x, y);
    if (words) this.say(words);
  }
  _name() {
    this._named = performance.now();
    const words = this.summary ? `${this.label}: ${this.summary}` : this.label;
    if (this.canvas.getAttribute("aria-label") !== words)
      this.canvas.setAttribute("aria-label", words);
  }
  _fit(entry) {
    const device = entry.devicePixelContentBoxSize?.[0],
      ratio = devicePixelRatio || 1;
    const width = device ? device.inlineSize : Math.round(entry.contentRect.width * ratio);
    const height = device ? device.blockSize : Math.round(entry.contentRect.height * ratio);
    if (width === this.canvas.width && height === this.canvas.height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this._stale?.();
    this.draw();
  }
}

/** Share of the side of a map with `points` that `shown` pixels cover; finer pixels lie from the
    first point to the last. */
const covered = (points, shown) =>
  shown > points && points > 1 ? (shown * (points - 1)) / (shown - 1) / points : 1;

/** A map of rows and columns: pixels, cells over it, values under pointer and arrows. */
class MapPicture extends Picture {
  /* `place`: {pitch, x, y} in mm: pitch of the track's grid, and position of its centre. */
  constructor(box, options) {
    super(box, options);
    const { rows, columns, place, unit = "Pa", cells = null } = options;
    Object.assign(this, { rows, columns, place, unit, cells });
    this._small = box.ownerDocument.createElement("canvas");
    this.chosen = null; // the cell selected with the arrow keys
    this.peak = null;
    this.canvas.addEventListener("keydown", event => this._arrow(event));
  }
  size(rows, columns) {
    if (this.shownRows === rows && this.shownColumns === columns) return;
    Object.assign(this, { shownRows: rows, shownColumns: columns });
    // Finer points lie from the first point to the last, so their pixels cover a little less than
    // those of the points.
    this.cover = { w: covered(this.columns, columns), h: covered(this.rows, rows) };
    this._small.width = columns;
    this._small.height = rows;
    this._image = this._small.getContext("2d").createImageData(columns, rows);
    this.pixels = new Uint32Array(this._image.data.buffer);
    this.shown = new Float32Array(rows * columns);
  }
  /** Draw `this.pixels` with the largest square pixels that fit. */
  put(context, width, height) {
    const scale = Math.min(width / this.columns, height / this.rows);
    const centred = (w, h) => ({ x: (width - w) / 2, y: (height - h) / 2, w, h });
    const area = centred(scale * this.columns, scale * this.rows),
      { x, y, w, h } = (this.area = centred(area.w * this.cover.w, area.h * this.cover.h));
    this._small.getContext("2d").putImageData(this._image, 0, 0);
    this.clear(width, height);
    if (this.edge) {
      context.fillStyle = this.edge;
      context.fillRect(area.x, area.y, area.w, area.h);
    }
    context.imageSmoothingEnabled = false;
    context.drawImage(this._small, x, y, w, h);
    if (this.cells) this._cells(context, area, scale / this.place.pitch);
    this._ruler(context, area, scale / this.place.pitch);
    if (this.chosen) this._ring(context, this.area);
  }
  findPeak() {
    let at = -1,
      most = 0;
    for (let i = 0; i < this.shown.length; i++)
      if (this.shown[i] > most) {
        most = this.shown[i];
        at = i;
      }
    this.peak =
      at < 0
        ? null
        : {
            value: most,
            row: Math.floor(at / this.shownColumns),
            column: at % this.shownColumns,
            ...this.whereIs(at % this.shownColumns, Math.floor(at / this.shownColumns)),
          };
  }
  /** Centre of a pixel in mm. */
  whereIs(column, row) {
    const { pitch, x, y } = this.place;
    return {
      x: x + ((column + 0.5) / this.shownColumns - 0.5) * this.columns * pitch * this.cover.w,
      y: y + ((row + 0.5) / this.shownRows - 0.5) * this.rows * pitch * this.cover.h,
    };
  }
  get summary() {
    if (!this.peak) return "silent";
    return `peak ${said(this.peak.value)} ${this.unit} at ${said(this.peak.x, 2)}, ${said(this.peak.y, 2)} mm`;
  }
  valueAt(x, y) {
    const { area, ratio } = this;
    if (!area) return "";
    const column = Math.floor(((x * ratio - area.x) / area.w) * this.shownColumns),
      row = Math.floor(((y * ratio - area.y) / area.h) * this.shownRows);
    return column >= 0 && row >= 0 && column < this.shownColumns && row < this.shownRows
      ? this._words(column, row)
      : "";
  }
  _words(column, row) {
    const where = this.whereIs(column, row);
    return `${said(this.shown[row * this.shownColumns + column])} ${this.unit} at ${said(where.x, 2)}, ${said(where.y, 2)} mm`;
  }
  _arrow(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[
      event.key
    ];
    if (!step || !this.shownColumns || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const from = this.chosen ?? { column: this.shownColumns >> 1, row: this.shownRows >> 1 };
    const clip = (value, most) => Math.min(most - 1, Math.max(0, value));
    this.chosen = {
      column: clip(from.column + step[0], this.shownColumns),
      row: clip(from.row + step[1], this.shownRows),
    };
    this.say(this._words(this.chosen.column, this.chosen.row));
    this.draw();
  }
  _cells(context, area, scale) {
    const { rows, columns, pitch } = this.cells,
      left = area.x + area.w / 2 - ((columns / 2) * pitch + this.place.x) * scale,
      top = area.y + area.h / 2 - ((rows / 2) * pitch + this.place.y) * scale;
    context.strokeStyle = "rgb(255 255 255 / .45)";
    context.lineWidth = Math.max(1, this.ratio);
    context.beginPath();
    for (let i = 0; i <= columns; i++) {
      context.moveTo(left + i * pitch * scale, top);
      context.lineTo(left + i * pitch * scale, top + rows * pitch * scale);
    }
    for (let i = 0; i <= rows; i++) {
      context.moveTo(left, top + i * pitch * scale);
      context.lineTo(left + columns * pitch * scale, top + i * pitch * scale);
    }
    context.stroke();
  }
  /** Draw a scale bar of 10 mm. */
  _ruler(context, area, scale) {
    const { ratio } = this,
      long = nice(Math.max((this.columns * this.place.pitch) / 8, 1e-9)),
      x = area.x + 8 * ratio,
      y = area.y + area.h - 9 * ratio;
    context.fillStyle = "#000";
    context.fillRect(x - ratio, y - ratio, long * scale + 2 * ratio, 4 * ratio);
    context.fillStyle = "#fff";
    context.fillRect(x, y, long * scale, 2 * ratio);
    context.strokeStyle = "#000";
    context.lineWidth = 3 * ratio;
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.strokeText(`${said(long)} mm`, x, y - 2 * ratio);
    context.fillText(`${said(long)} mm`, x, y - 2 * ratio);
  }
  _ring(context, area) {
    const w = area.w / this.shownColumns,
      h = area.h / this.shownRows;
    context.lineWidth = 3 * this.ratio;
    context.strokeStyle = "#000";
    context.strokeRect(area.x + this.chosen.column * w, area.y + this.chosen.row * h, w, h);
    context.lineWidth = this.ratio;
    context.strokeStyle = "#fff";
    context.strokeRect(area.x + this.chosen.column * w, area.y + this.chosen.row * h, w, h);
  }
}

/** The field in a plane. A track with 2 values per point is complex, with 1 a magnitude.
    `down`, `across`: Float32Array of (finer row, row), (finer column, column); without them each point is one pixel. */
export class FieldPicture extends MapPicture {
  constructor(box, options) {
    super(box, options);
    const {
      track,
      colours,
      phaseColours = null,
      down = null,
      across = null,
      top = null,
      quiet = 0.05,
      most = 20,
    } = options;
    Object.assign(this, { track, colours, phaseColours, down, across, top, quiet, most });
  }
  get complex() {
    return this.track.width === 2 * this.rows * this.columns;
  }
  paint(context, width, height, state) {
    const { rows, columns, track } = this,
      finer = this.complex && this.down && this.across;
    const R = finer ? this.down.length / rows : rows,
      C = finer ? this.across.length / columns : columns;
    this.size(R, C);
    this._frame ??= new Float32Array(track.width || 2 * rows * columns);
    // A track without frames does not yet know whether it is complex.
    if (this.field?.length !== 2 * R * C) {
      this.field = new Float32Array(2 * R * C);
      this._half = null;
    }
    const byPhase = state.phase && this.complex && this.phaseColours,
      power = this.shown.fill(0);
    let count = 0;
    const first = byPhase ? state.frame : Math.min(state.from ?? state.frame, state.frame);
    // Use some evenly spaced frames of many (67 per picture at 4 kHz): each finer field needs 160
    // 000 products.
    const step = finer ? Math.ceil((state.frame - first + 1) / this.most) : 1;
    for (let f = state.frame; f >= first; f -= step) {
      if (!track.read(f, this._frame)) continue;
      count++;
      if (!this.complex) {
        for (let i = 0; i < power.length; i++) power[i] += this._frame[i] ** 2;
        continue;
      }
      if (finer) this._finer(this._frame, R, C);
      else this.field.set(this._frame);
      const field = this.field;
      for (let i = 0, j = 0; i < power.length; i++, j += 2)
        power[i] += field[j] * field[j] + field[j + 1] * field[j + 1];
    }
    for (let i = 0; i < power.length; i++) power[i] = Math.sqrt(power[i] / (count || 1));
    this.findPeak();
    const top = this.top ?? track.top;
    this.edge = byPhase ? null : this.colours.css[0];
    if (byPhase) this._byPhase(top);
    else this._byMagnitude(top);
    this.put(context, width, height);
  }
  /** field = down frame across', complex pairs; the matrices are real. */
  _finer(frame, R, C) {
    const { rows, columns, down, across, field } = this,
      half = (this._half ??= new Float32Array(2 * R * columns));
    half.fill(0);
    for (let r = 0; r < R; r++)
      for (let k = 0; k < rows; k++) {
        const weight = down[r * rows + k],
          from = 2 * k * columns,
          to = 2 * r * columns;
        for (let c = 0; c < 2 * columns; c++) half[to + c] += weight * frame[from + c];
      }
    for (let r = 0; r < R; r++)
      for (let c = 0; c < C; c++) {
        let re = 0,
          im = 0;
        for (let k = 0, h = 2 * r * columns, a = c * columns; k < columns; k++, h += 2) {
          re += across[a + k] * half[h];
          im += across[a + k] * half[h + 1];
        }
        field[2 * (r * C + c)] = re;
        field[2 * (r * C + c) + 1] = im;
      }
  }
  _byMagnitude(top) {
    const { shown, pixels } = this,
      table = this.colours.pixels,
      scale = top > 0 ? 255 / top : 0;
    for (let i = 0; i < pixels.length; i++)
      pixels[i] = table[Math.min(255, Math.round(shown[i] * scale))];
  }
  _byPhase(top) {
    const { shown, pixels, field } = this,
      table = this.phaseColours.pixels,
      least = this.quiet * top;
    for (let i = 0; i < pixels.length; i++)
      // Phase is undefined where the magnitude is small: transparent.
      pixels[i] =
        shown[i] > least
          ? table[
              Math.floor((Math.atan2(field[2 * i + 1], field[2 * i]) / (2 * Math.PI) + 1) * 256) &
                255
            ]
          : 0;
  }
  _words(column, row) {
    const words = super._words(column, row),
      i = 2 * (row * this.shownColumns + column);
    if (!this.state?.phase || !this.complex) return words;
    return `${words}, phase ${said(Math.atan2(this.field[i + 1], this.field[i]), 2)} rad`;
  }
}

/** Signal of each cell of the sensor: rms of the frames since the last picture. */
export class CellsPicture extends MapPicture {
  constructor(box, options) {
    super(box, options);
    const { track, colours, top = null } = options;
    Object.assign(this, { track, colours, top });
  }
  paint(context, width, height, state) {
    this.size(this.rows, this.columns);
    if (this._frame?.length !== this.track.width) this._frame = new Float32Array(this.track.width);
    const power = this.shown.fill(0);
    let count = 0;
    for (let f = Math.min(state.from ?? state.frame, state.frame); f <= state.frame; f++)
      if (this.track.read(f, this._frame)) {
        count++;
        for (let i = 0; i < power.length; i++) power[i] += this._frame[i] ** 2;
      }
    const scale = 255 / (this.top ?? this.track.top) || 0;
    for (let i = 0; i < power.length; i++) {
      power[i] = Math.sqrt(power[i] / (count || 1));
      this.pixels[i] = this.colours.pixels[Math.min(255, Math.round(power[i] * scale))];
    }
    this.findPeak();
    this.put(context, width, height);
  }
}

/** All channels, `state.span` seconds around the playhead, on one scale; a second track is drawn
    over the first. */
export class TracesPicture extends Picture {
  constructor(box, options) {
    super(box, options);
    const {
      track,
      over = null,
      names = null,
      choose = null,
      seek = null,
      head = true,
      zoom = null,
      show = null,
    } = options;
    Object.assign(this, { track, over, names, choose, seek, head });
    const { canvas } = this;
    let drag = null;
    canvas.addEventListener("pointerdown", event => {
      // With zoom by dragging, a press counts when it is released: the traces stay in place
      // meanwhile.
      if (!show || event.button) this._press(event);
      else drag = { x: event.offsetX, frame: this._frame(event.offsetX) };
    });
    canvas.addEventListener("pointermove", event => {
      if (!drag || !event.buttons || Math.abs(event.offsetX - drag.x) < 8) return;
      this.range = [drag.x, event.offsetX];
      this.draw();
    });
    canvas.addEventListener("pointerup", event => {
      const done = drag,
        dragged = this.range;
      drag = this.range = null;
      if (dragged) show(...[done.frame, this._frame(event.offsetX)].sort((a, b) => a - b));
      else if (done) this._press(event);
    });
    for (const name of ["pointerleave", "pointercancel"])
      canvas.addEventListener(name, () => {
        if (drag) {
          drag = this.range = null;
          this.draw();
        }
      });
    if (zoom)
      canvas.addEventListener(
        "wheel",
        event => {
          event.preventDefault();
          zoom(event.deltaY > 0 ? 1.25 : 0.8);
        },
        { passive: false },
      );
    this.canvas.addEventListener("keydown", event => {
      const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
      if (!step || !this.choose) return;
      event.preventDefault();
      event.stopPropagation();
      this.choose(Math.min(this.track.width - 1, Math.max(0, (this.state?.channel ?? 0) + step)));
      this._name();
    });
  }
  get summary() {
    const { state, track } = this;
    if (!state) return "";
    const channel = state.channel ?? 0,
      value = track.value(state.frame, channel);
    return `${said(state.frame / track.rate, 4)} s, ${this._channelName(channel)} ${Number.isNaN(value) ? "lost" : `${said(value)} ${track.unit}`}`;
  }
  _channelName(channel) {
    return this.names?.[channel] ?? `channel ${channel}`;
  }
  paint(context, width, height, state) {
    const { ratio, colour, track } = this,
      left = Math.round(34 * ratio),
      base = height - Math.round(18 * ratio),
      span = (state.span ?? 1) * track.rate;
    // The scale bar has a place of its own at the right.
    const w = width - left - Math.round(56 * ratio),
      step = w / span,
      lane = base / (track.width || 1),
      all = Math.max(track.top, this.over?.top ?? 0);
    // A running trace moves by whole pixels, so that its old part can be copied, and its scale
    // rarely changes.
    const top = this.head ? all : this._steady(all),
      begin = this.head
        ? state.frame - span / 2
        : Math.ceil((state.frame - span / 2) * step) / step;
    this.lanes = { left, w, lane, begin, span };
    const scale = top > 0 ? (0.48 * lane * Math.min(4, Math.max(1, track.width / 4))) / top : 0;
    const from = this._moved(context, base, Math.round(begin * step), [
      track,
      this.over,
      this.head,
      width,
      height,
      scale,
      step,
      state.channel,
      colour,
    ]);
    context.save();
    context.beginPath();
    if (from > left) context.rect(from, 0, width - from, base);
    else context.rect(0, 0, width, height);
    context.clip();
    this.clear(width, height);
    context.beginPath();
    context.rect(left, 0, w, base);
    context.clip();
    const ticks = this._axis(context, base);
    // The wide line below is seen on both sides of the other.
    this._lines(context, track, colour.trace, scale, from, this.over ? 2 : 1);
    if (this.over) this._lines(context, this.over, colour.second, scale, from);
    context.fillStyle = colour.ink;
    if (this.head) context.fillRect(left + w / 2 - ratio / 2, 0, ratio, base);
    context.restore();
    context.fillStyle = colour.ground;
    context.fillRect(0, base, width, height - base);
    ticks.forEach(([x, time], i) =>
      this.text(said(time, 4) + (i === ticks.length - 1 ? " s" : ""), x, base + 10 * ratio, {
        align: "center",
      }),
    );
    if (from === left)
      for (let c = 0; c < track.width; c++)
        this.text(
          this.names?.[c] ?? String(c),
          left - 6 * ratio,
          (c + 0.5) * lane,
          c === state.channel
            ? { align: "right", weight: "700", colour: colour.ink }
            : { align: "right" },
        );
    this._bar(context, width, top, scale, ratio);
    if (this.range) {
      context.globalAlpha = 0.25;
      context.fillStyle = colour.accent;
      context.fillRect(this.range[0] * ratio, 0, (this.range[1] - this.range[0]) * ratio, base);
      context.globalAlpha = 1;
    }
  }
  /** The largest value with hysteresis, so that the scale rarely changes. */
  _steady(top) {
    if (!(top <= this._top && top > this._top / 1.5)) this._top = 1.1 * top;
    return this._top;
  }
  /** Move the old part of a running trace; return the x from which new parts must be painted. */
  _moved(context, base, at, how) {
    const { left, w } = this.lanes,
      gone = at - this._edge,
      same = this._how?.every((each, i) => each === how[i]);
    this._edge = at;
    this._how = how;
    if (this.head || !same || !(gone >= 0 && gone < w / 2)) return left;
    context.save();
    context.beginPath();
    context.rect(left, 0, w, base);
    context.clip();
    context.globalCompositeOperation = "copy";
    context.drawImage(this.canvas, left + gone, 0, w - gone, base, left, 0, w - gone, base);
    context.restore();
    // The last lines were cut off at the edge.
    return Math.max(left + 1, left + w - gone - Math.ceil(40 * this.ratio));
  }
  _lines(context, track, colour, scale, from, wide = 1) {
    const { left, w, lane, begin, span } = this.lanes,
      { ratio } = this,
      step = w / span,
      per = Math.max(1, Math.floor(span / w / 2));
    context.strokeStyle = colour;
    context.lineJoin = "round";
    // Begin at the same frame boundaries as the last time.
    const first = Math.max(track.first, per * Math.floor((begin + (from - left) / step) / per - 2)),
      last = Math.min(track.last - 1, Math.ceil(begin + span));
    for (let c = 0; c < track.width; c++) {
      context.lineWidth = (c === this.state.channel ? 1.6 : 1) * wide * ratio;
      context.beginPath();
      let pen = false;
      for (let f = first; f <= last; f += per) {
        let low = Infinity,
          high = -Infinity;
        for (let k = f; k < f + per && k <= last; k++) {
          const v = track.value(k, c);
          if (v < low) low = v;
          if (v > high) high = v;
        }
        if (low === Infinity) {
          pen = false;
          continue;
        } // lost: a gap
        const x = left + (f - begin) * step,
          y = (c + 0.5) * lane;
        if (pen) context.lineTo(x, y - high * scale);
        else context.moveTo(x, y - high * scale);
        if (per > 1) context.lineTo(x, y - low * scale);
        pen = true;
      }
      context.stroke();
    }
  }
  /** Draw time grid lines; return their positions. */
  _axis(context, base) {
    const { rate } = this.track,
      { ratio, colour } = this,
      { left, w, begin, span } = this.lanes,
      step = nice((span / rate / w) * 90 * ratio),
      ticks = [];
    context.strokeStyle = colour.line;
    context.lineWidth = Math.max(1, ratio / 2);
    context.globalAlpha = 0.35;
    context.beginPath();
    for (
      let k = Math.max(0, Math.ceil(begin / rate / step - 1e-9));
      k * step <= (begin + span) / rate;
      k++
    ) {
      const x = left + ((k * step * rate - begin) * w) / span;
      context.moveTo(x, 0);
      context.lineTo(x, base);
      ticks.push([x, k * step]);
    }
    context.stroke();
    context.globalAlpha = 1;
    return ticks;
  }
  /** Draw the scale bar. */
  _bar(context, width, top, scale, ratio) {
    if (!(top > 0)) return;
    const value = nice(top / 2),
      h = value * scale,
      x = width - 8 * ratio;
    this.barOf = value;
    context.fillStyle = this.colour.ink;
    context.fillRect(x, 6 * ratio, 2 * ratio, h);
    this.text(`${said(value)} ${this.track.unit}`, x - 4 * ratio, 6 * ratio + h / 2, {
      align: "right",
      colour: this.colour.ink,
    });
  }
  /** Frame at a place of the canvas, in CSS pixels. */
  _frame(x) {
    const { left = 0, w = 1, begin = 0, span = 0 } = this.lanes ?? {};
    return begin + ((x * this.ratio - left) / w) * span;
  }
  _at(x, y) {
    const { left, w, lane, begin, span } = this.lanes ?? {},
      { ratio } = this;
    if (!lane) return null;
    const channel = Math.floor((y * ratio) / lane),
      frame = Math.round(begin + ((x * ratio - left) / w) * span);
    return channel >= 0 && channel < this.track.width && x * ratio >= left
      ? { channel, frame }
      : null;
  }
  valueAt(x, y) {
    const at = this._at(x, y);
    if (!at || !this.track.has(at.frame)) return "";
    const over = this.over?.has(at.frame)
      ? `, ${this.over.label || "over it"} ${said(this.over.value(at.frame, at.channel))} ${this.over.unit}`
      : "";
    return `${this._channelName(at.channel)}, ${said(at.frame / this.track.rate, 4)} s: ${said(this.track.value(at.frame, at.channel))} ${this.track.unit}${over}`;
  }
  _press(event) {
    const at = this._at(event.offsetX, event.offsetY);
    if (!at) return;
    this.choose?.(at.channel);
    this.seek?.(at.frame);
  }
}

/** Phases of the transducers at their positions: `positions` is [x, y, x, y, ...] in mm, y
    downwards as in the maps. */
export class PhasesPicture extends Picture {
  constructor(box, options) {
    super(box, options);
    const { track, colours, positions, pitch = 10.16 } = options;
    Object.assign(this, { track, colours, positions, pitch });
    let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < positions.length; i += 2) {
      x0 = Math.min(x0, positions[i]);
      x1 = Math.max(x1, positions[i]);
      y0 = Math.min(y0, positions[i + 1]);
      y1 = Math.max(y1, positions[i + 1]);
    }
    this.extent = { x: x0 - pitch / 2, y: y0 - pitch / 2, w: x1 - x0 + pitch, h: y1 - y0 + pitch };
  }
  get summary() {
    return this.phases ? `${this.positions.length / 2} transducers` : "silent";
  }
  paint(context, width, height, state) {
    const { extent, positions, pitch } = this,
      scale = Math.min(width / extent.w, height / extent.h);
    this.fit = {
      scale,
      x: (width - extent.w * scale) / 2 - extent.x * scale,
      y: (height - extent.h * scale) / 2 - extent.y * scale,
    };
    this.phases = this.track.at(state.frame);
    this.clear(width, height);
    if (!this.phases) return;
    const size = Math.max(1, pitch * scale * 0.94),
      { css } = this.colours;
    for (let n = 0; n < this.phases.length; n++) {
      context.fillStyle = css[this.phases[n]];
      context.fillRect(
        this.fit.x + positions[2 * n] * scale - size / 2,
        this.fit.y + positions[2 * n + 1] * scale - size / 2,
        size,
        size,
      );
    }
  }
  valueAt(x, y) {
    if (!this.fit || !this.phases) return "";
    const { fit, positions, ratio } = this,
      px = (x * ratio - fit.x) / fit.scale,
      py = (y * ratio - fit.y) / fit.scale;
    for (let n = 0; n < this.phases.length; n++)
      if (
        Math.abs(positions[2 * n] - px) < this.pitch / 2 &&
        Math.abs(positions[2 * n + 1] - py) < this.pitch / 2
      )
        return `transducer ${n}: ${said((this.phases[n] / 128) * Math.PI, 3)} rad`;
    return "";
  }
}

/** Power of one channel over frequency and time, `state.span` seconds around the playhead, 60 dB
    deep. */
export class SpectrogramPicture extends Picture {
  constructor(box, options) {
    super(box, options);
    const { track, colours, depth = 60, limit = 1000, head = true } = options;
    // Windows of about 1/8 s, a power of two.
    const length = 2 ** Math.max(4, Math.round(Math.log2(track.rate * 0.128))),
      hop = Math.max(1, length >> 4);
    Object.assign(this, {
      track,
      colours,
      length,
      hop,
      depth,
      head,
      limit: Math.min(limit, track.rate / 2),
    });
    this.columns = new Map();
    this._transform = transform(length);
    this._small = box.ownerDocument.createElement("canvas");
  }
  get summary() {
    return this.state ? `channel ${this.state.channel ?? 0}, 0 to ${said(this.limit)} Hz` : "";
  }
  paint(context, width, height, state) {
    const { track, hop, ratio } = this,
      span = (state.span ?? 1) * track.rate,
      left = 34 * ratio,
      bottom = 18 * ratio,
      w = width - left - 4 * ratio,
      h = height - bottom;
    const key = `${state.channel}/${track.capacity}`;
    if (this._key !== key) {
      this.columns.clear();
      this._key = key;
    }
    const begin = Math.floor((state.frame - span / 2) / hop),
      count = Math.ceil(span / hop) + 1,
      bins = Math.round((this.limit / track.rate) * this.length);
    if (this._small.width !== count || this._small.height !== bins) {
      this._small.width = count;
      this._small.height = bins;
      this._image = this._small.getContext("2d").createImageData(count, bins);
      this._pixels = new Uint32Array(this._image.data.buffer);
    }
    this._pixels.fill(0);
    for (let i = 0; i < count; i++) {
      const column = this._column(begin + i, state.channel ?? 0);
      if (column)
        for (let b = 0; b < bins; b++) this._pixels[(bins - 1 - b) * count + i] = column[b];
    }
    this._small.getContext("2d").putImageData(this._image, 0, 0);
    this.clear(width, height);
    context.save();
    context.beginPath();
    context.rect(left, 0, w, h);
    context.clip();
    const step = (w / span) * hop;
    context.imageSmoothingEnabled = false;
    context.drawImage(
      this._small,
      left + (begin * hop - state.frame + span / 2) * (w / span),
      0,
      step * count,
      h,
    );
    context.fillStyle = this.colour.ink;
    if (this.head) context.fillRect(left + w / 2 - ratio / 2, 0, ratio, h);
    context.restore();
    const top = this.limit;
    this.text(said(top), left - 4 * ratio, 6 * ratio, { align: "right" });
    this.text(said(top / 2), left - 4 * ratio, h / 2, { align: "right" });
    this.text("0 Hz", left - 4 * ratio, h - 6 * ratio, { align: "right" });
    if (this.head)
      this.text(`${said(state.frame / track.rate, 4)} s`, left + w / 2, h + 10 * ratio, {
        align: "center",
      });
  }
  _column(index, channel) {
    const { track, hop, length } = this,
      middle = index * hop,
      from = middle - length / 2;
    if (this.columns.has(index)) return this.columns.get(index);
    if (middle < track.first || middle >= track.last) return null;
    const real = new Float32Array(length),
      imaginary = new Float32Array(length);
    let whole = true;
    for (let i = 0; i < length; i++) {
      const value = track.value(from + i, channel);
      if (Number.isNaN(value)) {
        if (from + i >= track.last) whole = false;
        continue;
      }
      real[i] = value * (0.5 - 0.5 * Math.cos((2 * Math.PI * i) / length));
    }
    this._transform(real, imaginary);
    // A sine with the amplitude `track.top` is 0 dB.
    const column = new Uint32Array(Math.round((this.limit / track.rate) * length)),
      full = (track.top * length) / 4 || 1;
    for (let b = 0; b < column.length; b++) {
      const level = 20 * Math.log10(Math.hypot(real[b], imaginary[b]) / full + 1e-9);
      column[b] =
        this.colours.pixels[Math.max(0, Math.min(255, Math.round((level / this.depth + 1) * 255)))];
    }
    // columns that still lack frames would change
    if (whole || track.last === track.capacity) this.columns.set(index, column);
    if (this.columns.size > 4096) this.columns.delete(this.columns.keys().next().value);
    return column;
  }
}

/** The whole take: loudest of all channels, playhead, loop and marks. Can be dragged; a slider
    for screen readers. */
export class OverviewPicture extends Picture {
  constructor(box, options) {
    super(box, { ...options, role: "slider" });
    const { track, seek = null, frames = null, zoom = null, select = null } = options;
    Object.assign(this, { track, seek, frames });
    const { canvas } = this;
    let from = null; // frame at which a selection began
    canvas.style.touchAction = "none";
    canvas.addEventListener("pointerdown", event => {
      canvas.setPointerCapture(event.pointerId);
      from = select && !event.shiftKey ? this._frame(event) : null;
      this._scrub(event);
    });
    canvas.addEventListener("pointermove", event => {
      if (!event.buttons) return;
      if (from === null) this._scrub(event);
      else if (Math.abs(this._x(this._frame(event)) - this._x(from)) > 4 * this.ratio)
        select(...[from, this._frame(event)].sort((a, b) => a - b));
    });
    if (zoom)
      canvas.addEventListener(
        "wheel",
        event => {
          event.preventDefault();
          zoom(event.deltaY > 0 ? 1.25 : 0.8);
        },
        { passive: false },
      );
    canvas.addEventListener("keydown", event => {
      const step = { ArrowLeft: -1, ArrowRight: 1, PageDown: -100, PageUp: 100 }[event.key];
      if (!step || !this.state) return;
      event.preventDefault();
      event.stopPropagation();
      this.seek?.(this.state.frame + step);
    });
  }
  get length() {
    return this.frames ?? this.track.last - this.track.first;
  }
  _stale() {
    this._curve = null;
  }
  _name() {
    super._name();
    const { canvas, state, track } = this;
    canvas.setAttribute("aria-valuemin", track.first);
    canvas.setAttribute("aria-valuemax", track.first + Math.max(0, this.length - 1));
    canvas.setAttribute("aria-valuenow", state?.frame ?? track.first);
    canvas.setAttribute(
      "aria-valuetext",
      `${said((state?.frame ?? track.first) / track.rate, 4)} s, frame ${state?.frame ?? track.first}`,
    );
  }
  _x(frame) {
    return ((frame - this.track.first + 0.5) / (this.length || 1)) * this.canvas.width;
  }
  paint(context, width, height, state) {
    const { ratio, colour, track } = this,
      base = height - 14 * ratio;
    if (!this._curve || this._version !== track.version) {
      this._curve = this._loudness(width);
      this._version = track.version;
    }
    this.clear(width, height);
    context.fillStyle = colour.trace;
    const top = track.top || 1;
    for (let x = 0; x < width; x++) {
      const h = (this._curve[x] / top) * (base - 4 * ratio);
      context.fillRect(x, base - h, 1, Math.max(1, h));
    }
    const { loop } = state;
    if (loop && loop.to > loop.from && loop.to - loop.from < this.length - 1) {
      const [from, to] = [this._x(loop.from), this._x(loop.to)];
      context.globalAlpha = loop.on ? 0.22 : 0.08;
      context.fillStyle = colour.accent;
      context.fillRect(from, 0, to - from, base);
      context.globalAlpha = 1;
      for (const x of [from, to]) context.fillRect(x - ratio, 0, 2 * ratio, base);
    }
    for (const mark of state.marks ?? []) {
      const x = this._x(mark);
      context.fillStyle = colour.second;
      context.beginPath();
      context.moveTo(x - 5 * ratio, 0);
      context.lineTo(x + 5 * ratio, 0);
      context.lineTo(x, 8 * ratio);
      context.fill();
    }
    context.fillStyle = colour.ink;
    context.fillRect(this._x(state.frame) - ratio, 0, 2 * ratio, base);
    const begin = track.first / track.rate,
      seconds = this.length / track.rate,
      step = nice((seconds / width) * 110 * ratio);
    for (
      let k = Math.ceil(begin / step - 1e-9), first = true;
      k * step <= begin + seconds * (1 - (30 * ratio) / width);
      k++, first = false
    )
      this.text(
        `${said(k * step, 4)}${first ? " s" : ""}`,
        Math.max(12 * ratio, ((k * step - begin) / seconds) * width),
        height - 6 * ratio,
        { align: "center", size: 10 },
      );
  }
  _loudness(width) {
    const { track, length } = this,
      curve = new Float32Array(width);
    for (let i = 0; i < length; i++) {
      const x = Math.min(width - 1, Math.floor((i / length) * width));
      curve[x] = Math.max(curve[x], track.loudness(track.first + i));
    }
    // With fewer frames than pixels, each frame is several pixels wide.
    if (length < width)
      for (let x = 0; x < width; x++)
        curve[x] = track.loudness(track.first + Math.floor((x / width) * length));
    return curve;
  }
  valueAt(x) {
    return `${said((this.track.first + (x / (this.canvas.clientWidth || 1)) * this.length) / this.track.rate, 4)} s`;
  }
  _frame(event) {
    const share = event.offsetX / (this.canvas.clientWidth || 1);
    return (
      this.track.first + Math.max(0, Math.min(this.length - 1, Math.floor(share * this.length)))
    );
  }
  _scrub(event) {
    this.seek?.(this._frame(event));
  }
}

/** Colour scale: 0 to `top` in `unit`, or one cycle of phase. */
export class BarPicture extends Picture {
  constructor(box, options) {
    super(box, options);
    const { colours, phaseColours = null, top = 1, unit = "Pa" } = options;
    Object.assign(this, { colours, phaseColours, top, unit });
  }
  get summary() {
    return this.state?.phase ? "0 to 2 pi rad" : `0 to ${said(this.top)} ${this.unit}`;
  }
  paint(context, width, height, state) {
    const table = state.phase && this.phaseColours ? this.phaseColours : this.colours,
      edge = 14 * this.ratio,
      h = height - 2 * edge;
    this.clear(width, height);
    for (let i = 0; i < 256; i++) {
      context.fillStyle = table.css[i];
      context.fillRect(0, edge + h - ((i + 1) / 256) * h, width, h / 256 + 1);
    }
    const words = { align: "center", size: 10, colour: this.colour.ink };
    this.text(state.phase ? "2π" : said(this.top), width / 2, edge / 2, words);
    this.text("0", width / 2, height - edge / 2, words);
  }
}

/** Format a number with few digits. */
export function said(value, digits = 3) {
  if (!Number.isFinite(value)) return "–"; // no data yet
  if (value === 0 || Math.abs(value) < 1e-12) return "0";
  return String(Number(value.toPrecision(digits)));
}

/** The smallest of 1, 2 or 5 times a power of ten that is at least `value`. */
export function nice(value) {
  const ten = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map(step => step * ten).find(step => step >= value * (1 - 1e-9)) ?? 10 * ten;
}

/** In-place FFT of `length` numbers, a power of two (Cooley and Tukey 1965). */
export function transform(length) {
  const cosine = Float32Array.from({ length: length / 2 }, (_, i) =>
    Math.cos((2 * Math.PI * i) / length),
  );
  const sine = Float32Array.from({ length: length / 2 }, (_, i) =>
    Math.sin((2 * Math.PI * i) / length),
  );
  const bits = Math.log2(length),
    mirrored = Array.from({ length }, (_, i) => {
      let m = 0;
      for (let b = 0; b < bits; b++) m |= ((i >> b) & 1) << (bits - 1 - b);
      return m;
    });
  return (real, imaginary) => {
    mirrored.forEach((m, i) => {
      if (m > i) {
        [real[i], real[m]] = [real[m], real[i]];
        [imaginary[i], imaginary[m]] = [imaginary[m], imaginary[i]];
      }
    });
    for (let size = 2; size <= length; size *= 2)
      for (let at = 0; at < length; at += size)
        for (let k = 0, turn = 0; k < size / 2; k++, turn += length / size) {
          const i = at + k,
            j = i + size / 2;
          const re = real[j] * cosine[turn] + imaginary[j] * sine[turn],
            im = imaginary[j] * cosine[turn] - real[j] * sine[turn];
          real[j] = real[i] - re;
          imaginary[j] = imaginary[i] - im;
          real[i] += re;
          imaginary[i] += im;
        }
  };
}
