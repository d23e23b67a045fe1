// The picture: pointing, comparing, overlays, its age, and the message shown while there is none.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { Boxes } from "/web/boxes.js";
import { CAMERA } from "/web/clear.js";
import { Overlays } from "/web/overlays.js";
import { picture } from "/web/portrait.js";
import { $, complain, el, finite, number, setText, storage, swatch, toast } from "/web/ui.js";
import { View } from "/web/view.js";
import { Zoom } from "/web/zoom.js";

const TAP_PX = 8;
const TAP_MS = 700;
const WHEEL_SHARE = 0.00025; // of the range of depths, per px of wheel with Shift
const WHEEL_ZOOM = 0.0025; // octaves per px of wheel
const KEY_ZOOM = 1.5;
const CARD_MS = 12000;
const RING_MS = 1200;
const SAME_PX = 1.5; // of the object in front before
const OLD_MS = 2500;
const DELAYS = 15; // of the last pictures, of which the median is shown
const APART_MS = 1500; // of a recording: pictures that are not of one moment are not compared

const WORDS = {
  clear: { left: "Clear", right: "Camera", hint: "sst-hint-clear",
    keys: "Enter removes what is under it or brings it back, plus and minus move the cut, Z zooms in, Shift Z out" },
  sst: { left: "See-through", right: "Plain refocus", hint: "sst-hint",
    keys: "Enter focuses on what is under it, plus and minus move the focus, Z zooms in, Shift Z out" },
};

export class Stage {
  /** @param app  {view, mode, focus, clear, depth(), labels, still(): framesets arrive and nothing changes in them} */
  constructor(app) {
    this.app = app;
    this.frame = $("stage");
    this.canvas = $("canvas");
    this.mode = "";
    this.cross = null; // fraction of the picture, moved by the keyboard
    this.plain = null; // View of the right half, while it is shown
    this.spare = null; // the same one, kept for the next time
    this.lost = null;  // time of the loss
    this.refused = ""; // reason why there is no stream, if the service or the browser gave one
    this.pointers = new Map();
    this.picks = 0;
    this.placed = new Map(); // marks: where they are in the picture
    this.draws = null; // tool of taps and drags while a zone is drawn
    this.zoom = new Zoom(this.frame, () => this.zoomed());
    this.overlays = new Overlays(app);
    this.boxes = new Boxes(app, this);
    this.delays_ms = []; // of the last pictures, when they were drawn
    this.listen();
    this.compare();
    $("hint-close").addEventListener("click", () => {
      this.closeHint();
      this.frame.focus();
    });
    setInterval(() => this.showAge(), 250);
  }

  // --- pointing ---

  listen() {
    const frame = this.frame;
    frame.addEventListener("wheel", (event) => {
      event.preventDefault();
      const px = Math.max(-200, Math.min(200, (event.deltaY || event.deltaX) * (event.deltaMode === 1 ? 32 : 1))); // Shift turns it
      if (event.shiftKey) this.app.depth().nudge(-px * WHEEL_SHARE);
      else this.zoom.by(2 ** (-px * WHEEL_ZOOM), this.zoom.at(event.clientX, event.clientY));
    }, { passive: false });
    frame.addEventListener("pointerdown", (event) => this.down(event));
    frame.addEventListener("pointermove", (event) => this.move(event));
    frame.addEventListener("pointerup", (event) => this.up(event));
    for (const kind of ["pointercancel", "pointerleave"])
      frame.addEventListener(kind, (event) => this.pointers.delete(event.pointerId));
    frame.addEventListener("keydown", (event) => this.key(event));
    frame.addEventListener("blur", () => { $("crosshair").hidden = true; });
    $("fullscreen").addEventListener("click", () => {
      if (document.fullscreenElement) document.exitFullscreen();
      else document.querySelector(".viewer").requestFullscreen?.().catch(complain);
    });
    $("fullscreen").hidden = !document.fullscreenEnabled;
  }

  down(event) {
    if (event.target.closest("#pick, #divider, #removed, .corner") || event.button > 0) return;
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, x0: event.clientX, y0: event.clientY,
      at: event.timeStamp, many: false });
    if (this.pointers.size > 1) for (const pointer of this.pointers.values()) pointer.many = true;
  }

  move(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return;
    const before = this.between();
    pointer.x = event.clientX;
    pointer.y = event.clientY;
    const after = this.between();
    if (before.spread > 20 && after.spread > 20) this.zoom.by(after.spread / before.spread, this.zoom.at(after.x, after.y));
    const far = Math.hypot(pointer.x - pointer.x0, pointer.y - pointer.y0) > TAP_PX;
    if (far && !pointer.many && this.draws?.wantsDrag())
      this.draws.drag(this.point(pointer.x0, pointer.y0), this.point(pointer.x, pointer.y));
    else if (pointer.many || far)
      this.zoom.pan(after.x - before.x, after.y - before.y);
  }

  /** Middle of the pointers, and the distance of two; 0 of others. */
  between() {
    const all = [...this.pointers.values()];
    const [a, b] = all;
    const mean = (key) => all.reduce((sum, pointer) => sum + pointer[key], 0) / all.length;
    return { x: mean("x"), y: mean("y"), spread: all.length === 2 ? Math.hypot(a.x - b.x, a.y - b.y) : 0 };
  }

  /** Point of the picture under one of the page. */
  point(clientX, clientY) {
    return this.zoom.toPicture(this.zoom.at(clientX, clientY));
  }

  up(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (pointer && this.draws?.dragEnd()) return;
    if (!pointer || pointer.many || event.timeStamp - pointer.at > TAP_MS) return;
    if (Math.hypot(event.clientX - pointer.x0, event.clientY - pointer.y0) > TAP_PX) return;
    const box = this.canvas.getBoundingClientRect();
    this.tapAt((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  }

  key(event) {
    if (event.key === "Escape") this.closePick();
    if (event.target !== this.frame) return;
    const step = (event.shiftKey ? 0.1 : 0.02) / this.zoom.scale;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (moves[event.key]) {
      const [x, y] = this.cross ?? [0.5, 0.5];
      const within = (v) => Math.min(Math.max(v, 0), 0.999);
      this.cross = [within(x + moves[event.key][0]), within(y + moves[event.key][1])];
      this.zoom.show(this.cross);
      this.place($("crosshair"), this.cross);
    } else if (event.key === "Enter" || event.key === " ") {
      this.tapAt(...(this.cross ?? [0.5, 0.5]), true);
    } else if (event.key === "+" || event.key === "-") {
      this.app.depth().nudge(event.key === "+" ? 0.02 : -0.02);
    } else if (event.key === "z" || event.key === "Z") {
      this.zoom.by(event.key === "z" ? KEY_ZOOM : 1 / KEY_ZOOM, this.zoom.toFrame(this.cross ?? this.zoom.middle()));
    } else if (event.key === "0") {
      this.zoom.reset();
    } else {
      return;
    }
    event.preventDefault();
  }

  /** Asks about a point of the picture, which a ring marks meanwhile: removes the object there, or focuses on it. */
  async tapAt(x, y, byKey = false) {
    if (this.draws?.tap([x, y])) return;
    const mine = ++this.picks;
    const { view, mode } = this.app;
    const at = [x * this.canvas.width, y * this.canvas.height];
    this.closePick();
    this.place($("ring"), [x, y]);
    $("ring").dataset.busy = "1";
    try {
      const found = await (mode === "clear" ? view.remove(...at) : view.pick(...at));
      if (mode === "clear") this.showRemoved(found);
      if (mine !== this.picks) return;
      this.closeHint();
      if (mode === "clear") setTimeout(() => { if (mine === this.picks) this.closePick(); }, RING_MS);
      else this.focusOn(found, x, y, byKey);
    } catch (error) {
      if (mine === this.picks) this.closePick();
      complain(error);
    } finally {
      delete $("ring").dataset.busy;
    }
  }

  focusOn(found, x, y, byKey) {
    const { focus } = this.app;
    if (finite(found.disparity_px)) {
      focus.stopSweep();
      if (found.track) this.app.follow(found.track, found.name);
      else focus.set(found.disparity_px);
      this.place($("ring"), [x, y]);
    }
    this.showPick(found, x, y);
    if (byKey) $("pick").querySelector("button")?.focus();
  }

  /** The object in front may have gone since the card was shown: the point is asked about again. */
  async focusInFront(x, y, before) {
    const { focus, view } = this.app;
    this.closePick();
    try {
      const found = await view.pick(x * this.canvas.width, y * this.canvas.height);
      const track = before.front_track;
      if (track && found.front_track !== track) {
        if ((await view.tracks()).tracks.some((other) => other.track === track)) this.app.follow(track, before.front_name);
        else toast(`${before.front_name || "What stood in front"} is gone.`);
        return;
      }
      if (!finite(found.front_px) || Math.abs(found.front_px - before.front_px) > SAME_PX) toast("Nothing stands in front there now.");
      else if (track) this.app.follow(track, before.front_name);
      else focus.set(found.front_px);
    } catch (error) {
      complain(error);
    }
  }

  /** Marks the object that the focus follows, at its place now; null: it has gone. */
  showFollowed(track) {
    const ring = $("ring");
    if (!track) {
      this.closePick();
      return;
    }
    const [x0, y0, x1, y1] = track.box;
    const at = [(x0 + x1) / 2 / this.canvas.width, (y0 + y1) / 2 / this.canvas.height].map((v) => Math.min(Math.max(v, 0), 1));
    ring.dataset.state = track.state;
    this.place(ring, at);
    if (!$("pick").hidden) this.placeCard(at);
  }

  showRemoved({ removed, objects }) {
    this.app.clear.setObjects(objects);
    const tap = matchMedia("(pointer: coarse)").matches ? "Tap" : "Click";
    toast(removed ? `Removed. ${tap} there again to bring it back.` : "It is back in the picture.", "info", null, "tap");
  }

  showPick(found, x, y) {
    const { focus, labels } = this.app;
    const card = $("pick");
    const what = finite(found.disparity_px) ? found.name || "Something without a label" : "Nothing is known here";
    const head = el("p", { class: "pick-head" }, swatch(labels.colour(found.label)), el("strong", {}, what));
    const where = finite(found.disparity_px)
      ? el("p", { class: "quiet" }, this.measure(found.disparity_px))
      : el("p", { class: "quiet" }, "No camera pair agrees on this point. Try one close to it.");
    const buttons = el("div", { class: "pick-buttons" });
    if (found.name)
      buttons.append(el("button", { type: "button", class: "small", "aria-pressed": String(labels.chosen === found.name),
        onclick: () => { labels.choose(labels.chosen === found.name ? "" : found.name); this.closePick(); } },
      labels.chosen === found.name ? `Stop keeping ${found.name} clear` : `Keep ${found.name} clear`));
    if (finite(found.front_px) && (!finite(found.disparity_px) || found.front_px > found.disparity_px + 0.75)) {
      const name = labels.name(found.front_label) || "what stands in front";
      buttons.append(el("button", { type: "button", class: "small",
        onclick: () => this.focusInFront(x, y, found) },
      swatch(labels.colour(found.front_label)), `In front: ${name}, ${focus.words(found.front_px)}`));
    }
    card.replaceChildren(head, where, buttons);
    this.placeCard([x, y]);
    clearTimeout(this.cardTimer);
    this.cardTimer = setTimeout(() => { if (!card.contains(document.activeElement)) this.closeCard(); }, CARD_MS);
  }

  placeCard([x, y]) {
    const card = $("pick");
    this.place(card, [x, y]);
    [x, y] = this.zoom.toFrame([x, y]);
    card.dataset.side = `${y < 0.5 ? "below" : "above"} ${x < 0.25 ? "left" : x > 0.75 ? "right" : "middle"}`;
  }

  /** Shows a mark at a point of the picture, if that is in sight. */
  place(node, at) {
    this.placed.set(node, at);
    const [x, y] = this.zoom.toFrame(at);
    node.style.left = `${x * 100}%`;
    node.style.top = `${y * 100}%`;
    node.style.visibility = x >= 0 && x <= 1 && y >= 0 && y <= 1 ? "" : "hidden";
    node.hidden = false;
  }

  unplace(node) {
    this.placed.delete(node);
  }

  zoomed() {
    for (const [node, at] of this.placed) if (!node.hidden) this.place(node, at);
    this.boxes.show();
    this.clip();
  }

  measure(px) {
    const { focus } = this.app;
    return focus.metres_px > 0 && px > 0 ? `${focus.metres(px)} away · ${number(px, 1)} px` : `${number(px, 1)} px`;
  }

  /** The ring of the followed object stays. */
  closeCard() {
    const held = $("pick").contains(document.activeElement);
    $("pick").hidden = true;
    if (!this.app.followed()) $("ring").hidden = true;
    if (held) this.frame.focus();
  }

  closePick() {
    this.closeCard();
    $("ring").hidden = true;
    delete $("ring").dataset.state;
  }

  // --- comparing ---

  compare() {
    const divider = $("divider");
    let dragging = false;
    const to = (share) => {
      const percent = Math.round(Math.min(Math.max(share, 0), 1) * 100);
      divider.style.left = `${percent}%`;
      divider.setAttribute("aria-valuenow", percent);
      this.clip();
    };
    const share = () => Number(divider.getAttribute("aria-valuenow")) / 100;
    divider.addEventListener("pointerdown", (event) => {
      dragging = true;
      divider.setPointerCapture(event.pointerId);
    });
    divider.addEventListener("pointermove", (event) => {
      const box = this.frame.getBoundingClientRect();
      if (dragging) to((event.clientX - box.left) / box.width);
    });
    for (const kind of ["pointerup", "pointercancel"]) divider.addEventListener(kind, () => { dragging = false; });
    divider.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: -0.02, ArrowDown: -0.02, ArrowRight: 0.02, ArrowUp: 0.02, PageDown: -0.1, PageUp: 0.1,
        Home: -1, End: 1 };
      if (!(event.key in steps)) return;
      event.preventDefault();
      to(share() + steps[event.key]);
    });
    to(0.5);
    $("compare").addEventListener("click", () => (this.plain ? this.stopCompare() : this.startCompare()));
  }

  /** The right half lies right of the divider, whatever part of the picture is shown. */
  clip() {
    const percent = Number($("divider").getAttribute("aria-valuenow"));
    const [x] = this.zoom.toPicture([percent / 100, 0]);
    $("canvas-plain").style.clipPath = `inset(0 0 0 ${Math.min(Math.max(100 * x, 0), 100)}%)`;
  }

  startCompare() {
    this.spare ??= new View($("canvas-plain"), {}, (what, why) => {
      if (what === "shared") {
        this.stopCompare();
        this.spare = null;
        complain(why);
      }
      if (what === "picture" && this.plain && !this.app.replay.open) this.showRight(true);
    });
    this.plain = this.spare;
    this.plain.change(this.compared());
    this.plain.start();
    this.showCompare(true);
  }

  /** Settings of the right half. */
  compared() {
    return this.app.mode === "clear" ? CAMERA : { ...this.app.view.settings, method: "refocus" };
  }

  stopCompare() {
    this.plain?.stop();
    this.plain = null;
    this.showCompare(false);
  }

  showCompare(on) {
    $("compare").setAttribute("aria-pressed", on);
    $("divider").hidden = $("canvas-plain").hidden = $("tag-right").hidden = !on;
    if (on) this.showRight(false);
  }

  /** The right half is dark until its own picture is there: never the left one's under its name. */
  showRight(ready) {
    const { right } = WORDS[this.app.mode];
    $("canvas-plain").classList.toggle("loading", !ready);
    setText($("tag-right"), ready ? right : `${right}, loading`);
  }

  // --- source and mode ---

  /** The pictures are of another source. */
  sourceChanged() {
    this.closePick();
    this.delays_ms = [];
    this.lost = null;
    this.frame.classList.remove("stale");
    this.plain?.move(this.compared());
    this.overlays.sourceChanged();
  }

  /** Another mode: the compared picture changes with it. */
  setMode(mode) {
    if (this.mode === mode) return;
    this.mode = mode;
    const words = WORDS[mode];
    this.closePick();
    this.frame.setAttribute("aria-label", `Live picture: arrow keys move a cross-hair, ${words.keys}`);
    $("divider").setAttribute("aria-label", `Divider: ${words.left.toLowerCase()} left, ${words.right.toLowerCase()} right`);
    this.showRight(false);
    $("hint").hidden = storage(words.hint) === "seen";
    this.plain?.change(this.compared());
  }

  /** Caption in the corner of the picture. */
  showMethod() {
    const { clear, labels, mode, view } = this.app;
    if (this.overlays.camera) {
      setText($("tag-left"), [`Camera ${this.overlays.camera}, as it is`, this.app.levels()].filter(Boolean).join(" · "));
      return;
    }
    const parts = [view.shared ? "Main view, shared by all" : WORDS[mode].left];
    if (this.app.followed()) parts.push(`following ${this.app.followed().name || "it"}`);
    else if (labels.chosen) parts.push(mode === "clear" ? `without ${labels.chosen}` : `${labels.chosen} kept clear`);
    if (mode === "clear" && clear.note) parts.push(clear.note);
    if (this.app.levels()) parts.push(this.app.levels());
    setText($("tag-left"), parts.join(" · "));
  }

  // --- state of the stream ---

  closeHint() {
    $("hint").hidden = true;
    storage(WORDS[this.app.mode].hint, "seen");
  }

  onStream(what, why) {
    if (what === "lost") {
      this.lost ??= Date.now();
      this.refused = why?.status > 0 && why.status !== 404 ? why.message : "";
    }
    if (what === "picture") {
      this.lost = null;
      this.refused = "";
      this.boxes.picture();
      if (!this.overlays.shown()) this.drawn(this.app.view.stream);
      $("stage-box").style.setProperty("--ratio", this.canvas.width / this.canvas.height);
      this.frame.dataset.pictures = this.app.view.stream.pictures;
      this.app.replay.picture();
    }
  }

  /** A picture in sight was drawn. */
  drawn(stream) {
    this.delays_ms = [...this.delays_ms, stream.age_ms()].slice(-DELAYS);
  }

  /** Time of the picture of the recording that is in sight; NaN: there is none yet. */
  drawn_ms() {
    const stream = this.overlays.shown() ?? this.app.view.stream;
    return stream.pictures ? stream.shown_ms : NaN;
  }

  showPlayback(tag) {
    const { replay } = this.app;
    const apart_ms = this.plain ? Math.abs(this.plain.stream.shown_ms - this.app.view.stream.shown_ms) : 0;
    tag.hidden = false;
    tag.dataset.kind = this.lost ? "late" : "playback"; // the bar below names the moment
    setText(tag, replay.held ? `Go to ${replay.words(replay.at(), true)}` : this.lost ? "Reconnecting"
      : replay.recorded ? "Recorded, computing" : replay.awaits ? `Computing ${replay.words(replay.at(), true)}` : "Playback");
    this.frame.classList.toggle("stale", (replay.awaits && !replay.recorded) || this.lost !== null);
    if (this.plain) this.showRight(this.plain.stream.pictures > 0 && apart_ms <= APART_MS);
  }

  /** Delay of the picture on the screen: of the last ones when they were drawn; of one that is late, its age. */
  showDelay(age_ms, late) {
    const drawn = [...this.delays_ms].sort((a, b) => a - b)[this.delays_ms.length >> 1] ?? NaN;
    const ms = late ? age_ms : drawn;
    setText($("v-delay"), !finite(ms) ? "–" : late || ms >= 1000 ? ageText(ms) : `${number(Math.max(0, ms))} ms`);
    $("v-delay").dataset.kind = late ? "warn" : "";
  }

  showAge() {
    this.showMethod();
    const camera = this.overlays.shown(); // it hides the picture
    const lost = camera ? null : this.lost;
    const age_ms = (camera ?? this.app.view.stream).age_ms();
    const tag = $("age");
    if (this.app.replay.open) {
      setText($("v-delay"), "–");
      this.showPlayback(tag);
      return;
    }
    const old = ageText(age_ms);
    const still = !camera && age_ms > OLD_MS && !lost && this.app.still(); // only changes are rendered
    const late = age_ms > OLD_MS && !still;
    this.showDelay(age_ms, lost !== null || late);
    const settling = !lost && !late && this.app.settling();
    tag.hidden = !(lost || still || late || settling); // of a fresh picture the delay above says it all
    tag.dataset.kind = lost || late ? "late" : "";
    setText(tag, lost ? `${this.refused ? "Stopped" : "Reconnecting"} · picture ${old} old` : settling ? "Settling"
      : still ? `Nothing moved for ${old}` : late ? `Picture ${old} old` : "");
    this.frame.classList.toggle("stale", lost !== null && age_ms > OLD_MS);
  }

  /** Shows a message in place of the picture: {title, text, todo: [sentence...], picture: {url, text}}; null: none. */
  explain(what) {
    const box = $("explain");
    const now = what ? JSON.stringify(what) : "";
    $("stage-box").classList.toggle("empty", !this.app.view.stream.pictures);
    box.hidden = !what;
    if (box.dataset.now === now) return;
    box.dataset.now = now;
    if (!what) return;
    const shown = what.picture && el("div", { class: "explain-picture" }, el("span", { class: "visit-picture" }, picture(what.picture.url)), el("p", { class: "quiet" }, what.picture.text));
    box.replaceChildren(el("h2", {}, what.title), el("p", {}, what.text), shown ?? "",
      what.todo?.length ? el("ul", {}, ...what.todo.map((line) => el("li", {}, ...codes(line)))) : "");
  }
}

function ageText(ms) {
  const s = finite(ms) ? Math.max(0, ms / 1000) : 0;
  return s < 60 ? `${number(s, s < 10 ? 1 : 0)} s` : `${Math.floor(s / 60)} min`;
}

/** `word` becomes code. */
function codes(line) {
  return line.split("`").map((part, i) => (i % 2 ? el("code", {}, part) : part));
}
