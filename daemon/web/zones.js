// Zones: parts of the picture that are watched or ignored. The list of all, and one that is drawn or changed.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { NAME, Shapes } from "/web/shapes.js";
import { $, complain, el, onUse, setText, storage, swatch, toast } from "/web/ui.js";

const SHOWN = "sst-zones-shown";
const MOST_LABELS = 8;
const MOVING = ["Pedestrian", "Bicyclist", "Car", "Motorcycle", "Horse", "Cat"];
const COLOURS = ["#5cd0ff", "#ffd166", "#8ef0a9", "#ff9ecb", "#c9b3ff", "#ffa36b"];
const MASK = "#c3ccd4";

export class Zones extends Shapes {
  /** @param app  {stage, focus, labels} */
  constructor(app) {
    super(app, "zone");
    this.revision = "";
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
    $("zone-mask").addEventListener("change", () => {
      this.edited.mask = $("zone-mask").checked;
      this.draw();
    });
    for (const radio of $("line-direction").querySelectorAll("input"))
      radio.addEventListener("change", () => {
        this.edited.direction = radio.value;
        this.draw();
      });
    if ($("zones-shown").checked) this.load().catch(() => {}); // the drawer reports it
  }

  get open() {
    return !$("zones-drawer").hidden;
  }

  async load() {
    const { zones, revision, file } = await get("/api/v1/zones");
    this.replace({ zones, revision });
    setText($("zones-file"), file ? `Kept in ${file}, in place of zones: of the other files.` : "web.zones_file is \"\": zones cannot be changed here.");
    this.draw();
    if (!this.edited) this.showList();
  }

  /** The service's zones; the one that is edited is found again among them. */
  replace({ zones, revision }) {
    const name = this.edited && this.all[this.index]?.name;
    this.all = zones;
    this.revision = revision;
    if (!this.edited) return;
    this.index = zones.findIndex((zone) => zone.name === name); // -1: it is new, or another client has deleted it
    $("zone-delete").hidden = this.index < 0;
  }

  toggle(open) {
    $("zones-drawer").hidden = !open;
    $("zones").setAttribute("aria-expanded", open);
    this.leave();
    if (open) {
      this.app.stage.draws = this;
      this.app.stage.closePick();
      this.load().catch(complain);
      $("stage-box").scrollIntoView({ block: "nearest" });
      $("zones-close").focus({ preventScroll: true });
    } else {
      $("zones").focus({ preventScroll: true });
    }
    this.draw();
  }

  shown() {
    const all = this.open || $("zones-shown").checked ? this.all : [];
    return all.map((shape, i) => ({ shape, i })).filter(({ i }) => !this.edited || i !== this.index);
  }

  setDrawing(on) {
    super.setDrawing(on);
    $("line-help").hidden = !on || !this.edited.line;
  }

  // --- the list ---

  colour(zone, i) {
    return zone.mask ? MASK : COLOURS[i % COLOURS.length];
  }

  /** "ignored · 3 to 8 m · Pedestrian, Car" */
  facts(zone) {
    const kind = zone.line ? ["line", zone.direction === "both" ? "" : zone.direction].filter(Boolean).join(", ") : zone.mask ? "ignored" : "watched";
    return [kind, this.depths(zone), zone.labels.join(", ")].filter(Boolean).join(" · ");
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
    const { edited } = this;
    $("zone-save").setAttribute("aria-busy", "true");
    try {
      const answer = await post("/api/v1/zones", { zones, revision: this.revision });
      const same = this.edited === edited; // else it was left meanwhile
      if (same) this.leave();
      this.replace(answer);
      if (same) this.cancel();
      else if (!this.edited) this.showList();
      this.draw();
      toast(done);
    } catch (error) {
      if (this.edited === edited) this.complain(error.message);
      else complain(error);
      if (error.status === 409) this.load().catch(complain);
    } finally {
      $("zone-save").removeAttribute("aria-busy");
    }
  }
}
