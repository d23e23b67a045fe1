// Clear picture: the cut on a slider over the histogram of depths, things removed by a tap, outline and tint.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, complain, finite, number, setText, toast } from "/web/ui.js";

export const NOTHING_PX = 9999; // nearer than anything: a cut that removes nothing
const HEIGHT = 32; // of the histogram's drawing, which is stretched over the slider

/** Shown beside the clear picture: the reference camera's picture, pixel by pixel. */
export const CAMERA = { method: "clear", cut_px: NOTHING_PX, remove_label: "", outline: false, outline_moving: false, tint: false };

export class Clear {
  /** @param focus     knows the range of depths, and words for them; @param onChange  called with settings
   *  @param onRestore  async: brings all removed things back */
  constructor(focus, onChange, onRestore) {
    this.focus = focus;
    this.onChange = onChange;
    this.cut_px = null; // null: automatic
    this.ground_px = null;
    this.auto_px = NaN;
    this.histogram = null;
    this.objects = 0;
    this.note = "";
    this.slider = $("cut");
    this.slider.addEventListener("input", () => this.set(this.fromSlider()));
    $("cut-auto").addEventListener("click", () => this.set(null));
    for (const key of ["outline", "tint"])
      $(key).addEventListener("click", () => {
        const on = $(key).getAttribute("aria-pressed") !== "true";
        $(key).setAttribute("aria-pressed", on);
        onChange({ [key]: on });
      });
    $("restore").addEventListener("click", async () => {
      try {
        await onRestore();
        this.setObjects(0);
        toast("All things are back in the picture.");
      } catch (error) {
        complain(error);
      }
    });
    this.show();
  }

  adopt({ cut_px, outline, tint }) {
    this.cut_px = finite(cut_px) ? cut_px : null;
    $("outline").setAttribute("aria-pressed", outline === true);
    $("tint").setAttribute("aria-pressed", tint === true);
    this.show();
  }

  /** Updates from the status; after the focus, as it shares its range. */
  update(live) {
    this.auto_px = finite(live?.cut_px) ? live.cut_px : NaN;
    this.ground_px = live?.surface ? live.focus_px ?? NaN : null; // of cameras that stand anywhere: there is no cut
    const { min_px, max_px, share } = live?.histogram ?? {};
    this.histogram = max_px > min_px && share?.length > 1 && share.every(finite) ? { min_px, max_px, share } : null;
    this.draw();
    this.show();
  }

  /** Updates from the view's own state. */
  setView(view) {
    if (finite(view?.objects)) this.setObjects(view.objects);
    const { remembered_percent: remembered, filled_percent: filled, oldest_s } = view ?? {};
    const parts = [];
    if (remembered >= 0.5)
      parts.push(`${number(remembered)} % remembered${oldest_s >= 1 ? `, up to ${number(oldest_s)} s old` : ""}`);
    if (filled >= 0.5) parts.push(`${number(filled)} % filled in`);
    this.note = parts.join(" · ");
  }

  setObjects(count) {
    this.objects = count;
    $("restore").hidden = count === 0;
    setText($("restore-count"), `${count} removed`);
  }

  /** A new view on the service removes nothing by points. */
  forget() {
    if (this.objects > 0) toast("What you removed is back: the page has a new view, as its last one expired.");
    this.setObjects(0);
  }

  now_px() {
    return this.cut_px ?? this.auto_px;
  }

  set(px) {
    if (px !== null && this.focus.known()) px = px > this.focus.near_px ? NOTHING_PX : Math.max(px, this.focus.far_px);
    this.cut_px = px === null ? null : Math.round(px * 1000) / 1000;
    this.show();
    this.onChange({ cut_px: this.cut_px });
  }

  /** Moves the cut by a fraction of the range; positive is nearer. */
  nudge(share) {
    if (!this.focus.known()) return;
    const { near_px } = this.focus;
    const px = finite(this.now_px()) ? Math.min(this.now_px(), near_px) : near_px;
    this.set(px + share * this.focus.span());
  }

  fromSlider() {
    const at = Number(this.slider.value) / Number(this.slider.max);
    return at === 0 ? NOTHING_PX : this.focus.near_px - at * this.focus.span();
  }

  /** The histogram from near to far, over the range of the slider; the square root shows small things, too. */
  draw() {
    const { focus, histogram } = this;
    $("histogram").toggleAttribute("data-empty", !histogram);
    if (!histogram || !focus.known()) {
      $("histogram-path").setAttribute("d", "");
      return;
    }
    const { min_px, max_px, share } = histogram;
    const most = Math.sqrt(Math.max(...share)) || 1;
    const at = (px) => ((focus.near_px - px) / focus.span() * 100).toFixed(2);
    const points = share.map((part, i) =>
      `${at(min_px + (i + 0.5) * (max_px - min_px) / share.length)} ${(HEIGHT * (1 - Math.sqrt(part) / most)).toFixed(2)}`);
    $("histogram-path").setAttribute("d", `M${at(min_px)} ${HEIGHT}L${points.join("L")}L${at(max_px)} ${HEIGHT}Z`);
  }

  /** [figure, the rest]: text of the cut. */
  words() {
    const px = this.now_px();
    if (!this.focus.known()) return ["–", this.ground_px === null ? " the depths are not known yet" : " the ground is being sought"];
    if (this.ground_px !== null) return [this.focus.words(this.ground_px), " · the ground; what hides it is dimmed"];
    if (!finite(px)) return ["–", " nothing stands in front"];
    if (px > this.focus.near_px) return ["–", " nothing is removed"];
    return [this.focus.words(px), this.focus.metres_px > 0 ? ` · ${number(px, 1)} px` : ""];
  }

  show() {
    const { focus, slider } = this;
    const known = focus.known();
    const px = this.now_px();
    const at = known && finite(px) ? Math.min(Math.max((focus.near_px - px) / focus.span(), 0), 1) : 0;
    const value = Math.round(at * Number(slider.max));
    slider.disabled = !known || this.ground_px !== null;
    $("cut-auto").hidden = this.ground_px !== null;
    if (document.activeElement !== slider || Math.abs(value - Number(slider.value)) > 1) slider.value = value;
    for (const stop of $("histogram").querySelectorAll("stop")) stop.setAttribute("offset", at);
    $("histogram-removed").setAttribute("width", 100 * at);
    $("cut-auto").setAttribute("aria-pressed", this.cut_px === null);
    const [figure, more] = this.words();
    setText($("cut-value").firstChild, figure);
    setText($("cut-value").lastChild, more);
    slider.setAttribute("aria-valuetext", figure === "–" ? more.trim() : figure);
    setText($("cut-near").lastElementChild, known ? focus.words(focus.near_px) : "");
    setText($("cut-far").lastElementChild, known ? focus.words(focus.far_px) : "");
  }
}
