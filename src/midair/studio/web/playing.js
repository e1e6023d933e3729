/* The dialog before playing: exposure, remedies if it is too high, and a button that must be
    held. */

import { buttonOf, field, make, openModal, table, tried, whenHeld } from "/web/dom.js";
import { palmView } from "/web/palm-view.js";
import { solveTake } from "/web/jobs.js";
import { takeOf } from "/web/take.js";
import { heatWarning } from "/web/warnings.js";

/** `correct`: with phases corrected for the air of the room. */
export function askToPlay(studio, take, correct = false, solve = undefined) {
  const { link } = studio,
    dialog = document.getElementById("exposure"),
    given = {
      take,
      attenuate: false,
      override: "",
      protection_db: 0,
      repeats: 1,
      correct_air: correct,
      solve,
      follow: "",
    };
  const verdict = make("p", { role: "status" }, "checking …"),
    places = make("div"),
    refused = make("div.column");
  const simulated = link.state.player.device === "virtual",
    hold = make(
      simulated ? "button.main" : "button.main.hold",
      {
        disabled: true,
        id: "hold",
        title: simulated ? "Plays and re-records" : "Hold for 0.6 s",
      },
      simulated ? "Play" : "Hold to play",
    );
  const done = make("progress", { max: 1, value: 0, hidden: true, "aria-label": "progress" });
  const repeats = make("input", {
    type: "number",
    min: 1,
    max: 100,
    value: "1",
    onchange: () => {
      given.repeats = Math.max(1, Math.min(100, Number(repeats.value) || 1));
      check();
    },
  });
  const loop = make("input", { type: "checkbox", id: "loop" });
  const tracker = make("input", {
    type: "text",
    id: "follow",
    autocomplete: "off",
    placeholder: "leap:, lsl:NAME, osc:PORT, replay:FILE.csv",
    onchange: follow,
  });
  const latency = make("input", {
    type: "number",
    id: "latency",
    min: 0,
    max: 1000,
    placeholder: "measured",
    onchange: follow,
  });
  const palm = palmView(link);
  function follow() {
    given.follow = tracker.value.trim();
    if (given.follow && latency.value !== "") given.latency_ms = Number(latency.value);
    else delete given.latency_ms;
    check();
  }
  const protection = make("input", {
    type: "number",
    min: 0,
    max: 40,
    value: "0",
    onchange: () => {
      given.protection_db = Math.max(0, Math.min(40, Number(protection.value) || 0));
      check();
    },
  });
  const measured = make("p.quiet"),
    hot = heatWarning(link, "hot-play");
  let clearance = 0,
    checks = 0,
    looping = false;
  dialog.replaceChildren(
    make(
      "h2",
      { id: "exposure-title" },
      `Play ${take.replace(/^(sample|drawn):/, "").replace(/\.(h5|toml)$/, "")} on ` +
        `${link.state.player.device === "virtual" ? "the virtual array" : link.state.player.device}`,
    ),
    verdict,
    refused,
    hot,
    places,
    measured,
    make(
      "div.column",
      {},
      field("Times", repeats, "How often it plays in sequence"),
      field(
        "Loop until STOP",
        loop,
        "A drive that is solved meanwhile is played from the next pass",
      ),
      field(
        "Ear protection of everyone here, dB at 40 kHz",
        protection,
        "Is subtracted from the level at the ears",
      ),
      field(
        "Follow the palm of a tracker",
        tracker,
        "Steers each frame to the palm; the sound fades when the palm is lost",
      ),
      field(
        "Its latency, ms",
        latency,
        "Time from a pose of the palm to its arrival; empty: as measured",
      ),
    ),
    palm,
    make(
      "div.buttons",
      {},
      hold,
      buttonOf("Close", "Back to the panel", () => dialog.close()),
    ),
    done,
    make(
      "p.quiet",
      {},
      "The array plays only while this page is visible, and stops at most 0.5 s later. Esc, " +
        "STOP, or STOP on any other page of the studio silences it.",
    ),
  );

  async function check() {
    hold.disabled = true;
    done.hidden = false;
    done.removeAttribute("value");
    const turn = ++checks,
      found = await tried(link.order("play", "check", given));
    if (turn !== checks) return; // a later check withdraws this one
    done.hidden = true;
    if (!found) {
      verdict.textContent = "the exposure could not be checked";
      return;
    }
    clearance = found.number;
    measured.textContent =
      `Heat: ${found.heat}. Computed for ` +
      `${found.measured_in}.${given.correct_air ? " The phases are corrected for the air of the room." : ""}`;
    verdict.textContent =
      found.outcome === "exceeded"
        ? `On a real array: ${found.verdict.replace(/^exceeded: /, "")}. It may be played here: the array is simulated and emits no sound.`
        : found.refused || found.verdict;
    if (found.replaces) verdict.append(` ${found.replaces} exists and will be replaced.`);
    verdict.className = found.refused ? "bad" : found.outcome === "exceeded" ? "" : "good";
    places.replaceChildren(
      table(
        ["place", "loudest frame", "limit"],
        found.places.map(place => [
          place.name + (place.enforced ? "" : " (advice)"),
          `${place.peak_db} dB`,
          `${place.limit_db} dB`,
        ]),
      ),
    );
    hold.disabled = !clearance || !link.controls;
    refused.replaceChildren();
    if (!found.refused) return;
    const name = make("input", { type: "text", autocomplete: "off", "aria-label": "Your name" });
    name.placeholder = "your name";
    const again = how => (Object.assign(given, { attenuate: false, override: "" }, how), check()),
      answer = () =>
        name.value.trim()
          ? again({ override: name.value })
          : ((name.required = true), name.reportValidity());
    /** What a page offers for each way; none is taken by itself. */
    const acts = {
      "protect all ears in the room": [
        buttonOf("State it", "Its attenuation in dB, worn by everyone here", () => protection.focus()),
      ],
      "solve for quiet ears": [
        buttonOf("Solve quiet", "Another drive, at most 110 dB at the ears", async () => {
          dialog.close();
          const made = await solveTake(link, { take: takeOf(take), mode: "quiet" });
          if (made) studio.go("reproduce", made.take);
        }),
      ],
      "play it weaker": [
        buttonOf("Attenuate", "Weaker, within the limits", () => again({ attenuate: true })),
      ],
      "answer for it by name": [
        name,
        buttonOf("Answer for it", "Logged with your name; wear ear protection", answer),
      ],
    };
    refused.append(
      table(
        ["what you can do", "felt by", ""],
        found.ways.map(([way, people]) => [
          way,
          people === null ? "solve it to see" : `${people} of 10 people`,
          make("div.buttons", {}, ...acts[way.split(",")[0]]),
        ]),
        3,
      ),
    );
  }
  async function play() {
    hold.disabled = true;
    done.hidden = false;
    const off = link.on("player", player => {
      done.value = player.total ? player.done / player.total : 0;
      if (player.said && !looping) verdict.textContent = player.said;
    });
    looping = loop.checked;
    if (looping)
      verdict.textContent =
        "Loops until STOP. Close this to change settings and Solve: the new drive is played from its next pass.";
    const report = await tried(link.order("play", "play", { clearance, loop: looping }));
    looping = false;
    if (!dialog.open) tried(link.order("play", "unfollow"));
    off();
    done.hidden = true;
    verdict.textContent = report
      ? report.output
        ? `played, and re-recorded as ${report.output}`
        : `played ${report.frames} frames, ${report.late ?? 0} late`
      : link.state.player.said;
    verdict.className = report ? "good" : "bad";
    if (report) {
      const more = [
        buttonOf(
          "Check and play again",
          "Replaces the re-recording",
          () => {
            for (const one of more) one.remove();
            return check();
          },
          { id: "play-again" },
        ),
        ...(report.output && !take.endsWith(".toml")
          ? [
              buttonOf(
                "Compare",
                "Re-recording beside the original",
                () => {
                  dialog.close();
                  studio.go("compare", take);
                },
                { id: "to-compare" },
              ),
            ]
          : []),
      ];
      hold.parentElement.append(...more);
    }
    if (dialog.open) {
      given.override = "";
      setTimeout(() => {
        if (dialog.open && !report) check();
      }, 300);
    }
  }
  if (simulated)
    hold.addEventListener("click", play); // no sound: one press is enough
  else whenHeld(hold, play);
  // Pictures pause behind the dialog: the page must send "alive" messages from the same thread.
  studio.room?.transport?.pause();
  dialog.addEventListener(
    "close",
    () => {
      hot.off();
      palm.off();
      if (!looping) tried(link.order("play", "unfollow"));
    },
    { once: true },
  );
  openModal(dialog, link);
  check();
}
