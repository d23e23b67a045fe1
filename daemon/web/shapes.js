// Shapes over the picture, with corners and limits of depth: drawn, moved and deleted by mouse, touch or keys. Zones and masks are such.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, el, finite, setText } from "/web/ui.js";

const MOST_CORNERS = 16;
const LEAST_SIDE = 0.02; // of a rectangle or line that is drawn
const ARROW = 0.06; // length, of the picture's height
const KEY_STEP = 0.01;
const KEY_MOVES = { ArrowLeft: [-KEY_STEP, 0], ArrowRight: [KEY_STEP, 0], ArrowUp: [0, -KEY_STEP], ArrowDown: [0, KEY_STEP] };
const TOP = 0.06; // of the picture: no room for a name above a shape

export const NAME = /^[a-z0-9_-]{1,31}$/;

/** "Front gate" becomes "front-gate". */
export const plain = (text) => text.trim().toLowerCase().replace(/[^a-z0-9_-]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 31);
const round = (v) => Math.round(Math.min(Math.max(v, 0), 1) * 10000) / 10000;

/**
 * Subclasses list visible shapes by shown(), give it colours by colour(), and have elements with ids that begin with `kind`: a form of one shape
 * (-one), its -name, buttons -done and -redraw, fields -near and -far; and for drawings -shapes in the picture, -marks over it.
 */
export class Shapes {
  /** @param app  {stage, focus} */
  constructor(app, kind) {
    this.app = app;
    this.kind = kind;
    this.all = [];
    this.edited = null;  // a copy of the shape that is changed; null: the list is shown
    this.index = -1;     // its place in the list; -1: a new one
    this.drawing = false; // corners are being set
    this.marks = [];     // names and corners over the picture
    this.part("redraw").addEventListener("click", () => this.redraw());
    this.part("done").addEventListener("click", () => this.finish());
    this.part("name").addEventListener("input", () => this.showName());
    for (const key of ["near", "far"]) {
      this.part(key).addEventListener("input", () => this.setDepth(key, this.fromSlider(key)));
      this.part(`${key}-exact`).addEventListener("change", () => this.setDepth(key, this.fromExact(key)));
    }
  }

  part(name) {
    return $(`${this.kind}-${name}`);
  }

  showName() {
    const written = this.part("name").value;
    this.edited.name = plain(written);
    setText(this.part("name-note"), this.edited.name && this.edited.name !== written ? `It is called ${this.edited.name}.` : "");
    this.draw();
  }

  complain(sentence) {
    this.part("error").hidden = !sentence;
    setText(this.part("error"), sentence);
  }

  /** Words for limits of depth; "": none. */
  depths({ near_px, far_px }) {
    const { focus } = this.app;
    const near = finite(near_px) ? focus.words(near_px) : "";
    const far = finite(far_px) ? focus.words(far_px) : "";
    return near && far ? `${near} to ${far}` : near ? `beyond ${near}` : far ? `up to ${far}` : "";
  }

  // --- depth ---

  fromSlider(key) {
    const { near_px } = this.app.focus;
    const at = Number(this.part(key).value);
    if (at === (key === "near" ? 0 : 1000)) return null;
    return near_px - at / 1000 * this.app.focus.span();
  }

  /** In metres where they are known. */
  fromExact(key) {
    const value = Number.parseFloat(this.part(`${key}-exact`).value);
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
      const slider = this.part(key);
      const exact = this.part(`${key}-exact`);
      const end = key === "near" ? 0 : 1000;
      slider.disabled = !focus.known();
      slider.value = finite(px) && focus.known() ? Math.round((focus.near_px - px) / focus.span() * 1000) : end;
      slider.setAttribute("aria-valuetext", finite(px) ? focus.words(px) : "no limit");
      exact.value = !finite(px) ? "" : (focus.metres_px > 0 && px > 0 ? focus.metres_px / px : px).toFixed(2).replace(/\.?0+$/, "");
      setText(this.part(`${key}-unit`), focus.metres_px > 0 ? "m" : "px");
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
    this.part("help").hidden = !on || this.edited.line;
    this.part("done").hidden = !on || this.edited.line;
    this.part("redraw").hidden = on;
    this.showDone();
    this.draw();
  }

  showDone() {
    this.part("done").disabled = !this.edited || this.edited.points.length < 3;
  }

  /** A tap, or Enter at the cross-hair. @return true: it was meant for a shape */
  tap(point) {
    if (!this.drawing) return this.edited !== null; // a click beside the shape changes nothing of the picture
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
    this.part("name").focus({ preventScroll: true });
  }

  moveCorner(i, [x, y]) {
    this.edited.points[i] = [round(x), round(y)];
    this.draw();
  }

  // --- over the picture ---

  draw() {
    const shown = this.shown();
    if (this.edited && this.open) shown.push({ shape: this.edited, i: this.index < 0 ? this.all.length : this.index, edited: true });
    const focused = this.marks.indexOf(document.activeElement);
    this.part("shapes").replaceChildren(...shown.flatMap((one) => this.lines(one)));
    const marks = shown.filter(({ shape }) => shape.points.length).map((one) => this.label(one));
    const corners = this.edited && this.open ? this.corners() : [];
    if (corners.length && !this.drawing) corners.push(this.mover());
    this.reuse([...corners, ...marks]);
    if (focused >= 0 && focused < corners.length) this.marks[focused].focus({ preventScroll: true });
  }

  /** Classes of a shape's outline. */
  outline({ mask }) {
    return mask ? "mask" : "";
  }

  caption({ name }) {
    return name || `new ${this.kind}`;
  }

  lines({ shape, i, edited }) {
    const ns = "http://www.w3.org/2000/svg";
    const points = shape.points.map((point) => point.join()).join(" ");
    const open = shape.line || edited && this.drawing && !this.rectangle;
    return ["halo", "line"].map((kind) => {
      const node = document.createElementNS(ns, shape.line ? "path" : open ? "polyline" : "polygon");
      if (shape.line) node.setAttribute("d", points && `M${points}${this.arrows(shape)}`);
      else node.setAttribute("points", points);
      node.setAttribute("class", `${kind} ${this.outline(shape)}${edited ? " edited" : ""}`);
      if (kind === "line") node.style.color = this.colour(shape, i);
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

  label({ shape, i }) {
    const top = shape.points.reduce((best, point) => (point[1] < best[1] ? point : best));
    const node = el("span", { class: top[1] < TOP ? "zone-name low" : "zone-name" }, this.caption(shape));
    node.style.borderColor = this.colour(shape, i);
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
    this.onDrag(node, () => (at) => this.moveCorner(i, at));
    node.addEventListener("click", () => { if (this.drawing && i === 0 && points.length >= 3) this.finish(); });
    node.addEventListener("keydown", (event) => {
      const by = KEY_MOVES[event.key];
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

  /** The handle in the middle moves the whole. */
  mover() {
    const { points } = this.edited;
    const mean = (k) => points.reduce((sum, point) => sum + point[k], 0) / points.length;
    const node = el("button", { type: "button", class: "corner mover", "aria-label": "The whole: arrow keys move it" });
    node.at = [mean(0), mean(1)];
    this.onDrag(node, () => {
      const from = node.at, before = points.map((point) => [...point]);
      return ([x, y]) => this.move(before, [x - from[0], y - from[1]]);
    });
    node.addEventListener("keydown", (event) => {
      if (!KEY_MOVES[event.key]) return;
      this.move(points, KEY_MOVES[event.key]);
      event.preventDefault();
      event.stopPropagation();
    });
    return node;
  }

  /** All corners, as far as the picture goes. */
  move(points, by) {
    const within = by.map((d, k) => Math.min(Math.max(d, -Math.min(...points.map((point) => point[k]))), 1 - Math.max(...points.map((point) => point[k]))));
    this.edited.points = points.map((point) => point.map((v, k) => round(v + within[k])));
    this.draw();
  }

  /** @param start  () => (point of the picture) => void: a pointer goes down on a handle, and moves */
  onDrag(node, start) {
    const { zoom } = this.app.stage;
    node.addEventListener("pointerdown", (event) => {
      if (this.drawing) return;
      event.preventDefault();
      node.focus({ preventScroll: true });
      const to = start();
      const move = (e) => to(zoom.toPicture(zoom.at(e.clientX, e.clientY)));
      const end = () => {
        removeEventListener("pointermove", move);
        removeEventListener("pointerup", end);
        removeEventListener("pointercancel", end);
      };
      addEventListener("pointermove", move);
      addEventListener("pointerup", end);
      addEventListener("pointercancel", end);
    });
  }

  /** Puts marks over the picture, and removes earlier ones. */
  reuse(nodes) {
    for (const node of this.marks) this.app.stage.unplace(node);
    this.marks = nodes;
    this.part("marks").replaceChildren(...nodes);
    for (const node of nodes) this.app.stage.place(node, node.at);
  }
}
