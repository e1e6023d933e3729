/* Panel Study: the experimenter's page, and the participant's with one question at a time. */

import { buttonOf, choice, field, make, panel, rows, table, tried } from "/web/dom.js";

const TEMPLATES = [
  ["own", "takes and patterns"],
  ["threshold", "threshold of a take"],
  ["paper", "the paper's study"],
  ["detection", "vibration threshold"],
  ["intervals", "two intervals"],
  ["paired", "paired comparison"],
];

/** Name of a study and its title: studies from one template have the same title. */
const titled = ({ name, title }) => (title && title !== name ? `${name}: ${title}` : name);

export default class Study {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.shown = "";
    this.participant = studio.address.take === "participant";
    this._offs = [
      this.link.on("session", () => this._show()),
      this.link.on("studies", () => this._show()),
      this.link.on("air", () => this._show()),
      ...["takes", "draw", "player"].map(name => this.link.on(name, () => this._show())),
    ];
    this._keys = event => this._key(event);
    addEventListener("keydown", this._keys);
    this.reopened();
    this._show();
  }
  reopened() {
    for (const [room, order] of [
      ["study", "list"],
      ["draw", "files"],
    ])
      this.link.order(room, order).catch(() => {});
  }
  leave() {
    for (const off of this._offs) off();
    removeEventListener("keydown", this._keys);
    document.body.classList.remove("pilot");
    document.querySelector("body > header").hidden = false;
  }
  moved({ take }) {
    this.participant = take === "participant";
    this.shown = "";
    this._show();
  }
  control() {
    this._show();
  }
  get session() {
    return this.link.state.session;
  }
  _show() {
    const { session } = this;
    document.body.classList.toggle("pilot", Boolean(session?.pilot));
    document.querySelector("body > header").hidden = this.participant;
    if (this.participant) this._forParticipant();
    else this._forExperimenter();
  }

  _forExperimenter() {
    const { session } = this,
      controls = this.link.controls,
      studies = this.link.state.studies ?? [];
    const own = (this.link.state.takes ?? [])
      .filter(row => !row.sample && row.name.endsWith(".h5"))
      .map(row => row.name)
      .concat(this.link.state.draw?.files ?? []);
    const key = JSON.stringify([
      session,
      studies,
      controls,
      own,
      this.link.state.player?.simulated,
    ]);
    if (key === this.shown) return;
    this.shown = key;
    const chosen = this.chosen ?? studies[0]?.name ?? "",
      study = studies.find(each => each.name === chosen) ?? studies[0];
    const left = make("div.column.left");
    if (!session) {
      const name = make("input", { type: "text", value: "touch", maxLength: 60 }),
        template = choice(TEMPLATES, own.length > 1 ? "own" : "paper"),
        people = make("input", { type: "number", min: 1, max: 500, value: "10" });
      const takes = make(
        "select",
        { multiple: true, size: 6, "aria-label": "takes and patterns to present" },
        ...own.map(value =>
          make(
            "option",
            { value },
            value.replace(/\.h5$/, "").replace(/(.*)\.toml$/, "$1 (pattern)"),
          ),
        ),
      );
      const asked = [
        ["Question", "Which one was it?", ""],
        ["Second question (may stay empty)", "", "scale"],
      ].map(([label, value, kind]) => [
        label,
        make("textarea", { maxLength: 500, rows: 2, value }),
        choice(
          [
            ["", "one of the names"],
            ["scale", "a number, 1 to 7"],
          ],
          kind,
        ),
      ]);
      const often = make("input", { type: "number", min: 1, max: 100, value: "5" });
      const words = make("p.quiet"),
        questions = make(
          "div.column",
          {},
          ...asked.flatMap(([label, text, kind], i) => [
            field(label, text, "Asked after each presentation"),
            field(
              `Answer${i ? " to the second" : ""}`,
              kind,
              "Names are analysed as confusions, numbers as ratings",
            ),
          ]),
          field("Repetitions", often, "Presentations of each to each person"),
        );
      const mine = make(
        "div.column",
        { id: "own-study" },
        field(
          "Takes and patterns",
          takes,
          "Stimuli of the study; patterns are drawn, a take without a drive is solved in the mode quick",
        ),
        words,
        questions,
      );
      const fit = () => {
        mine.hidden = !["own", "threshold"].includes(template.value);
        questions.hidden = template.value !== "own";
        words.textContent = questions.hidden
          ? "Choose one: it is presented ever more weakly, in one of two intervals."
          : "Choose two or more: hold Ctrl, or Shift for a range.";
      };
      template.addEventListener("change", fit);
      fit();
      const given = () =>
        template.value === "threshold"
          ? { template: "detection", takes: [...takes.selectedOptions].map(one => one.value) }
          : template.value === "own"
            ? {
                takes: [...takes.selectedOptions].map(one => one.value),
                questions: asked
                  .map(([, text, kind]) => [text.value.trim(), kind.value === "scale"])
                  .filter(([text]) => text),
                repetitions: Number(often.value) || 1,
              }
            : { template: template.value };
      left.append(
        panel(
          "Studies",
          null,
          ...(studies.length
            ? [
                choice(
                  studies.map(each => [each.name, titled(each)]),
                  study.name,
                  ({ target }) => {
                    this.chosen = target.value;
                    this.shown = "";
                    this._show();
                  },
                ),
              ].map(one => Object.assign(one, { title: "Study to show", ariaLabel: "study" }))
            : [make("p.quiet", {}, "no studies in this folder yet")]),
        ),
        panel(
          "New study",
          null,
          field("Name", name, "Folder of the study"),
          field(
            "Kind",
            template,
            "Your own takes and patterns, or a study with stimuli of its own",
          ),
          field("Participants", people, "Each gets an order of their own"),
          mine,
          make(
            "div.buttons",
            {},
            buttonOf(
              "Draw the plan",
              "Draws the order of all trials and solves the drives, which takes a while",
              async () => {
                if (
                  await tried(
                    this.link.order("study", "new", {
                      name: name.value.trim(),
                      ...given(),
                      participants: Number(people.value) || 1,
                    }),
                  )
                )
                  this.chosen = name.value.trim();
              },
              { disabled: !controls, id: "new-study" },
            ),
          ),
        ),
      );
    } else {
      const { step } = session,
        over = ["done", "stopped"].includes(step.kind);
      left.append(
        panel(
          session.title,
          session.pilot
            ? make("strong.simulated", {}, "PILOT")
            : `participant ${session.participant}`,
          make("progress", {
            max: step.total || 1,
            value: over ? step.total || 1 : Math.max(0, step.number - 1),
            "aria-label": "progress",
          }),
          rows([
            ["Trial", step.total ? `${step.number} of ${step.total}` : "–"],
            [
              "Now",
              {
                show: "reads a text",
                present: "a stimulus is due",
                ask: "answers",
                rest: "rests",
                done: "done",
                stopped: "stopped",
              }[step.kind],
            ],
          ]),
          ...(session.due
            ? [
                make("p", {}, make("strong", { id: "due" }, session.due)),
                buttonOf(
                  "Stimulus presented",
                  "Press it when the participant has touched it",
                  () => tried(this.link.order("study", "presented")),
                  { class: "main", id: "presented", disabled: !controls },
                ),
              ]
            : []),
          ...(session.error ? [make("p.bad", {}, session.error)] : []),
          make(
            "div.buttons",
            {},
            buttonOf("Participant's page here", "One question at a time, on this screen", () =>
              this.studio.go("study", "participant"),
            ),
            buttonOf(
              "Participant's page in a new window",
              "One question at a time, on a second screen",
              () => open("/#study/participant", "participant", "popup,width=1100,height=760"),
            ),
          ),
          make(
            "div.buttons",
            {},
            buttonOf(
              over ? "Close the session" : "Leave the session (it can be resumed)",
              "Answers so far are stored",
              () => tried(this.link.order("study", "end")),
              { disabled: !controls, id: "end-session" },
            ),
          ),
        ),
      );
    }
    const right = make("div.column");
    if (session)
      right.append(
        panel(
          "Log",
          "newest last; no condition is shown",
          make("ol.events", {}, ...session.log.map(said => make("li", {}, said))),
        ),
      );
    else if (study) {
      // The form is built again by every change, an error at the start included: what was chosen
      // stays.
      const kept = (this.kept ??= { pilot: false, noise: "default", answers: "" });
      const pilot = make("input", {
        type: "checkbox",
        id: "pilot",
        checked: kept.pilot,
        title: "A trial run, which no analysis reads",
        onchange: () => {
          kept.pilot = pilot.checked;
        },
      });
      const noise = choice(
          [
            ["default", "this computer's sound output"],
            ["none", "none (the array may be audible)"],
          ],
          kept.noise,
        ),
        answers = make("input", {
          type: "text",
          maxLength: 200,
          autocomplete: "off",
          placeholder: "name",
          value: kept.answers,
          oninput: () => {
            kept.answers = answers.value;
          },
        });
      noise.addEventListener("change", () => {
        kept.noise = noise.value;
      });
      right.append(
        panel(
          titled(study),
          study.simulated ? make("strong.simulated", {}, "SIMULATED") : "",
          make(
            "p.quiet",
            {},
            "Pilot runs have a coloured frame and are stored in pilot/, which no analysis reads.",
          ),
          make("div", {}, pilot, " ", make("label", { htmlFor: "pilot" }, "pilot run")),
          ...(this.said
            ? [
                make(
                  `p${this.wrong ? ".bad" : ".quiet"}`,
                  { id: "begins", role: "status" },
                  this.said,
                ),
              ]
            : []),
          ...(study.drives
            ? [
                field(
                  "Person responsible for playing above the exposure profile",
                  answers,
                  "Empty: drives above the profile are refused",
                ),
              ]
            : []),
          ...(study.noise
            ? [
                field(
                  "Noise in the headphones",
                  noise,
                  "Masks the sound of the array, which would give the stimulus away",
                ),
                make("p.quiet", {}, `During each presentation: ${study.noise}.`),
              ]
            : []),
          ...(study.drives && this.link.state.player?.simulated
            ? [
                make(
                  "div.warning",
                  { id: "no-touch", role: "note" },
                  "SIMULATED array: nothing can be felt. Choose a real array before a participant begins.",
                ),
              ]
            : []),
          make(
            "div.buttons",
            {},
            buttonOf(
              "Simulate participants",
              "answers of a model for everyone, to try plan and analysis before people come; all that is made of them is marked SIMULATED",
              () => tried(this.link.order("study", "simulate", { study: study.name })),
              { id: "simulate", disabled: !controls || study.participants.some(each => each.done) },
            ),
            buttonOf(
              "Analyse",
              "needs an answer",
              () => tried(this.link.order("study", "analyse", { study: study.name })),
              { id: "analyse", disabled: !controls || !study.participants.some(each => each.done) },
            ),
            ...(study.report
              ? [
                  make(
                    "a",
                    {
                      id: "to-report",
                      target: "_blank",
                      rel: "noopener",
                      href: `/file/${encodeURI(study.name)}/report.html?${study.report}`,
                    },
                    "Open the report",
                  ),
                ]
              : []),
          ),
          make(
            "div.card",
            {},
            table(
              ["participant", "trials", ""],
              study.participants.map(each => [
                String(each.number),
                `${each.done} of ${each.total}`,
                buttonOf(
                  each.done === 0 ? "Begin" : each.done < each.total ? "Resume" : "Open",
                  `Session of participant ${each.number}`,
                  () =>
                    this._begin({
                      study: study.name,
                      participant: each.number,
                      pilot: pilot.checked,
                      noise: noise.value,
                      override: answers.value.trim(),
                    }),
                  { disabled: !controls, "data-participant": each.number },
                ),
              ]),
              3,
            ),
          ),
        ),
      );
    } else
      right.append(
        panel(
          "No study",
          null,
          make(
            "p.quiet",
            {},
            "Draw a study plan under New study. It defines the trials, their order and the questions.",
          ),
        ),
      );
    this.studio.main.replaceChildren(make("div.study", {}, left, right));
  }

  /** Begin a session. Drives are checked first, which takes a moment; an error stays visible. */
  async _begin(order) {
    Object.assign(this, { said: "checking drives and headphones …", wrong: false, shown: "" });
    this._show();
    try {
      await this.link.order("study", "begin", order);
      this.said = "";
    } catch (wrong) {
      Object.assign(this, { said: wrong.message, wrong: true, shown: "" });
      this._show();
    }
  }

  _forParticipant() {
    const { session } = this,
      step = session?.step,
      key = JSON.stringify([
        step,
        session?.busy,
        session?.cue,
        session?.media,
        Boolean(session?.due),
      ]);
    if (key === this.shown) return;
    this.shown = key;
    this.answers = [];
    const main = make("div.participant", { lang: "en" }),
      next = (words, act) => make("button.main", { id: "next", onclick: act }, words);
    const stop = make(
      "button.stop",
      { id: "want-stop", onclick: () => this._stop() },
      "I want to stop ",
      make("kbd", {}, "Esc"),
    );
    if (!session)
      main.append(
        make("p", {}, "Please wait."),
        make("a", { href: "#study" }, "experimenter's page"),
      );
    else if (step.kind === "show")
      main.append(
        ...step.text.split("\n").map(line => make("p", {}, line)),
        next(
          { "take part": "I have read this, and take part", "go on": "I agree to go on" }[
            step.consent
          ] ?? "Next",
          () => tried(this.link.order("study", "acknowledge")),
        ),
      );
    else if (step.kind === "present")
      main.append(
        ...(session.media ? [this._medium(session)] : []),
        make(
          "p",
          {},
          session.busy
            ? session.cue || "Feel it now."
            : step.text || "Please put your hand in place.",
        ),
        ...(session.busy
          ? []
          : [next("I am ready", () => tried(this.link.order("study", "present")))]),
      );
    else if (step.kind === "rest") {
      const go = next(`A break of ${Math.ceil(step.rest_s)} s`, () =>
        tried(this.link.order("study", "acknowledge")),
      );
      go.disabled = true;
      setTimeout(() => {
        go.disabled = false;
        go.textContent = "Continue";
      }, 1000 * step.rest_s);
      main.append(make("p", {}, "Please rest."), go);
    } else if (step.kind === "ask") main.append(...this._question(step));
    else
      main.append(
        make("p", {}, step.kind === "done" ? "That was all. Thank you." : "Stopped. Thank you."),
        make("a", { href: "#study" }, "experimenter's page"),
      );
    // Without the name of the object, which the participant must not read.
    const due = session?.due
      ? [
          make(
            "a",
            { href: "#study", id: "to-confirm" },
            "Experimenter: confirm the presentation here",
          ),
        ]
      : [];
    const foot = make(
      "div.row",
      {},
      make("span.quiet", {}, step?.total ? `Trial ${step.number} of ${step.total}` : ""),
      ...due,
      ...(session?.pilot ? [make("strong.simulated", {}, "PILOT")] : []),
      ...(this.link.state.player?.simulated ? [make("strong.simulated", {}, "SIMULATED")] : []),
      stop,
    );
    foot.style.justifyContent = "space-between";
    this.studio.footer.hidden = false;
    this.studio.footer.replaceChildren(foot);
    this.studio.main.replaceChildren(main);
    // No answer and no consent has the focus: a key that was meant for the step before must not
    // choose it.
    const chooses = step?.consent || this.answers.length,
      words = main.querySelector("h2, p");
    words.tabIndex = -1;
    (chooses
      ? words
      : (main.querySelector("input") ?? main.querySelector("button") ?? words)
    ).focus();
    this.asked = performance.now();
  }
  /** The text, picture or sound that is presented now. */
  _medium({ study, media: { kind, source } }) {
    if (kind === "text") return make("h2", { id: "stimulus" }, source);
    const src = `/file/${[study, ...source.split("/")].map(encodeURIComponent).join("/")}`;
    return kind === "picture"
      ? make("img", { id: "stimulus", src, alt: "" })
      : make("audio", { id: "stimulus", src, autoplay: true });
  }
  _question({ question, turn }) {
    const answer = text =>
      tried(
        this.link.order("study", "answer", {
          turn,
          text,
          reaction_s: (performance.now() - this.asked) / 1000,
        }),
      );
    const ends = question.low_label
      ? make(
          "span.quiet",
          {},
          ` ${question.answers[0]} ${question.low_label}, ${question.answers.at(-1)} ${question.high_label}`,
        )
      : "";
    const title = make("h2", { id: "question" }, question.text);
    if (question.kind === "slider") {
      const given = make("input", {
        type: "range",
        min: question.low,
        max: question.high,
        step: (question.high - question.low) / 100,
        value: String((question.low + question.high) / 2),
        "aria-labelledby": "question",
        oninput: () => {
          next.disabled = false;
        },
        onkeydown: event => {
          if (event.key === "Enter") next.click();
        },
      });
      const next = make(
        "button.main",
        { id: "next", disabled: true, onclick: () => answer(given.value) },
        "Next",
      );
      return [
        title,
        make(
          "div.slider",
          {},
          make("span", {}, question.low_label || String(question.low)),
          given,
          make("span", {}, question.high_label || String(question.high)),
        ),
        next,
      ];
    }
    if (!question.answers.length) {
      const next = make("button.main", { id: "next", onclick: () => answer(given.value) }, "Next");
      const given = make("input", {
        ...(question.kind === "text"
          ? { type: "text", maxLength: 1000 }
          : { type: "number", min: 0, step: "any" }),
        "aria-labelledby": "question",
        onkeydown: event => {
          if (event.key === "Enter") next.click();
        },
      });
      return [title, given, next];
    }
    this.answers = question.answers.map(text =>
      make("button", { onclick: () => answer(text) }, text),
    );
    return [
      make("div", {}, title, ends),
      make("div.answers", { role: "group", "aria-labelledby": "question" }, ...this.answers),
    ];
  }
  /** The participant's keys: the number selects an answer, Escape stops. */
  _key(event) {
    if (!this.participant || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "Escape") {
      this._stop();
      return;
    }
    // Keys are ignored for 0.2 s after a step appears, and outside of its fields while they repeat.
    const field = event.target.closest?.("input"),
      early = performance.now() - this.asked < 200 || (event.repeat && !field);
    if (early && event.key !== "Tab") event.preventDefault();
    if (early || field) return;
    const numbers = this.answers?.every(each => /^\d+$/.test(each.textContent)),
      wanted = this.answers?.find((each, i) =>
        numbers ? each.textContent === event.key : String(i + 1) === event.key,
      );
    if (wanted) {
      event.preventDefault();
      wanted.click();
    }
  }
  _stop() {
    if (this.session && !["done", "stopped"].includes(this.session.step.kind))
      tried(this.link.order("study", "stop", { reason: "the participant" }));
  }
}
