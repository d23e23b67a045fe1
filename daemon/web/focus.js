// Focus: the slider from near to far, Auto, and the sweep back and forth.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, el, finite, icon, number, setText } from "/web/ui.js";

const SWEEP_S = 7; // one way at 1x
const SWEEP_EVERY_MS = 90;
const RANGE_KEPT_MS = 60000;

export class Focus {
  /** @param onFocus  called with px per spacing, or null for the service's own choice */
  constructor(onFocus) {
    this.onFocus = onFocus;
    this.px = null;
    this.auto_px = NaN;
    this.followed_px = NaN;
    this.far_px = NaN;
    this.near_px = NaN;
    this.ranges = []; // {now, far, near} of the last minute
    this.metres_px = 0; // focal length times spacing = distance in metres of disparity 1 px; 0: unknown
    this.timer = null;
    this.slider = $("focus");
    this.slider.addEventListener("input", () => {
      this.stopSweep();
      this.set(this.fromSlider());
    });
    $("auto").addEventListener("click", () => {
      this.stopSweep();
      this.set(null);
    });
    $("sweep").addEventListener("click", () => (this.timer ? this.stopSweep() : this.startSweep()));
    this.showSweep();
    this.show();
  }

  /** Adopts the settings of an existing view: of a reloaded page or of another client. */
  adopt({ focus_px }) {
    this.px = finite(focus_px) ? focus_px : null;
    this.show();
  }

  /** Updates from the status. */
  update(live) {
    const [far, near] = Array.isArray(live?.range_px) ? live.range_px : [NaN, NaN];
    if (far < near) this.widen(far, near);
    this.auto_px = finite(live?.focus_px) ? live.focus_px : NaN;
    this.metres_px = finite(live?.focal_px) && finite(live?.spacing_mm) ? live.focal_px * live.spacing_mm / 1000 : 0;
    this.show();
  }

  /** The slider's scale covers the last minute, so that it does not jump when objects come and go. */
  widen(far, near) {
    const now = Date.now();
    this.ranges = [...this.ranges.filter((range) => now - range.now < RANGE_KEPT_MS), { now, far, near }];
    this.far_px = Math.min(...this.ranges.map((range) => range.far));
    this.near_px = Math.max(...this.ranges.map((range) => range.near));
  }

  /** Another service or scene: forget the range. */
  forget() {
    this.ranges = [];
  }

  known() {
    return this.near_px > this.far_px;
  }

  span() {
    return this.near_px - this.far_px;
  }

  /** The focus that the service chose by following a label; NaN when it follows none. */
  setFollowed(px) {
    this.followed_px = px;
    this.show();
  }

  now_px() {
    return Number.isNaN(this.followed_px) ? this.px ?? this.auto_px : this.followed_px;
  }

  set(px) {
    if (px !== null && this.known()) px = Math.min(Math.max(px, this.far_px), this.near_px);
    this.px = px === null ? null : Math.round(px * 1000) / 1000;
    this.show();
    this.onFocus(this.px);
  }

  /** Moves the focus by a fraction of the range; positive is nearer. */
  nudge(share) {
    if (!this.known() || Number.isNaN(this.now_px())) return;
    this.stopSweep();
    this.set(this.now_px() + share * this.span());
  }

  startSweep() {
    if (!this.known()) return;
    let at = Number.isNaN(this.now_px()) ? 0 : (this.near_px - this.now_px()) / this.span(); // 0: near, 1: far
    let way = at > 0.98 ? -1 : 1;
    let last_ms = performance.now();
    this.timer = setInterval(() => {
      const now_ms = performance.now();
      if (document.hidden) return;
      at += way * Number($("sweep-speed").value) * Math.min(now_ms - last_ms, 500) / 1000 / SWEEP_S;
      last_ms = now_ms;
      if (at >= 1 || at <= 0) way = at >= 1 ? -1 : 1;
      at = Math.min(Math.max(at, 0), 1);
      this.set(this.near_px - at * this.span());
    }, SWEEP_EVERY_MS);
    this.showSweep();
  }

  stopSweep() {
    clearInterval(this.timer);
    this.timer = null;
    this.showSweep();
  }

  showSweep() {
    const on = this.timer !== null;
    $("sweep").setAttribute("aria-pressed", on);
    $("sweep").replaceChildren(icon(on ? "pause" : "play"), el("span", {}, "Sweep"));
  }

  fromSlider() {
    return this.near_px - Number(this.slider.value) / Number(this.slider.max) * this.span();
  }

  /** "17.3 px"; where metres are known "3.9 m", and "∞" from where nothing shifts. */
  words(px) {
    if (!finite(px)) return "–";
    return this.metres_px > 0 ? (px > 0 ? this.metres(px) : "∞") : `${number(px, 1)} px`;
  }

  metres(px) {
    const m = this.metres_px / px;
    return `${number(m, m < 10 ? 2 : 1)} m`;
  }

  show() {
    const known = this.known();
    const px = this.now_px();
    this.slider.disabled = !known;
    $("sweep").disabled = !known;
    if (known && finite(px)) {
      const at = Math.round((this.near_px - px) / this.span() * Number(this.slider.max));
      if (document.activeElement !== this.slider || Math.abs(at - Number(this.slider.value)) > 1) this.slider.value = at;
      this.slider.style.setProperty("--at", `${at / 10}%`);
    }
    const both = this.metres_px > 0 && finite(px) && px > 0;
    this.slider.setAttribute("aria-valuetext", finite(px) ? this.words(px) : "not known yet");
    $("auto").setAttribute("aria-pressed", this.px === null);
    $("focus-value").title = both || !finite(px) ? "" : "Pixels of disparity. Once the array is calibrated, these are metres.";
    setText($("focus-value").firstChild, this.words(px));
    setText($("focus-value").lastChild, both ? ` · ${number(px, 1)} px` : "");
    setText($("near-end").lastElementChild, known ? this.words(this.near_px) : "");
    setText($("far-end").lastElementChild, known ? this.words(this.far_px) : "");
  }
}
