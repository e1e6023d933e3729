/* The air of the room in the header, and warnings that stay while their cause lasts: other air,
    hot units. */

import { buttonOf, field, make, openModal, tried } from "/web/dom.js";

const shown = degrees => `${degrees.toFixed(1)} °C`;
const button = (words, onclick, title, id) => buttonOf(words, title, onclick, { id });

/** The warning that the room differs by 1 K from the air that a drive was solved for, or "". */
export function otherAir({ state: { air } }, solved) {
  if (
    !Number.isFinite(solved) ||
    typeof air?.degrees !== "number" ||
    Math.abs(air.degrees - solved) < 1
  )
    return "";
  return `air: the room has ${shown(air.degrees)}, the drive was solved for ${shown(solved)}`;
}

/** A box with buttons; tell(words) shows it, tell("") hides it. */
export function warningBox(id, ...buttons) {
  const words = make("span"),
    box = make(
      "div.warning",
      { id, role: "alert", hidden: true },
      words,
      make("div.buttons", {}, ...buttons),
    );
  box.tell = said => {
    if (words.textContent !== said) words.textContent = said;
    box.hidden = !said;
  };
  return box;
}

/** The warning of a play that pauses in silence, with the choice to stop or to wait; off() ends
    it. */
export function heatWarning(link, id) {
  const wait = button(
    "Wait until they have cooled",
    () => tried(link.order("play", "wait")),
    "Continues by itself when the units are cool",
  );
  const box = warningBox(
    id,
    button("Stop", () => tried(link.stop()), "Ends this play"),
    wait,
  );
  box.off = link.on("player", ({ hot, waits }) => {
    wait.hidden = waits;
    box.tell(
      hot &&
        `${hot}. ${waits ? "It then continues by itself." : "It stays silent until you choose."}`,
    );
  });
  return box;
}

/** The button in the header that shows the air of the room, and its dialog. */
export function airShown(link) {
  const pill = document.getElementById("state-air"),
    dialog = document.getElementById("air");
  link.on("air", air => {
    pill.textContent = air.degrees === null ? "air not stated" : `air ${shown(air.degrees)}`;
    pill.title =
      air.degrees === null
        ? `best mode: ${air.default} °C`
        : `${air.temperature}, humidity ${air.humidity === null ? "not stated" : `${air.humidity} %`}`;
  });
  pill.addEventListener("click", () => {
    const { air } = link.state,
      problem = make("p.bad", { role: "alert" });
    const temperature = make("input", {
      type: "text",
      value: air.temperature,
      maxLength: 20,
      autocomplete: "off",
      placeholder: "22C",
    });
    const humidity = make("input", {
      type: "number",
      min: 0,
      max: 100,
      step: "any",
      value: String(air.humidity ?? ""),
    });
    const state = async given => {
      problem.textContent = "";
      try {
        await link.order("air", "state", given);
        dialog.close();
      } catch (wrong) {
        problem.textContent = wrong.message;
      }
    };
    dialog.replaceChildren(
      make("h2", { id: "air-title" }, "Air of the room"),
      make(
        "p",
        {},
        "Drives are solved for this air, and the exposure check covers it. Without it, " +
          "drives are solved for the air of their mode, and the check covers 14 to 30 °C.",
      ),
      field("Temperature", temperature, "Degrees Celsius such as 22C"),
      field("Humidity, %", humidity, "Relative humidity, which damps the sound"),
      problem,
      make(
        "div.buttons",
        {},
        button(
          "Use this air",
          () =>
            state({
              temperature: temperature.value,
              humidity: humidity.value === "" ? null : Number(humidity.value),
            }),
          "New drives are solved for this air",
          "use-air",
        ),
        button("Not stated", () => state({}), "Takes the stated air back"),
        button("Close", () => dialog.close(), "Changes nothing"),
      ),
    );
    for (const one of dialog.querySelectorAll("#use-air, input")) one.disabled = !link.controls;
    openModal(dialog, link);
  });
}
