// Boxes around all that moves, with label and distance, in every mode, also before it is a track; and the badge of things that the clear
// picture is without.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { NOTHING_PX } from "/web/clear.js";
import { $, el, finite, number, setText, storage, visible } from "/web/ui.js";

const ASK_MS = 400;   // without a picture that asks before
const LEAST_MS = 80;
const REST_MS = 1000; // while nothing moves
const UNSEEN_MS = 700; // a box ends this long after its track was seen
const BEHIND_MS = 3000; // limit of the lag of processing behind a camera's picture
const KEY = "sst-boxes";
const PERSONS = ["Pedestrian", "Person", "person"];

const word = ({ name }) => (PERSONS.includes(name) ? "person" : name ? name.toLowerCase() : "moving thing");
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const metres = ({ distance_m }) => (finite(distance_m) ? `${number(distance_m, 1)} m` : "");

export class Boxes {
  /** @param app  {view, mode, clear, change()}; @param stage  {canvas, zoom, overlays} */
  constructor(app, stage) {
    this.app = app;
    this.stage = stage;
    this.tracks = [];
    this.unconfirmed = []; // {id, track, box, distance_m, seen}
    this.set_ms = NaN;   // time of their set
    this.behind_ms = 0;  // age of the set before, in the picture, when this one came
    this.nodes = new Map(); // by number of the track, or "u" and the id of an unconfirmed object
    this.wake = () => {};
    this.keeps = false;     // nothing that moves is removed
    this.on = storage(KEY) !== "off";
    $("boxes-on").addEventListener("click", () => {
      this.on = !this.on;
      storage(KEY, this.on ? "on" : "off");
      this.show();
    });
    $("removed").addEventListener("click", () => {
      this.keeps = !this.keeps;
      app.change({ keep_moving: this.keeps });
      this.show();
    });
    this.show();
    this.follow();
  }

  adopt({ keep_moving: keeps }) {
    this.keeps = keeps === true;
    this.show();
  }

  async follow() {
    for (;;) {
      await visible();
      const { time, tracks, unconfirmed } = await this.app.view.tracks().catch(() => ({ tracks: [] })); // the next status request reports why not
      this.take(Date.parse(time), tracks, unconfirmed);
      await new Promise((done) => setTimeout(done, LEAST_MS));
      await new Promise((done) => {
        this.wake = done;
        setTimeout(done, this.any() ? ASK_MS : REST_MS);
      });
    }
  }

  any() {
    return this.tracks.length + this.unconfirmed.length > 0;
  }

  take(set_ms, tracks, unconfirmed = []) {
    if (finite(set_ms) && set_ms !== this.set_ms) {
      const behind_ms = this.stage.drawn_ms() - this.set_ms;
      this.behind_ms = finite(behind_ms) ? Math.min(Math.max(behind_ms, 0), BEHIND_MS) : 0;
      this.set_ms = set_ms;
    }
    this.tracks = tracks;
    this.unconfirmed = unconfirmed;
    this.show();
  }

  /** A new picture is drawn: its tracks are known, and earlier ones may be over. */
  picture() {
    this.wake();
    if (this.any()) this.show();
  }

  /** Was a track seen just before the picture that is shown, or before the last set where that brings none? By time: a slow machine has few sets.
   *  A camera's picture is ahead of processing, usually by behind_ms. */
  isFresh({ seen }) {
    const now = Math.max(...[this.stage.drawn_ms() - (this.stage.overlays.camera ? this.behind_ms : 0), this.set_ms].filter(finite));
    return !(now - Date.parse(seen) > UNSEEN_MS);
  }

  /** "1.2 s ago" where the picture shows a later moment than the box. */
  ago({ seen }) {
    const age_ms = this.stage.overlays.camera ? this.stage.drawn_ms() - Date.parse(seen) : 0;
    return age_ms > UNSEEN_MS ? `${number(age_ms / 1000, 1)} s ago` : "";
  }

  /** Does the cut of this page's picture remove a track? Not with keep_moving. */
  isCut({ removed, disparity_px: px }) {
    const { cut_px: cut } = this.app.clear;
    return cut === null ? removed === true : cut !== NOTHING_PX && px > cut;
  }

  show() {
    const fresh = this.tracks.filter((track) => this.isFresh(track));
    const cut = this.app.mode === "clear" && !this.stage.overlays.camera ? fresh.filter((track) => this.isCut(track)) : [];
    $("boxes-on").setAttribute("aria-pressed", this.on);
    $("boxes").hidden = !this.on;
    const come = this.unconfirmed.filter((thing) => this.isFresh(thing));
    const others = come.filter((thing) => !fresh.some(({ track }) => track === thing.track));
    const keys = new Set([...fresh.map(({ track }) => track), ...others.map(({ id }) => `u${id}`)]);
    this.showBadge(cut);
    for (const [key, node] of this.nodes)
      if (!keys.has(key)) {
        node.remove();
        this.nodes.delete(key);
      }
    for (const track of fresh) // a newer place, if there is one
      this.showBox(track, cut.includes(track) && !this.keeps, come.find((thing) => thing.track === track.track)?.box ?? track.at ?? track.box);
    for (const thing of others) this.showUnconfirmed(thing);
  }

  /** "1 person removed, 4.4 m"; pressed, it brings them back. */
  showBadge(cut) {
    const badge = $("removed");
    badge.hidden = cut.length === 0;
    if (badge.hidden) return;
    const nearest = cut.reduce((best, track) => (track.disparity_px > best.disparity_px ? track : best));
    const same = cut.every((track) => word(track) === word(nearest)) ? word(nearest) : "moving thing";
    const many = cut.length > 1;
    setText(badge.firstElementChild, `${cut.length} ${same}${many ? "s" : ""} ${this.keeps ? "brought back" : "removed"}${
      metres(nearest) ? `, ${many ? "nearest " : ""}${metres(nearest)}` : ""}`);
    setText(badge.lastElementChild, this.keeps ? "Remove again" : "Bring back");
    badge.setAttribute("aria-pressed", this.keeps);
  }

  node(key) {
    if (!this.nodes.has(key)) {
      const node = el("div", { class: "box" }, el("span", {}));
      this.nodes.set(key, node);
      $("boxes").append(node);
    }
    return this.nodes.get(key);
  }

  showUnconfirmed(thing) {
    const node = this.node(`u${thing.id}`);
    node.dataset.state = "unconfirmed";
    setText(node.firstElementChild, ["Something moves", metres(thing)].filter(Boolean).join(" · "));
    this.place(node, thing.box);
  }

  showBox(track, removed, at) {
    const node = this.node(track.track);
    const ago = this.ago(track);
    node.dataset.state = removed ? "removed" : ago || track.state === "covered" ? "covered" : track.hidden ? "hidden" : "";
    setText(node.firstElementChild, [capital(word(track)), metres(track), removed ? "removed" : "", ago].filter(Boolean).join(" · "));
    node.title = track.label_by === "size and motion" ? "By size and motion" : "";
    this.place(node, at);
  }

  /** The part of the box that is in sight; its caption stays inside the picture. */
  place(node, [x0, y0, x1, y1]) {
    const { canvas, zoom } = this.stage;
    const corners = [zoom.toFrame([x0 / canvas.width, y0 / canvas.height]), zoom.toFrame([x1 / canvas.width, y1 / canvas.height])];
    const [[left, top], [right, bottom]] = corners.map((at) => at.map((v) => Math.min(Math.max(v, 0), 1)));
    node.hidden = right <= left || bottom <= top;
    node.style.left = `${100 * left}%`;
    node.style.top = `${100 * top}%`;
    node.style.width = `${100 * (right - left)}%`;
    node.style.height = `${100 * (bottom - top)}%`;
    node.dataset.side = `${top < 0.08 ? "in" : "above"} ${left > 0.75 ? "right" : "left"}`;
  }
}
