// The drawer with the renderer's settings, described in plain words.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, complain, el, finite, number, setText } from "/web/ui.js";

const FIELDS = [
  { key: "sigma_px", name: "Depth tolerance", low: "clears more", high: "smoother", step: 0.1, digits: 1, unit: " px",
    text: "How near to the focus a surface must be to count fully. Small makes occluders vanish, large keeps more of what "
      + "stands around." },
  { key: "c1", name: "What is out of focus still counts", low: "gone", high: "all", min: 0, max: 0.3, step: 0.005,
    digits: 1, percent: true,
    text: "Least weight of surfaces away from the focus. Zero removes them; more gives a calmer picture with a veil of them." },
  { key: "c2", name: "What bears a foreign label still counts", low: "gone", high: "all", min: 0, max: 1, step: 0.01,
    digits: 0, percent: true,
    text: "Minimum weight of objects whose depth range does not contain the focus. At 100 % labels have no influence." },
  { key: "label_factor", name: "Strength of the label kept clear", low: "gentle", high: "strong", min: 1, max: 16,
    step: 0.5, digits: 1, unit: "×", text: "All other labels count less by this factor." },
  { key: "aperture", name: "Cameras used", low: "near the middle", high: "all", step: 0.1, digits: 1,
    text: "Radius around the viewpoint, in camera spacings. More cameras see farther around occluders; fewer blur less." },
];

export class Adjust {
  /** @param app  {view, change()}; @param onReset  called to restore the service's defaults */
  constructor(app, onReset) {
    this.app = app;
    this.widest = 4.3;
    this.span_px = 0;
    this.inputs = new Map();
    for (const field of FIELDS) this.add(field);
    this.addFollow();
    $("adjust").addEventListener("click", () => this.toggle($("drawer").hidden));
    $("adjust-close").addEventListener("click", () => this.toggle(false));
    $("drawer").addEventListener("keydown", (event) => { if (event.key === "Escape") this.toggle(false); });
    $("adjust-reset").addEventListener("click", () => {
      onReset();
      setTimeout(() => this.load(), 400);
    });
  }

  add(field) {
    const id = `adjust-${field.key}`;
    const input = el("input", { type: "range", id, min: field.min ?? 0.1, max: field.max ?? 10, step: field.step,
      "aria-describedby": `${id}-text` });
    const value = el("output", { for: id });
    input.addEventListener("input", () => {
      this.show(field);
      this.app.change({ [field.key]: this.value(field) });
    });
    this.inputs.set(field.key, { input, value });
    $("adjust-fields").append(el("div", { class: "field" }, el("label", { for: id }, field.name), value, input,
      el("p", { class: "ends", "aria-hidden": "true" }, el("span", {}, field.low), el("span", {}, field.high)),
      el("p", { class: "quiet", id: `${id}-text` }, field.text)));
  }

  addFollow() {
    this.follow = el("input", { type: "checkbox", id: "adjust-follow" });
    this.follow.addEventListener("change", () => this.app.change({ follow: this.follow.checked }));
    $("adjust-fields").append(el("div", { class: "field check" }, this.follow,
      el("label", { for: "adjust-follow" }, "Focus follows the label kept clear"),
      el("p", { class: "quiet" }, "When it comes nearer or goes farther away, the focus goes with it.")));
  }

  /** At the end of the slider the aperture includes every camera: null. */
  value(field) {
    const now = Number(this.inputs.get(field.key).input.value);
    return field.key === "aperture" && now >= this.widest ? null : now;
  }

  /** Ranges that depend on the array and the scene. */
  update(status) {
    this.follow.checked = this.app.view.settings.follow === true;
    const [far, near] = status.live?.range_px ?? [];
    const span = near - far;
    if (!finite(span) || span <= 0 || span === this.span_px) return;
    this.span_px = span;
    this.inputs.get("sigma_px").input.max = Math.max(1, Math.round(span / 3));
    for (const field of FIELDS) this.show(field);
  }

  setGrid(rows, cols) {
    const widest = Math.hypot(Math.ceil(rows / 2), Math.ceil(cols / 2));
    this.widest = Math.ceil(widest * 10) / 10;
    this.inputs.get("aperture").input.max = this.widest;
  }

  show(field) {
    const { input, value } = this.inputs.get(field.key);
    const now = Number(input.value);
    const all = field.key === "aperture" && now >= this.widest;
    const text = all ? "all" : field.percent ? `${number(now * 100, field.digits)} %`
      : `${number(now, field.digits)}${field.unit ?? ""}`;
    setText(value, text);
    input.setAttribute("aria-valuetext", text);
  }

  toggle(open) {
    $("drawer").hidden = !open;
    $("adjust").setAttribute("aria-expanded", open);
    if (open) {
      this.load();
      $("stage-box").scrollIntoView({ block: "nearest" }); // on a phone the drawer is below it
      $("adjust-close").focus({ preventScroll: true });
    } else {
      $("adjust").focus({ preventScroll: true });
    }
  }

  /** The settings in use by the service. */
  async load() {
    try {
      const view = await this.app.view.current();
      if (!view) return;
      const { settings } = view;
      for (const field of FIELDS) {
        const now = settings[field.key];
        const { input } = this.inputs.get(field.key);
        if (finite(now)) input.value = now;
        else if (field.key === "aperture") input.value = this.widest;
        else if (field.key === "sigma_px") input.value = this.span_px / 10;
        this.show(field);
      }
    } catch (error) {
      complain(error);
    }
  }
}
