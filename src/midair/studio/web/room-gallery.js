/* Panel Gallery: a card for each touch with picture, film and sound. */

import { buttonOf, make, panel, tried } from "/web/dom.js";
import { PalmFilm, badges, bytes } from "/web/palm-film.js";

export default class Gallery {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.cards = make("div.cards");
    this.ended = new AbortController();
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
    this.film?.still();
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
    const film = buttonOf(
        "Film",
        "Moves through the frames of the picture",
        () => {
          const plays = palm.playing;
          this.film?.still();
          this.film = palm;
          if (!plays) palm.play();
        },
        { disabled: true, "aria-pressed": "false" },
      ),
      palm = new PalmFilm(name, this.ended.signal, () =>
        film.setAttribute("aria-pressed", String(palm.playing)),
      ),
      facts = make("small.quiet", {}, "…");
    const sound = make(
        "button",
        { disabled: true, title: "The sum of the cells as sound" },
        "Listen",
      ),
      use = buttonOf(
        "Use",
        "Copies it into this folder and opens it",
        async () => {
          const made = await tried(this.link.order("gallery", "take", { touch: name }));
          if (made) this.studio.go(made.room, made.file);
        },
        { class: "main" },
      );
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
        palm.canvas,
        make("div.column", {}, make("h3", {}, name), make("p", {}, says), facts),
      ),
      badges(felt, ears, loud),
      palm.course,
      make("div.buttons", {}, film, sound, use),
    );
    const fill = async ({ film: pictures, top_pa: top, simulated, sound: wave }) => {
      const { seconds, shape, steps } = pictures,
        all = bytes(steps),
        size = all.length / shape[0];
      const greatest = Array.from({ length: shape[0] }, (_, i) =>
        Math.max(...all.subarray(i * size, (i + 1) * size)),
      );
      await palm.fill(
        pictures,
        { greatest, least: greatest.map(() => 0) },
        `strength of ${name} over ${seconds.toFixed(1)} s`,
      );
      facts.textContent = `${seconds.toFixed(1)} s, up to ${top} Pa, ${simulated ? "SIMULATED" : "a real recording"}, ${licence}`;
      sound.onclick = () => this._listen(bytes(wave).buffer);
      film.disabled = sound.disabled = false;
    };
    return { name, root, fill };
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
