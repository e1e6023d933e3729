/* A film of pressure on a palm, and the course of a signal over time. */

import { buttonOf, make } from "/web/dom.js";
import { drawn } from "/web/palm-view.js";
import { colours } from "/web/take.js";

/** Bytes of a text in base64. */
export const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));

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

/** A film on a palm, `canvas`, and the `course` of its signal. It shows the rms over time, or the
    picture of the time `at` (s); `changed` is called when it plays, moves or ends. */
export class PalmFilm {
  constructor(name, signal, changed = () => {}) {
    Object.assign(this, { name, changed, playing: false, at: null, course: make("div.course") });
    this.canvas = make("canvas", {
      width: 140 * SCALE,
      height: 186 * SCALE,
      role: "img",
      "aria-label": `${name}: the picture is being computed`,
    });
    // Its colours are in the canvas.
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    this.dark = () => scheme.matches;
    scheme.addEventListener("change", () => this.seek(this.at), { signal });
    requestAnimationFrame(() => this.seek(null)); // a hand, as soon as it has a place in the page
  }
  /** Take pictures, and a course whose times they have. */
  async fill(film, course, label) {
    const [count, high, wide] = film.shape,
      steps = bytes(film.steps),
      size = high * wide;
    this.table = await colours("inferno");
    const rms = Float64Array.from({ length: size }, (_, at) => {
        let sum = 0;
        for (let i = 0; i < count; i++) sum += steps[i * size + at] ** 2;
        return Math.sqrt(sum / count);
      }),
      top = Math.max(...rms, 1e-9);
    this.picture = i => steps.subarray(i * size, (i + 1) * size);
    Object.assign(this, { film, count, rms: rms.map(value => Math.round((255 * value) / top)) });
    this.course.replaceChildren(...courseOf({ ...course, seconds: film.seconds }, label));
    this.seek(this.at);
    this.canvas.setAttribute(
      "aria-label",
      `${this.name}: rms pressure on ${film.width_mm} by ${Math.round((film.width_mm * high) / wide)} mm`,
    );
  }
  /** Show the picture of a time in s; the rms over time for null. */
  seek(at) {
    this.at = at;
    const pen = hand(this.canvas);
    if (!this.film) return;
    const { film, count } = this,
      [, high, wide] = film.shape,
      small = make("canvas", { width: wide + 2, height: high + 2 }),
      image = new ImageData(wide, high),
      across = (film.width_mm * (wide + 2)) / wide,
      along = (film.width_mm * (high + 2)) / wide,
      frame = Math.min(Math.floor(((at ?? 0) / film.seconds) * count), count - 1),
      values = at === null ? this.rms : this.picture(frame);
    // The strongest is far from the ground: bright on dark, dark on light.
    const shade = step => this.table.pixels[this.dark() ? step : 255 - step];
    new Uint32Array(image.data.buffer).set(Array.from(values, shade));
    values.forEach((step, i) => (image.data[4 * i + 3] = Math.min(5 * step, 255)));
    small.getContext("2d").putImageData(image, 1, 1);
    pen.scale(1, -1);
    pen.imageSmoothingQuality = "high";
    pen.drawImage(small, -across / 2, -along / 2, across, along);
    this.course.style.setProperty("--at", at === null ? -1 : Math.min(at / film.seconds, 1));
    this.changed();
  }
  /** Play from here to the end; it is asked for, so that it also plays for those who prefer
      reduced motion. */
  play() {
    const began = performance.now() - 1000 * (this.at ?? 0);
    this.playing = true;
    const tick = now => {
      if (!this.playing) return;
      const at = Math.max(now - began, 0) / 1000;
      if (at >= this.film.seconds) this.still();
      else {
        this.seek(at);
        requestAnimationFrame(tick);
      }
    };
    requestAnimationFrame(tick);
  }
  /** End the film, or stop it at a time. */
  still(at = null) {
    this.playing = false;
    this.seek(at);
  }
}

/** A film with what plays it: a button, and the time to drag. */
export function playerOf(film) {
  const button = buttonOf("Play", "Plays in real time what presses on the palm", () =>
      film.playing ? film.still(film.at) : film.play(),
    ),
    time = make("input", {
      type: "range",
      step: "any",
      "aria-label": "time of the film",
      title: "Shows the palm at this time",
      oninput: () => film.still(Number(time.value)),
    }),
    at = make("output.quiet");
  film.changed = () => {
    const { seconds } = film.film;
    button.textContent = film.playing ? "Pause" : "Play";
    time.max = seconds;
    time.value = film.at ?? 0;
    at.textContent = film.at === null ? "whole touch" : `${film.at.toFixed(2)} s`;
  };
  return make("div.player", {}, film.canvas, make("div.row", {}, button, time, at));
}

/** A course over time: its greatest and least values in equal parts of its time, and the times. */
export function courseOf({ greatest, least, seconds }, label) {
  const high = Math.max(...greatest),
    low = Math.min(...least),
    y = value => (high > low ? (90 * (high - value)) / (high - low) + 5 : 50).toFixed(1);
  const svg = drawn("svg", {
    viewBox: `0 0 ${least.length} 100`,
    preserveAspectRatio: "none",
    role: "img",
    "aria-label": label,
  });
  const points = [
    ...greatest.map((value, i) => `${i},${y(value)}`),
    ...least.map((value, i) => `${i},${y(value)}`).reverse(),
  ].join(" ");
  svg.append(drawn("polygon", { points }));
  const digits = Math.max(0, 2 - Math.floor(Math.log10(seconds)));
  const times = [0, 0.5, 1].map((part, i) =>
    make("span", {}, `${Number((part * seconds).toFixed(digits))}${i === 2 ? " s" : ""}`),
  );
  return [svg, make("small.axis.quiet", {}, ...times)];
}

/** Who feels a touch, by a model, and how loud it is at an ear. */
export const badges = (felt, ears, loud) =>
  make(
    "span.badges",
    {},
    make(
      `small.pill${felt < 9 ? "" : ".on"}`,
      { title: "by a model of skin, not tried on people" },
      `felt by ${felt} of 10`,
    ),
    make(`small.pill${ears > 0 ? ".bad" : ".on"}`, {}, `ears: ${loud}`),
  );
