// Labels that can be kept clear, or removed from the clear picture: one chip for each label in the picture.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, source } from "/web/api.js";
import { $, el, number, setText, swatch } from "/web/ui.js";

const WORDS = {
  focus_label: { caption: "Keep clear", none: "Everything", noneTitle: "All labels count alike",
    title: (name) => `Focus on ${name}, follow it, and let all other labels count less` },
  remove_label: { caption: "Also remove", none: "Nothing", noneTitle: "Labels remove nothing",
    title: (name) => `Remove what bears the label ${name}` },
};
const SHOWN_SHARE = 0.0005; // fraction of the picture; less is label noise

export class Labels {
  /** @param onChoose  called with settings: the name of a label, "" for none */
  constructor(onChoose) {
    this.onChoose = onChoose;
    this.key = "focus_label"; // the setting that the chips change
    this.names = { focus_label: "", remove_label: "" };
    this.all = [];
    this.chips = new Map();
    this.none = this.chip("", "", null);
    $("chips").append(this.none);
    this.empty = el("span", { class: "quiet" }, "no labels yet");
    $("chips").append(this.empty);
    this.show();
  }

  get chosen() {
    return this.names[this.key];
  }

  /** @param key  "focus_label" or "remove_label" */
  setKey(key) {
    this.key = key;
    this.show();
  }

  chip(name, text, colour) {
    const share = el("small", {});
    return el("button", {
      type: "button", class: "chip", "aria-pressed": String(name === this.chosen),
      onclick: () => this.choose(name === this.chosen ? "" : name),
    }, swatch(colour), el("span", {}, text), share);
  }

  choose(name) {
    this.names[this.key] = name;
    this.onChoose(this.key === "focus_label" ? { focus_label: name, follow: name !== "" } : { [this.key]: name });
    this.show();
  }

  adopt({ focus_label, remove_label }) {
    this.names = { focus_label: focus_label ?? "", remove_label: remove_label ?? "" };
    this.show();
  }

  /** Colour of a class by its name; undefined: unknown. */
  colourOf(name) {
    return this.all.find((entry) => entry.name === name)?.colour;
  }

  name(label) {
    return this.all.find((entry) => entry.label === label)?.name ?? "";
  }

  colour(label) {
    return this.all.find((entry) => entry.label === label)?.colour ?? "";
  }

  present() {
    return this.all.filter((entry) => entry.share >= SHOWN_SHARE || entry.name === this.chosen);
  }

  /** Labels worth a chip, which the service offers after a minute in the picture. */
  offered() {
    return this.present().filter((entry) => entry.offered !== false || entry.name === this.chosen);
  }

  async refresh() {
    this.all = (await get(`${source.base}/api/v1/labels`)).labels;
    for (const [key, name] of Object.entries(this.names))
      if (name && !this.all.some((entry) => entry.name === name)) { // the network changed
        this.names[key] = "";
        this.onChoose({ [key]: "" });
      }
    this.show();
  }

  show() {
    const present = this.offered();
    const words = WORDS[this.key];
    setText($("labels-caption"), words.caption);
    setText(this.none.querySelector("span"), words.none);
    this.none.title = words.noneTitle;
    const names = new Set(present.map((entry) => entry.name));
    for (const [name, chip] of this.chips)
      if (!names.has(name)) {
        chip.remove();
        this.chips.delete(name);
      }
    for (const entry of present) {
      if (!this.chips.has(entry.name)) {
        const chip = this.chip(entry.name, entry.name, entry.colour);
        this.chips.set(entry.name, chip);
        // in class order, so that chips do not jump as fractions change
        const later = present.slice(present.indexOf(entry) + 1).find((other) => this.chips.has(other.name));
        $("chips").insertBefore(chip, later ? this.chips.get(later.name) : this.empty);
      }
      const chip = this.chips.get(entry.name);
      chip.setAttribute("aria-pressed", String(entry.name === this.chosen));
      chip.title = words.title(entry.name);
      const percent = entry.share * 100;
      setText(chip.lastElementChild, percent < 0.1 ? "0 %" : `${number(percent, percent < 9.95 ? 1 : 0)} %`);
    }
    this.none.setAttribute("aria-pressed", String(this.chosen === ""));
    this.empty.hidden = present.length > 0;
  }
}
