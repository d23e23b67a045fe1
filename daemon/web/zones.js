// Zones: parts of the picture that are watched or ignored. The list of all, and one that is drawn or changed.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { $, complain, el, finite, onUse, setText, storage, swatch, toast } from "/web/ui.js";

const SHOWN = "sst-zones-shown";
const MOST_CORNERS = 16;
const MOST_LABELS = 8;
const LEAST_SIDE = 0.02; // of a rectangle or line that is drawn
const ARROW = 0.06; // length, of the picture's height
const KEY_STEP = 0.01;
const MOVING = ["Pedestrian", "Bicyclist", "Car", "Motorcycle", "Horse", "Cat"];
const COLOURS = ["#5cd0ff", "#ffd166", "#8ef0a9", "#ff9ecb", "#c9b3ff", "#ffa36b"];
const MASK = "#c3ccd4";
const NAME = /^[a-z0-9_-]{1,31}$/;

/** "Front gate" becomes "front-gate". */
const plain = (text) => text.trim().toLowerCase().replace(/[^a-z0-9_-]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 31);
const round = (v) => Math.round(Math.min(Math.max(v, 0), 1) * 10000) / 10000;

export class Zones {
  /** @param app  {stage, focus, labels} */
  constructor(app) {
    this.app = app;
    this.all = [];
    this.revision = "";
    this.edited = null;  // a copy of the zone that is changed; null: the list is shown
    this.index = -1;     // its place in the list; -1: a new one
    this.drawing = false; // corners are being set
    this.marks = [];     // names and corners over the picture
    app.stage.draws = this;
    $("zones").addEventListener("click", () => this.toggle($("zones-drawer").hidden));
    $("zones-close").addEventListener("click", () => this.toggle(false));
    $("zones-drawer").addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      if (this.edited) this.cancel();
      else this.toggle(false);
    });
    $("zones-shown").checked = storage(SHOWN) === "1";
    $("zones-shown").addEventListener("change", () => {
      storage(SHOWN, $("zones-shown").checked ? "1" : "0");
      this.draw();
    });
    onUse($("zone-new"), () => this.begin(false));
    onUse($("line-new"), () => this.begin(true));
    onUse($("zone-save"), () => this.save());
    onUse($("zone-delete"), () => this.remove());
    $("zone-cancel").addEventListener("click", () => this.cancel());
    $("zone-redraw").addEventListener("click", () => this.redraw());
    $("zone-done").addEventListener("click", () => this.finish());
    $("zone-name").addEventListener("input", () => this.showName());
    $("zone-mask").addEventListener("change", () => {
      this.edited.mask = $("zone-mask").checked;
      this.draw();
    });
    for (const radio of $("line-direction").querySelectorAll("input"))
      radio.addEventListener("change", () => {
        this.edited.direction = radio.value;
        this.draw();
      });
    for (const key of ["near", "far"]) {
      $(`zone-${key}`).addEventListener("input", () => this.setDepth(key, this.fromSlider(key)));
      $(`zone-${key}-exact`).addEventListener("change", () => this.setDepth(key, this.fromExact(key)));
    }
    if ($("zones-shown").checked) this.load().catch(() => {}); // the drawer reports it
  }

  get open() {
    return !$("zones-drawer").hidden;
  }

  async load() {
    const { zones, revision, file } = await get("/api/v1/zones");
    this.all = zones;
    this.revision = revision;
    setText($("zones-file"), file ? `Kept in ${file}, in place of zones: of the other files.` : "web.zones_file is \"\": zones cannot be changed here.");
    this.draw();
    if (!this.edited) this.showList();
  }

  toggle(open) {
    $("zones-drawer").hidden = !open;
    $("zones").setAttribute("aria-expanded", open);
    this.leave();
    if (open) {
      this.app.stage.closePick();
      this.load().catch(complain);
      $("stage-box").scrollIntoView({ block: "nearest" });
      $("zones-close").focus({ preventScroll: true });
    } else {
      $("zones").focus({ preventScroll: true });
    }
    this.draw();
  }

  // --- the list ---

  colour(zone, i) {
    return zone.mask ? MASK : COLOURS[i % COLOURS.length];
  }

  /** "ignored · 3 to 8 m · Pedestrian, Car" */
  facts(zone) {
    const { focus } = this.app;
    const near = finite(zone.near_px) ? focus.words(zone.near_px) : "";
    const far = finite(zone.far_px) ? focus.words(zone.far_px) : "";
    const depth = near && far ? `${near} to ${far}` : near ? `beyond ${near}` : far ? `up to ${far}` : "";
    const kind = zone.line ? ["line", zone.direction === "both" ? "" : zone.direction].filter(Boolean).join(", ") : zone.mask ? "ignored" : "watched";
    return [kind, depth, zone.labels.join(", ")].filter(Boolean).join(" · ");
  }

  showList() {
    $("zone-list").replaceChildren(...this.all.map((zone, i) => el("li", {}, el("button", { type: "button", class: "zone",
      onclick: () => this.edit(i) }, swatch(this.colour(zone, i)), el("strong", {}, zone.name), el("span", { class: "quiet" }, this.facts(zone))))));
    setText($("zones-state"), this.all.length ? "" : "There is no zone yet. Without one, visits are noticed only while somebody watches.");
  }

  // --- one zone ---

  begin(line) {
    this.index = -1;
    this.start({ name: "", points: [], near_px: null, far_px: null, labels: [], mask: false, line, direction: "both" });
    this.redraw();
  }

  edit(i) {
    this.index = i;
    this.start(structuredClone(this.all[i]));
  }

  start(zone) {
    this.edited = zone;
    $("zones-all").hidden = true;
    $("zone-one").hidden = false;
    $("zone-name").value = zone.name;
    $("zone-mask").checked = zone.mask;
    $("zone-mask-box").hidden = zone.line;
    $("line-direction").hidden = !zone.line;
    for (const radio of $("line-direction").querySelectorAll("input")) radio.checked = radio.value === zone.direction;
    $("zone-delete").hidden = this.index < 0;
    $("zone-labels").replaceChildren(...this.labels().map((name) => this.labelChip(name)));
    this.complain("");
    this.showName();
    this.showDepth();
    this.setDrawing(false);
    $("zone-name").focus({ preventScroll: true });
  }

  /** Labels of the network, moving objects first, and labels that the zone has already. */
  labels() {
    const all = this.app.labels.all.map((entry) => entry.name);
    return [...new Set([...MOVING.filter((name) => all.includes(name)), ...all, ...this.edited.labels])];
  }

  labelChip(name) {
    const chip = el("button", { type: "button", class: "chip", "aria-pressed": String(this.edited.labels.includes(name)), onclick: () => {
      const { labels } = this.edited;
      if (labels.includes(name)) labels.splice(labels.indexOf(name), 1);
      else if (labels.length < MOST_LABELS) labels.push(name);
      else toast(`A zone names at most ${MOST_LABELS} labels.`);
      chip.setAttribute("aria-pressed", String(labels.includes(name)));
    } }, swatch(this.app.labels.colourOf(name)), el("span", {}, name));
    return chip;
  }

  showName() {
    const name = plain($("zone-name").value);
    this.edited.name = name;
    setText($("zone-name-note"), name && name !== $("zone-name").value ? `It is called ${name}.` : "");
    this.draw();
  }

  leave() {
    this.edited = null;
    this.setDrawing(false);
    $("zones-all").hidden = false;
    $("zone-one").hidden = true;
  }

  cancel() {
    const at = this.index;
    this.leave();
    this.showList();
    ($("zone-list").children[at]?.firstChild ?? $("zone-new")).focus({ preventScroll: true });
  }

  complain(sentence) {
    $("zone-error").hidden = !sentence;
    setText($("zone-error"), sentence);
  }

  // --- depth ---

  fromSlider(key) {
    const { near_px } = this.app.focus;
    const at = Number($(`zone-${key}`).value);
    if (at === (key === "near" ? 0 : 1000)) return null;
    return near_px - at / 1000 * this.app.focus.span();
  }

  /** In metres where they are known. */
  fromExact(key) {
    const value = Number.parseFloat($(`zone-${key}-exact`).value);
    const { metres_px } = this.app.focus;
    if (!finite(value) || metres_px > 0 && value <= 0) return null;
    return metres_px > 0 ? metres_px / value : value;
  }

  setDepth(key, px) {
    this.edited[`${key}_px`] = px === null ? null : Math.round(px * 1000) / 1000;
    this.showDepth();
  }

  showDepth() {
    const { focus } = this.app;
    for (const key of ["near", "far"]) {
      const px = this.edited[`${key}_px`];
      const slider = $(`zone-${key}`);
      const exact = $(`zone-${key}-exact`);
      const end = key === "near" ? 0 : 1000;
      slider.disabled = !focus.known();
      slider.value = finite(px) && focus.known() ? Math.round((focus.near_px - px) / focus.span() * 1000) : end;
      slider.setAttribute("aria-valuetext", finite(px) ? focus.words(px) : "no limit");
      exact.value = !finite(px) ? "" : (focus.metres_px > 0 && px > 0 ? focus.metres_px / px : px).toFixed(2).replace(/\.?0+$/, "");
      setText($(`zone-${key}-unit`), focus.metres_px > 0 ? "m" : "px");
    }
  }

  // --- corners: as the stage reports them, in fractions of the picture ---

  redraw() {
    this.edited.points = [];
    this.setDrawing(true);
    this.app.stage.frame.focus({ preventScroll: true });
  }

  setDrawing(on) {
    this.drawing = on;
    this.app.stage.frame.classList.toggle("drawing", on);
    $("zone-help").hidden = !on || this.edited.line;
    $("line-help").hidden = !on || !this.edited.line;
    $("zone-done").hidden = !on || this.edited.line;
    $("zone-redraw").hidden = on;
    this.showDone();
    this.draw();
  }

  showDone() {
    $("zone-done").disabled = !this.edited || this.edited.points.length < 3;
  }

  /** A tap, or Enter at the cross-hair. @return true: it was meant for a zone */
  tap(point) {
    if (!this.drawing) return this.edited !== null; // a click beside the zone changes nothing of the picture
    const { points } = this.edited;
    const first = points[0];
    if (points.length >= 3 && Math.hypot(first[0] - point[0], first[1] - point[1]) < LEAST_SIDE) {
      this.finish();
      return true;
    }
    if (this.edited.line && first && Math.hypot(first[0] - point[0], first[1] - point[1]) < LEAST_SIDE) return true;
    points.push(point.map(round));
    this.showDone();
    if (points.length === (this.edited.line ? 2 : MOST_CORNERS)) this.finish();
    else this.draw();
    return true;
  }

  wantsDrag() {
    return this.drawing && (this.edited.points.length === 0 || this.rectangle);
  }

  /** A rectangle, or a line, from where a pointer went down to where it is. */
  drag(from, to) {
    if (this.edited.line) {
      this.rectangle = true;
      this.edited.points = [from, to].map((point) => point.map(round));
      this.draw();
      return;
    }
    const [x0, x1] = [from[0], to[0]].map(round).sort((a, b) => a - b);
    const [y0, y1] = [from[1], to[1]].map(round).sort((a, b) => a - b);
    this.rectangle = true;
    this.edited.points = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    this.draw();
  }

  /** @return true: a rectangle or a line was drawn */
  dragEnd() {
    if (!this.rectangle) return false;
    this.rectangle = false;
    const { line, points } = this.edited;
    const [[x0, y0], [x1, y1]] = [points[0], points[line ? 1 : 2]];
    const small = line ? Math.hypot(x1 - x0, y1 - y0) < LEAST_SIDE : x1 - x0 < LEAST_SIDE || y1 - y0 < LEAST_SIDE;
    if (small) this.edited.points = [];
    else this.finish();
    this.draw();
    return true;
  }

  finish() {
    this.setDrawing(false);
    $("zone-name").focus({ preventScroll: true });
  }

  moveCorner(i, [x, y]) {
    this.edited.points[i] = [round(x), round(y)];
    this.draw();
  }

  // --- over the picture ---

  draw() {
    const show = this.open || $("zones-shown").checked;
    const zones = show ? this.all.map((zone, i) => (this.edited && i === this.index ? null : { zone, i })).filter(Boolean) : [];
    if (this.edited && this.open) zones.push({ zone: this.edited, i: this.index < 0 ? this.all.length : this.index, edited: true });
    const focused = this.marks.indexOf(document.activeElement);
    $("zone-shapes").replaceChildren(...zones.flatMap((shown) => this.shape(shown)));
    const marks = zones.filter(({ zone }) => zone.points.length).map((shown) => this.label(shown));
    const corners = this.edited && this.open ? this.corners() : [];
    this.reuse([...corners, ...marks]);
    if (focused >= 0 && focused < corners.length) this.marks[focused].focus({ preventScroll: true });
  }

  shape({ zone, i, edited }) {
    const ns = "http://www.w3.org/2000/svg";
    const points = zone.points.map((point) => point.join()).join(" ");
    const open = zone.line || edited && this.drawing && !this.rectangle;
    return ["halo", "line"].map((kind) => {
      const node = document.createElementNS(ns, zone.line ? "path" : open ? "polyline" : "polygon");
      if (zone.line) node.setAttribute("d", points && `M${points}${this.arrows(zone)}`);
      else node.setAttribute("points", points);
      node.setAttribute("class", `${kind}${zone.mask ? " mask" : ""}${edited ? " edited" : ""}`);
      if (kind === "line") node.style.color = this.colour(zone, i);
      return node;
    });
  }

  /** From the middle of a line to its right-hand side, which is forward, or to the left, or both. */
  arrows({ points: [a, b], direction }) {
    const { width, height } = this.app.stage.frame.getBoundingClientRect();
    if (!b || !height) return "";
    const [dx, dy] = [(b[0] - a[0]) * width, (b[1] - a[1]) * height];
    const length = Math.max(Math.hypot(dx, dy), 1e-6);
    const at = (along, right) => { // px from the middle
      const [x, y] = [(along * dx - right * dy) / length, (along * dy + right * dx) / length];
      return `${((a[0] + b[0]) / 2 + x / width).toFixed(4)},${((a[1] + b[1]) / 2 + y / height).toFixed(4)}`;
    };
    const size = ARROW * height;
    const one = (way) => `M${at(0, 0)} ${at(0, way * size)}M${at(-size / 3, way * size * 0.6)} ${at(0, way * size)} ${at(size / 3, way * size * 0.6)}`;
    return (direction === "backward" ? "" : one(1)) + (direction === "forward" ? "" : one(-1));
  }

  label({ zone, i }) {
    const top = zone.points.reduce((best, point) => (point[1] < best[1] ? point : best));
    const node = el("span", { class: "zone-name" }, zone.name || "new zone");
    node.style.borderColor = this.colour(zone, i);
    node.at = top;
    return node;
  }

  corners() {
    const { points } = this.edited;
    const nodes = points.map((point, i) => this.corner(point, i));
    if (this.drawing || this.edited.line || points.length >= MOST_CORNERS) return nodes;
    return [...nodes, ...points.map((point, i) => {
      const next = points[(i + 1) % points.length];
      const middle = [(point[0] + next[0]) / 2, (point[1] + next[1]) / 2];
      const node = el("button", { type: "button", class: "corner more", "aria-label": `Add a corner after corner ${i + 1}`, onclick: () => {
        points.splice(i + 1, 0, middle.map(round));
        this.draw();
        this.marks[i + 1].focus({ preventScroll: true });
      } });
      node.at = middle;
      return node;
    })];
  }

  corner(point, i) {
    const { points } = this.edited;
    const node = el("button", { type: "button", class: "corner",
      "aria-label": this.edited.line ? `End ${i + 1} of the line: arrow keys move it`
        : `Corner ${i + 1} of ${points.length}: arrow keys move it, Delete removes it` });
    node.at = point;
    const { stage } = this.app;
    node.addEventListener("pointerdown", (event) => {
      if (this.drawing) return;
      event.preventDefault();
      node.focus({ preventScroll: true });
      const move = (e) => this.moveCorner(i, stage.zoom.toPicture(stage.zoom.at(e.clientX, e.clientY)));
      const end = () => {
        removeEventListener("pointermove", move);
        removeEventListener("pointerup", end);
        removeEventListener("pointercancel", end);
      };
      addEventListener("pointermove", move);
      addEventListener("pointerup", end);
      addEventListener("pointercancel", end);
    });
    node.addEventListener("click", () => { if (this.drawing && i === 0 && points.length >= 3) this.finish(); });
    node.addEventListener("keydown", (event) => {
      const moves = { ArrowLeft: [-KEY_STEP, 0], ArrowRight: [KEY_STEP, 0], ArrowUp: [0, -KEY_STEP], ArrowDown: [0, KEY_STEP] };
      const by = moves[event.key];
      if (by) this.moveCorner(i, [points[i][0] + by[0], points[i][1] + by[1]]);
      else if ((event.key === "Delete" || event.key === "Backspace") && points.length > 3) {
        points.splice(i, 1);
        this.draw();
        this.marks[Math.min(i, points.length - 1)].focus({ preventScroll: true });
      } else return;
      event.preventDefault();
      event.stopPropagation();
    });
    return node;
  }

  /** Puts marks over the picture, and removes earlier ones. */
  reuse(nodes) {
    for (const node of this.marks) this.app.stage.unplace(node);
    this.marks = nodes;
    $("zone-marks").replaceChildren(...nodes);
    for (const node of nodes) this.app.stage.place(node, node.at);
  }

  // --- the service ---

  fault() {
    const { name, points, line } = this.edited;
    if (!NAME.test(name)) return `The ${line ? "line" : "zone"} needs a name.`;
    if (this.all.some((zone, i) => zone.name === name && i !== this.index)) return `There is a zone ${name} already.`;
    if (points.length < (line ? 2 : 3) || this.drawing) return `Draw the ${line ? "line" : "zone"} on the picture first.`;
    return "";
  }

  save() {
    const fault = this.fault();
    this.complain(fault);
    if (fault) return null;
    const all = [...this.all];
    all[this.index < 0 ? all.length : this.index] = this.edited;
    return this.send(all, `${this.edited.line ? "Line" : "Zone"} ${this.edited.name} is saved.`);
  }

  remove() {
    return this.send(this.all.filter((_, i) => i !== this.index), `${this.all[this.index].line ? "Line" : "Zone"} ${this.all[this.index].name} is deleted.`);
  }

  async send(zones, done) {
    $("zone-save").setAttribute("aria-busy", "true");
    try {
      const answer = await post("/api/v1/zones", { zones, revision: this.revision });
      this.all = answer.zones;
      this.revision = answer.revision;
      this.cancel();
      this.draw();
      toast(done);
    } catch (error) {
      this.complain(error.message);
      if (error.status === 409) this.load().catch(complain);
    } finally {
      $("zone-save").removeAttribute("aria-busy");
    }
  }
}
