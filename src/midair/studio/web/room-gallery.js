/* Panel Gallery: a card for each touch with picture, film and sound. */

import { make, panel, tried } from "/web/dom.js";
import { colours } from "/web/take.js";

const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const PICTURES = 50; // a second, as in midair.datasets.gallery

export default class Gallery {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.cards = make("div.cards");
    this.studio.main.append(
      make(
        "div.gallery",
        {},
        panel(
          "Touches to start from",
          "picture: rms pressure; sound: the place that vibrates most",
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
  _card({ name, says, licence }) {
    const canvas = make("canvas", { width: 176, height: 176, role: "img" }),
      facts = make("small.quiet", {}, "…");
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
      canvas,
      make("h3", {}, name),
      make("p", {}, says),
      facts,
      make("div.buttons", {}, film, sound, use),
    );
    const fill = async view => {
      const [count, high, wide] = view.shape,
        steps = bytes(view.steps),
        table = await colours("inferno"),
        size = high * wide;
      const draw = values => {
        const small = document.createElement("canvas"),
          image = new ImageData(wide, high),
          pen = canvas.getContext("2d");
        [small.width, small.height] = [wide, high];
        new Uint32Array(image.data.buffer).set(Array.from(values, step => table.pixels[step]));
        small.getContext("2d").putImageData(image, 0, 0);
        pen.imageSmoothingEnabled = false;
        pen.drawImage(small, 0, 0, canvas.width, canvas.height);
      };
      const rms = Float64Array.from({ length: size }, (_, at) => {
          let sum = 0;
          for (let i = 0; i < count; i++) sum += steps[i * size + at] ** 2;
          return Math.sqrt(sum / count);
        }),
        top = Math.max(...rms, 1e-9);
      const picture = () => draw(rms.map(value => Math.round((255 * value) / top)));
      picture();
      canvas.setAttribute(
        "aria-label",
        `${name}: rms pressure on ${view.width_mm} by ${view.width_mm} mm, ${view.simulated ? "simulated" : "recorded"}`,
      );
      facts.textContent = `${(count / PICTURES).toFixed(1)} s, up to ${view.top_pa} Pa, ${view.width_mm} mm wide, ${view.simulated ? "SIMULATED" : "a real recording"}, ${licence}`;
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
