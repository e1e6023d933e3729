/* Panel Gallery: a card for each touch with picture, film and sound. */

import { make, panel, tried } from "/web/dom.js";
import { pictureOf } from "/web/import.js";
import { colours } from "/web/take.js";

const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const PICTURES = 50; // a second, as in midair.datasets.gallery

// A right hand, mm from the middle of the palm: x and y of both ends of each part, its width.
const HAND = [
  [0, -24, 0, 8, 72],
  [-10, 6, 10, 6, 66],
  [0, -50, 0, -100, 58],
  [32, -24, 62, 22, 21],
  [-31, 26, -41, 74, 16],
  [-11, 30, -15, 94, 18],
  [10, 30, 13, 98, 18],
  [30, 26, 37, 82, 17],
];
const SCALE = 2; // pixels per mm

/** A hand on a canvas, and coordinates in mm with y upwards. */
function hand(canvas) {
  const pen = canvas.getContext("2d"),
    colour = name => getComputedStyle(canvas).getPropertyValue(name);
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.setTransform(SCALE, 0, 0, -SCALE, 58 * SCALE, 110 * SCALE);
  pen.lineCap = "round";
  for (const [name, more] of [
    ["--edge", 2.4],
    ["--raised", 0],
  ]) {
    pen.strokeStyle = colour(name);
    for (const [x, y, toX, toY, wide] of HAND) {
      pen.lineWidth = wide + more;
      pen.stroke(new Path2D(`M${x} ${y}L${toX} ${toY}`));
    }
  }
  return pen;
}

export default class Gallery {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.cards = make("div.cards");
    this.ended = new AbortController();
    this.scheme = matchMedia("(prefers-color-scheme: dark)"); // its colours are in the canvases
    this.studio.main.append(
      make(
        "div.gallery",
        {},
        panel(
          "Touches to start from",
          "palm: where it presses; curve: how strong over time; sound: the place that vibrates most",
          this.cards,
        ),
      ),
    );
    this._offs = [
      this.link.on("gallery", state => this._build(state)),
      this.link.on("control", () => this.control()),
    ];
  }
  leave() {
    this.left = true;
    this.ended.abort();
    for (const off of this._offs) off();
    this._still();
    this.sounds?.close();
  }
  control() {
    for (const button of this.cards.querySelectorAll("button.main"))
      button.disabled = !this.link.controls;
  }
  async _build({ touches }) {
    if (this.cards.children.length) return;
    const made = touches.map(touch => this._card(touch));
    this.cards.append(...made.map(card => card.root));
    this.control();
    for (const card of made) {
      // one after another: the worker process has other things to read
      const view = await tried(this.link.order("gallery", "view", { touch: card.name }));
      if (this.left) return;
      if (view) await card.fill(view);
    }
    this.ready = true;
  }
  _card({ name, says, felt, ears, loud, licence }) {
    const canvas = make("canvas", { width: 140 * SCALE, height: 186 * SCALE, role: "img" }),
      facts = make("small.quiet", {}, "…"),
      course = make("div.course");
    const film = make(
        "button",
        {
          disabled: true,
          "aria-pressed": "false",
          title: "Moves through the frames of the picture",
        },
        "Film",
      ),
      sound = make("button", { disabled: true, title: "The sum of the cells as sound" }, "Listen");
    const use = make(
      "button.main",
      {
        title: "Copies it into this folder and opens it",
        onclick: async () => {
          const made = await tried(this.link.order("gallery", "take", { touch: name }));
          if (made) this.studio.go(made.room, made.file);
        },
      },
      "Use",
    );
    canvas.setAttribute("aria-label", `${name}: the picture is being computed`);
    for (const [button, words] of [
      [film, "film of"],
      [sound, "sound of"],
      [use, "use"],
    ])
      button.setAttribute("aria-label", `${words} ${name}`);
    const root = make(
      "article.card-touch",
      { id: `touch-${name}` },
      make(
        "div.up",
        {},
        canvas,
        make("div.column", {}, make("h3", {}, name), make("p", {}, says), facts),
      ),
      make(
        "div.badges",
        {},
        make(
          `small.pill${felt < 9 ? "" : ".on"}`,
          { title: "by a model of skin, not tried on people" },
          `felt by ${felt} of 10`,
        ),
        make(`small.pill${ears > 0 ? ".bad" : ".on"}`, {}, `ears: ${loud}`),
      ),
      course,
      make("div.buttons", {}, film, sound, use),
    );
    const fill = async view => {
      const [count, high, wide] = view.shape,
        steps = bytes(view.steps),
        table = await colours("inferno"),
        size = high * wide;
      const draw = values => {
        const small = make("canvas", { width: wide + 2, height: high + 2 }),
          image = new ImageData(wide, high),
          pen = hand(canvas),
          side = (view.width_mm * (wide + 2)) / wide;
        // The strongest is far from the ground: bright on dark, dark on light.
        const shade = step => table.pixels[this.scheme.matches ? step : 255 - step];
        new Uint32Array(image.data.buffer).set(Array.from(values, shade));
        values.forEach((step, at) => (image.data[4 * at + 3] = Math.min(5 * step, 255)));
        small.getContext("2d").putImageData(image, 1, 1);
        pen.scale(1, -1);
        pen.imageSmoothingQuality = "high";
        pen.drawImage(small, -side / 2, -side / 2, side, side);
      };
      const rms = Float64Array.from({ length: size }, (_, at) => {
          let sum = 0;
          for (let i = 0; i < count; i++) sum += steps[i * size + at] ** 2;
          return Math.sqrt(sum / count);
        }),
        top = Math.max(...rms, 1e-9);
      const picture = () => draw(rms.map(value => Math.round((255 * value) / top)));
      picture();
      this.scheme.addEventListener("change", picture, { signal: this.ended.signal });
      const greatest = Array.from({ length: count }, (_, i) =>
        Math.max(...steps.subarray(i * size, (i + 1) * size)),
      );
      course.replaceChildren(
        pictureOf(
          { greatest, least: greatest.map(() => 0) },
          `strength of ${name} over ${(count / PICTURES).toFixed(1)} s`,
        ),
      );
      canvas.setAttribute(
        "aria-label",
        `${name}: rms pressure on ${view.width_mm} by ${view.width_mm} mm, ${view.simulated ? "simulated" : "recorded"}`,
      );
      facts.textContent = `${(count / PICTURES).toFixed(1)} s, up to ${view.top_pa} Pa, ${view.simulated ? "SIMULATED" : "a real recording"}, ${licence}`;
      film.onclick = () => {
        const plays = this.film === film;
        this._still();
        if (!plays)
          this._plays(film, count, i => draw(steps.subarray(i * size, (i + 1) * size)), picture);
      };
      sound.onclick = () => this._listen(bytes(view.sound).buffer);
      film.disabled = sound.disabled = false;
    };
    return { name, root, fill };
  }
  /** Play a film once; it is asked for, so that it also plays for those who prefer reduced
      motion. */
  _plays(film, count, draw, picture) {
    const began = performance.now();
    this.film = film;
    this.after = picture;
    film.setAttribute("aria-pressed", "true");
    const tick = now => {
      if (this.film !== film) return;
      const at = Math.floor(((now - began) / 1000) * PICTURES);
      if (at >= count) {
        this._still();
        return;
      }
      draw(Math.max(at, 0));
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  _still() {
    this.film?.setAttribute("aria-pressed", "false");
    this.after?.();
    this.film = this.after = null;
  }
  async _listen(data) {
    this.sounds ??= new AudioContext();
    this.source?.stop();
    this.source = this.sounds.createBufferSource();
    this.source.buffer = await this.sounds.decodeAudioData(data);
    this.source.connect(this.sounds.destination);
    this.source.start();
    this.heard = this.source.buffer.duration;
  }
}
