// Privacy masks: outlines of the configured ones, and others that are drawn. The service cannot write its configuration, so that a token alone
// uncovers nothing: the page makes the lines of the file.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get } from "/web/api.js";
import { NAME, Shapes } from "/web/shapes.js";
import { $, complain, el, finite, onUse, session, setText, swatch, toast } from "/web/ui.js";

const MOST = 16;
const AGAIN_MS = 5000; // lines that were copied may be in force by now
const COLOUR = "#ff8f8f";
const DRAWN = "sst-masks"; // in the tab's storage: all masks, while the service has others
const COPIED = "sst-masks-copied"; // lines

const cameraOf = ({ row, col }) => (finite(row) ? `r${row}c${col}` : "");

/** As `sst` writes it. */
function line({ name, row, col, points, near_px: near, far_px: far }) {
  const place = finite(row) ? `row: ${row}, col: ${col}` : `near_px: ${near}${finite(far) ? `, far_px: ${far}` : ""}`;
  return `    - { name: ${name}, ${place}, points: "${points.map((point) => point.join()).join(" ")}" }`;
}

/** Of a file of the configuration. */
export const lines = (masks) => (masks.length ? `privacy:\n  masks:\n${masks.map(line).join("\n")}\n` : "privacy:\n  masks: []\n");

export class Masks extends Shapes {
  /** @param app  {stage, focus, replay} @param others  () => {}: closes other drawers */
  constructor(app, others) {
    super(app, "mask");
    this.others = others;
    this.force = []; // masks of the configuration
    this.asked = false;
    this.copied = session(COPIED) ?? ""; // lines
    this.stays = false; // the page is loaded again, by itself
    this.opener = null;
    $("masks-close").addEventListener("click", () => this.toggle(false));
    $("masks-drawer").addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      if (this.edited) this.cancel();
      else this.toggle(false);
    });
    $("masks").addEventListener("click", () => this.openFor("", $("zones")));
    $("mask-of").addEventListener("change", () => this.choose($("mask-of").value));
    onUse($("mask-new"), () => this.begin());
    onUse($("mask-keep"), () => this.keep());
    onUse($("mask-delete"), () => this.leave(this.all.filter((_, i) => i !== this.index)));
    $("mask-cancel").addEventListener("click", () => this.cancel());
    $("mask-reset").addEventListener("click", () => this.leave(structuredClone(this.force)));
    $("mask-copy").addEventListener("click", () => this.copy());
    addEventListener("beforeunload", (event) => { if (!this.stays && this.unsaved()) event.preventDefault(); });
    if (session(DRAWN)) this.load().catch(() => {}); // the list reports it
    setInterval(() => { if (this.open && this.changed()) this.load().catch(() => {}); }, AGAIN_MS);
  }

  get open() {
    return !$("masks-drawer").hidden;
  }

  changed() {
    return lines(this.all) !== lines(this.force);
  }

  inForce(mask) {
    return this.force.some((other) => line(other) === line(mask));
  }

  /** Masks drawn here stay until they are in force, also when the page is loaded again. */
  async load() {
    const { masks } = await get("/api/v1/masks");
    const kept = this.asked ? this.changed() && this.all : JSON.parse(session(DRAWN) || "null");
    this.asked = true;
    this.force = masks.map((mask) => ({ ...mask, far_px: mask.far_px || null, mask: true })); // 0: no end
    this.all = kept || structuredClone(this.force);
    this.store();
    this.draw();
    if (!this.edited) this.showList();
  }

  store() {
    session(DRAWN, this.changed() ? JSON.stringify(this.all) : "");
  }

  /** Do drawn masks go with this tab? */
  unsaved() {
    const before = this.all[this.index]?.points ?? [];
    return (this.edited && String(this.edited.points) !== String(before)) || (this.changed() && this.copied !== lines(this.all));
  }

  /** Drawn masks could be taken for ones in force. */
  remind() {
    const drawn = this.all.filter((mask) => !this.inForce(mask)).map(({ name }) => name);
    if (!this.changed() || this.copied === lines(this.all)) return;
    toast(`${drawn.length ? `Not in force: ${drawn.join(", ")}` : "Deleted masks are still in force"}. Copy the lines below Privacy masks into the configuration; this tab keeps them until then.`,
      "info", null, "mask-copy");
  }

  /** @param camera  "": a place, in all cameras; undefined: as the picture is @param opener  gets the focus afterwards */
  openFor(camera, opener) {
    if (this.app.replay.open) {
      toast("Masks are drawn on the live picture: close the recording first.");
      return;
    }
    this.opener = opener;
    this.others();
    if (camera) this.choose(camera);
    this.toggle(true);
  }

  /** @param back  the focus returns to where it was */
  toggle(open, back = true) {
    $("masks-drawer").hidden = !open;
    this.leave(this.all);
    if (open) {
      this.app.stage.draws = this;
      this.app.stage.closePick();
      this.load().catch(complain);
      this.offerCameras().catch(complain);
      $("stage-box").scrollIntoView({ block: "nearest" });
      $("masks-close").focus({ preventScroll: true });
    } else {
      this.remind();
    }
    if (!open && back) {
      (this.opener?.checkVisibility() ? this.opener : $("zones")).focus({ preventScroll: true });
    }
    this.draw();
  }

  // --- the picture that masks are of ---

  /** "": the reference view's, of places. */
  camera() {
    return this.app.stage?.overlays.camera ?? "";
  }

  async offerCameras() {
    const { cameras } = await get("/api/v1/cameras");
    const names = ["", ...cameras.map(({ name }) => name)];
    if ([...$("mask-of").options].map(({ value }) => value).join() !== names.join())
      $("mask-of").replaceChildren(...names.map((name) => el("option", { value: name }, name ? `Frames of camera ${name}` : "A place, in all cameras")));
    $("mask-of").value = this.camera();
  }

  choose(camera) {
    if (camera === this.camera()) return;
    if (camera) this.app.stage.overlays.showCamera(camera);
    else this.app.stage.overlays.showPicture();
  }

  /** Another picture is shown. */
  pictureChanged() {
    if (this.open) $("mask-of").value = this.camera();
    if (this.edited && cameraOf(this.edited) !== this.camera()) this.cancel();
    if (this.camera() && !this.asked) this.load().catch(() => {}); // without outlines
    else this.draw();
  }

  /** Beside the list all of it; else also masks that are in force though changed or deleted here. */
  shown() {
    const camera = this.camera();
    const all = this.app.replay.open ? [] : this.open ? this.all : camera ? [...this.force, ...this.all.filter((mask) => !this.inForce(mask))] : [];
    return all.map((shape, i) => ({ shape, i })).filter(({ shape, i }) => cameraOf(shape) === camera && (!this.edited || i !== this.index));
  }

  colour() {
    return COLOUR;
  }

  outline(mask) {
    return this.inForce(mask) ? "mask force" : "mask";
  }

  caption(mask) {
    return this.inForce(mask) ? mask.name : `${mask.name || "new mask"}, not in force`;
  }

  // --- the list ---

  facts(mask) {
    const camera = cameraOf(mask);
    return [camera ? `camera ${camera}` : ["all cameras", this.depths(mask)].filter(Boolean).join(", "), this.inForce(mask) ? "" : "not in force"].filter(Boolean).join(" · ");
  }

  showList() {
    const focused = [...$("mask-list").children].findIndex((row) => row.contains(document.activeElement));
    $("mask-list").replaceChildren(...this.all.map((mask, i) => el("li", {}, el("button", { type: "button", class: "zone",
      onclick: () => this.edit(i) }, swatch(COLOUR), el("strong", {}, mask.name), el("span", { class: "quiet" }, this.facts(mask))))));
    $("mask-list").children[focused]?.firstChild.focus({ preventScroll: true });
    setText($("masks-state"), this.all.length ? "" : "There is no mask.");
    const changed = this.changed();
    $("mask-changes").hidden = !changed;
    if (changed && $("mask-lines").value !== lines(this.all)) $("mask-lines").value = lines(this.all);
    $("mask-lines").rows = Math.min(this.all.length + 3, 10);
  }

  copy() {
    const field = $("mask-lines");
    field.select();
    this.copied = field.value;
    session(COPIED, this.copied);
    const copied = () => toast("Copied.", "info", null, "mask-copy");
    const by_hand = () => toast("Your browser copies nothing from here: press Ctrl and C.", "info", null, "mask-copy");
    if (navigator.clipboard) navigator.clipboard.writeText(field.value).then(copied).catch(by_hand); // of secure pages
    else by_hand();
  }

  // --- one mask ---

  begin() {
    const at = /^r(\d+)c(\d+)$/.exec(this.camera());
    if (this.all.length === MOST) {
      toast(`There are at most ${MOST} masks.`);
      return;
    }
    this.index = -1;
    this.start({ name: "", points: [], row: at && Number(at[1]), col: at && Number(at[2]), near_px: null, far_px: null, mask: true });
    this.redraw();
  }

  /** On the picture that it is of. */
  edit(i) {
    this.choose(cameraOf(this.all[i]));
    this.index = i;
    this.start(structuredClone(this.all[i]));
  }

  start(mask) {
    const camera = cameraOf(mask);
    this.edited = mask;
    $("masks-all").hidden = true;
    $("mask-one").hidden = false;
    setText($("mask-what"), camera ? `Black in the frames of camera ${camera}.` : "Black in every camera: what lies behind this outline, from a distance on.");
    $("mask-depth").hidden = camera !== "";
    $("mask-delete").hidden = this.index < 0;
    $("mask-name").value = mask.name;
    this.complain("");
    this.showName();
    this.showDepth();
    this.setDrawing(false);
    $("mask-name").focus({ preventScroll: true });
  }

  fault() {
    const { name, row, near_px: near, far_px: far, points } = this.edited;
    if (!NAME.test(name)) return "The mask needs a name.";
    if (this.all.some((mask, i) => mask.name === name && i !== this.index)) return `There is a mask ${name} already.`;
    if (points.length < 3 || this.drawing) return "Draw the mask on the picture first.";
    if (!finite(row) && !finite(near)) return "Say how near the place begins: at a neighbour's hedge, as far as that is.";
    if (!finite(row) && near <= (far ?? 0)) return "The place must begin nearer than it ends.";
    return "";
  }

  keep() {
    const fault = this.fault();
    this.complain(fault);
    if (fault) return;
    const all = [...this.all];
    all[this.index < 0 ? all.length : this.index] = this.edited;
    this.leave(all);
  }

  /** Back to the list, which may be another one. */
  leave(all) {
    const at = this.index;
    this.all = all;
    if (this.asked) this.store();
    this.edited = null;
    this.setDrawing(false);
    $("masks-all").hidden = false;
    $("mask-one").hidden = true;
    this.showList();
    if (this.open) ($("mask-list").children[at]?.firstChild ?? $("mask-new")).focus({ preventScroll: true });
  }

  cancel() {
    this.leave(this.all);
  }
}
