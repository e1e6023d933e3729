/* Panel Start: three ways to a first touch, and the newest takes. */

import { make, panel } from "/web/dom.js";
import { bringFile } from "/web/import.js";
import { drawn } from "/web/palm-view.js";

const HAND =
  "M62 150 C60 120 46 104 42 78 L34 12 M50 12 L58 66 M62 66 L66 2 M84 2 L86 64 M90 64 L100 4 M116 6 L112 68" +
  " M116 70 L130 22 M144 28 L132 84 C138 78 154 62 166 58 C176 56 178 66 170 74 C158 88 146 108 136 122 L132 150";
const RECENT = 5;

/** A picture of a palm with something on it. */
function palm(...marks) {
  const picture = drawn("svg", { viewBox: "0 0 220 150", "aria-hidden": "true" });
  picture.append(drawn("path", { class: "hand", d: HAND }), ...marks);
  return picture;
}

/** A vibration, drawn by its formula. */
function wave() {
  const at = x => Math.sin(1.9 * x) * Math.sin(x / 70) ** 2 * (30 + 22 * Math.sin(x / 9)),
    line = Array.from({ length: 200 }, (_, x) => `${x + 10},${(75 + at(x)).toFixed(1)}`).join(" "),
    picture = drawn("svg", { viewBox: "0 0 220 150", "aria-hidden": "true" });
  picture.append(drawn("polyline", { class: "wave", points: line }));
  return picture;
}

export default class Start {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    const file = make("input", {
      type: "file",
      hidden: true,
      onchange: () => bringFile(studio, file.files[0]),
    });
    this.file = make("button.main", { onclick: () => file.click() }, "Choose a file");
    const stripes = [0, 1, 2, 3].map(i =>
      drawn("rect", { class: `stripe-${i}`, x: 64 + 15 * i, y: 78, width: 13, height: 42, rx: 3 }),
    );
    const path = drawn("path", { class: "path", d: "M62 112 C72 70 84 80 92 98 S112 118 122 84" });
    this.takes = make("ul.recent");
    const drop = {
      ondragover: event => event.preventDefault(),
      ondrop: event => {
        event.preventDefault();
        if (this.link.controls) bringFile(studio, event.dataTransfer.files[0]);
      },
    };
    studio.main.append(
      make(
        "div.start",
        drop,
        make("h2", {}, "Record how an object presses on a sensor; feel it on a bare palm."),
        make(
          "div.doors",
          {},
          door(
            "Use a touch",
            palm(...stripes),
            "A towel, a brush, a heartbeat, rain and others.",
            make("a.main", { href: "#gallery" }, "Choose a touch"),
          ),
          door(
            "Bring a recording",
            wave(),
            "A sound or a table of pressures. Drop it anywhere on this page.",
            this.file,
            file,
          ),
          door(
            "Draw",
            palm(path),
            "Draw a path on the palm, and say how strong it feels.",
            make("a.main", { href: "#draw" }, "Start drawing"),
          ),
        ),
        panel(
          "Recent takes",
          make("small", {}, "Have a sensor? ", make("a", { href: "#record" }, "Record a touch")),
          this.takes,
        ),
      ),
    );
    this._offs = [
      this.link.on("takes", takes => this._takes(takes)),
      this.link.on("control", () => this.control()),
    ];
    this.control();
  }
  leave() {
    for (const off of this._offs) off();
  }
  control() {
    this.file.disabled = !this.link.controls;
  }
  _takes(takes) {
    this.takes.replaceChildren(
      ...takes
        .slice(0, RECENT)
        .map(({ name, sample, compared, played, solved }) =>
          make(
            "li",
            {},
            make(
              "a",
              { href: `#${compared ? "compare" : "reproduce"}/${encodeURI(name)}` },
              name.replace(/^sample:/, "").replace(/\.h5$/, ""),
            ),
            make(
              "small.quiet",
              {},
              compared
                ? "compared"
                : played
                  ? "played"
                  : solved
                    ? "ready to play"
                    : sample
                      ? "comes with midair"
                      : "not solved",
            ),
          ),
        ),
    );
  }
}

/** A way to a touch: a picture, a sentence and a button. */
function door(title, picture, words, ...acts) {
  return make(
    "article.door",
    {},
    picture,
    make("h3", {}, title),
    make("p.quiet", {}, words),
    ...acts,
  );
}
