// Snapshots, recording, stored files, and exports of single moments as light fields.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { clock, get, post } from "/web/api.js";
import { sureToDelete } from "/web/confirm.js";
import { picture } from "/web/portrait.js";
import { $, bytes, complain, duration, el, icon, localTime, number, onUse, setText, stopwatch, toast } from "/web/ui.js";

/** Saves a file as a click on a link to it does. */
export function save(href, name) {
  const link = el("a", { href, download: name });
  document.body.append(link);
  link.click();
  link.remove();
}

/** "12 days of full recordings, 63 days of reduced ones": for which there is room at the present rate. */
export function fits({ full, reduced } = {}) {
  const length = (days) => (days < 1 / 12 ? `${number(1440 * days)} minutes` : days < 2 ? `${number(24 * days)} hours` : `${number(days)} days`);
  const words = (kind, what) => (Number.isFinite(kind?.fits_days) ? [`${length(kind.fits_days)} of ${what}`] : []);
  return [...words(full, reduced?.recordings ? "full recordings" : "recordings"), ...words(reduced, full?.recordings ? "reduced ones" : "reduced recordings")].join(", ");
}

const LATE_S = 2; // of a video's beginning after its recording's

const download = (name) => `/api/v1/download/${encodeURIComponent(name)}`;

export class Recordings {
  /** @param picture  () => Blob of the picture shown, or null, or a promise of it; @param replay  plays recordings; @param onPlay  one is about to be played */
  constructor(picture, replay, onPlay) {
    this.onPlay = onPlay;
    this.picture = picture;
    this.replay = replay;
    this.recording = null; // of the status
    this.rows = new Map();
    this.cameras = []; // names, for videos
    this.asked = 0; // number of list requests

    onUse($("snapshot"), () => this.snapshot());
    onUse($("record"), () => this.record());
    setInterval(() => this.showElapsed(), 500);
  }

  async snapshot() {
    const blob = await this.picture();
    const { state } = this.replay;
    $("snapshot").setAttribute("aria-busy", "true");
    try {
      const { name } = state ? await post("/api/v1/export", { time: this.replay.moment(this.replay.drawn()) ?? state.time, recording: state.recording })
        : await post("/api/v1/snapshot", {});
      if (blob) {
        const url = URL.createObjectURL(blob);
        save(url, `sst-${name}.jpg`);
        setTimeout(() => URL.revokeObjectURL(url), 30000);
      }
      toast(`Picture saved. The light field of this moment is kept as ${name}.`, "info",
        { text: "Light field", href: download(`${name}.tar`), download: `${name}.tar` });
      if (!$("panel-recordings").hidden) this.refresh().catch(complain);
    } catch (error) {
      complain(error);
    } finally {
      $("snapshot").removeAttribute("aria-busy");
    }
  }

  async record() {
    const stop = this.onDemand();
    try {
      await post("/api/v1/record", { action: stop ? "stop" : "start" });
      this.update(await get("/api/v1/status"));
      if (!stop && this.recording?.active && !this.onDemand()) toast(`It is being recorded already: ${this.recording.why}.`);
      this.refresh().catch(complain);
    } catch (error) {
      complain(error);
    }
  }

  /** Only a manual recording can be stopped; the others follow their rules. */
  onDemand() {
    return this.recording?.active === true && this.recording.why === "on demand";
  }

  update(status) {
    this.recording = status.storage?.recording ?? null;
    const active = this.recording?.active === true;
    $("rec-badge").hidden = !active || this.recording.reduced; // which goes on all the time
    $("rec-badge").title = active ? `${this.recording.name}: ${this.recording.why}` : "";
    $("record").setAttribute("aria-pressed", String(this.onDemand()));
    this.showElapsed();
    const room = fits(status.storage);
    setText($("recordings-fit"), room && `At the present rate there is room for ${room}.`);
  }

  showElapsed() {
    const since = Date.parse(this.recording?.since ?? "");
    const active = this.recording?.active === true;
    const time = active && Number.isFinite(since) ? stopwatch((clock.now() - since) / 1000) : "";
    setText($("rec-badge-text"), `REC ${time}`.trim());
    setText($("record-text"), this.onDemand() ? `Stop ${time}`.trim() : "Record");
  }

  async refresh() {
    const turn = ++this.asked;
    const kept = await get("/api/v1/recordings");
    if (!this.cameras.length) this.cameras = (await get("/api/v1/cameras")).cameras.map((camera) => camera.name);
    if (turn !== this.asked) return; // a newer request is in flight: an old answer would restore deleted rows
    const byHand = [...(kept.snapshots ?? []), ...(kept.exports ?? [])].sort((a, b) => (a.time < b.time ? 1 : -1));
    const all = new Set([...kept.recordings, ...byHand].map((entry) => entry.name));
    for (const [name, row] of this.rows)
      if (!all.has(name)) {
        row.node.remove();
        this.rows.delete(name);
      }
    this.list($("recordings"), kept.recordings.reverse(), (entry) => this.build(entry), (row, entry) => this.show(row, entry));
    this.list($("moments"), byHand, (entry) => this.buildMoment(entry), (row, entry) => this.showMoment(row, entry));
    setText($("recordings-state"), kept.recordings.length ? "" : "Nothing has been recorded yet. Record keeps what the cameras see, with the moments before.");
    $("h-moments").hidden = !byHand.length;
  }

  /** Shows one, opened. */
  async open(name) {
    await this.refresh();
    const row = this.rows.get(name);
    if (!row) {
      toast("This recording is gone: deleted, or removed to make room.");
      return;
    }
    row.node.open = true;
    row.node.scrollIntoView({ block: "center" });
    row.node.querySelector("summary").focus();
  }

  /** Newest first; existing rows keep their open state and focus. */
  list(box, entries, build, show) {
    entries.forEach((entry, i) => {
      if (!this.rows.has(entry.name)) this.rows.set(entry.name, build(entry));
      const row = this.rows.get(entry.name);
      row.entry = entry;
      if (box.children[i] !== row.node) box.insertBefore(row.node, box.children[i] ?? null);
      show(row, entry);
    });
  }

  // --- recordings ---

  build(entry) {
    const row = { when: el("strong", {}), what: el("p", { class: "quiet" }), made: el("p", { class: "made" }), picture: el("span", { class: "visit-picture" }),
      badge: el("span", { class: "badge", "data-kind": "bad" }, "recording"), entry };
    const id = `moment-${entry.name}`;
    row.moment = el("input", { type: "datetime-local", step: "1", id });
    const button = el("button", { type: "button", class: "small", "data-control": "" }, "Export this moment");
    row.source = el("select", { class: "small", "aria-label": "What to download as a video" });
    row.play = el("button", { type: "button", class: "small" }, icon("play"), " Play");
    row.video = el("a", { class: "button small" }, icon("down"), " Video");
    row.all = el("a", { class: "button small" }, icon("down"));
    row.allText = el("span", {});
    row.all.append(row.allText);
    row.remove = this.removeButton(row);
    onUse(button, () => this.exportMoment(entry.name, row.moment, button, row.made));
    row.play.addEventListener("click", () => this.play(row));
    row.source.addEventListener("change", () => this.showLinks(row));
    row.node = el("details", { class: "card recording" }, el("summary", {}, row.picture, el("div", {}, row.when, row.badge, row.what)),
      el("div", { class: "take" }, row.play, row.source, row.video, row.all, row.remove),
      el("div", { class: "export" }, el("label", { for: id }, "Moment"), row.moment, button), row.made);
    return row;
  }

  show(row, entry) {
    const from = Date.parse(entry.from), to = Date.parse(entry.to);
    setText(row.when, localTime(entry.from));
    setText(row.what, [duration((to - from) / 1000), bytes(entry.bytes), entry.why].filter(Boolean).join(" · "));
    row.badge.hidden = !entry.active;
    const shown = entry.view && entry.view_from ? entry.view_from : ""; // else nobody watched, and there is no picture
    if (row.picture.dataset.shown !== shown) {
      row.picture.dataset.shown = shown;
      row.picture.replaceChildren(...(shown ? [picture(download(`${entry.name}.jpg`))] : []));
    }
    row.moment.min = localInput(from);
    row.moment.max = localInput(to);
    if (!row.moment.value) row.moment.value = localInput(from);
    const late_s = entry.view_from ? (Date.parse(entry.view_from) - from) / 1000 : 0;
    const view = late_s > LATE_S ? `Main view, without the first ${duration(late_s)}` : "Main view";
    row.source.title = late_s > LATE_S ? "Nobody watched before the recording began" : "";
    const sources = [...(entry.view ? [["", view]] : []), ...this.cameras.map((name) => [`.${name}`, `Camera ${name}`])];
    const now = JSON.stringify(sources);
    if (row.source.dataset.now !== now && document.activeElement !== row.source) {
      row.source.dataset.now = now;
      row.source.replaceChildren(...sources.map(([value, text]) => el("option", { value }, text)));
    }
    row.remove.hidden = row.all.hidden = entry.active; // not while it is being written
    setText(row.allText, ` All of it (${bytes(entry.bytes)})`);
    this.showLinks(row);
  }

  showLinks(row) {
    link(row.video, `${row.entry.name}${row.source.value}.mkv`);
    link(row.all, `${row.entry.name}.tar`);
  }

  async play(row) {
    row.play.setAttribute("aria-busy", "true");
    this.onPlay();
    try {
      await this.replay.start({ recording: row.entry.name });
    } catch (error) {
      complain(error);
    } finally {
      row.play.removeAttribute("aria-busy");
    }
  }

  async exportMoment(recording, moment, button, made) {
    const at = new Date(moment.value);
    if (!moment.value || Number.isNaN(at.getTime()) || moment.validity.rangeUnderflow || moment.validity.rangeOverflow) {
      toast(`Choose a moment from ${moment.min.replace("T", " ")} to ${moment.max.replace("T", " ")}.`, "error");
      moment.focus();
      return;
    }
    button.setAttribute("aria-busy", "true");
    try {
      const { name } = await post("/api/v1/export", { time: at.toISOString(), recording });
      const file = `${name}.tar`;
      made.append(el("a", { class: "button small", href: download(file), download: file }, icon("down"), ` ${file}`));
      toast(`The light field of ${localTime(at.toISOString())} is ready.`, "info", { text: "Download", href: download(file), download: file });
      this.refresh().catch(complain);
    } catch (error) {
      complain(error);
    } finally {
      button.removeAttribute("aria-busy");
    }
  }

  // --- snapshots, exports ---

  buildMoment(entry) {
    const row = { when: el("strong", {}), what: el("p", { class: "quiet" }), entry };
    const picture = entry.picture ? download(`${entry.name}.jpg`) : "";
    row.links = el("div", { class: "take" });
    if (picture) row.links.append(link(el("a", { class: "button small" }, icon("down"), " Picture"), `${entry.name}.jpg`));
    row.links.append(link(el("a", { class: "button small" }, icon("down"), " Light field"), `${entry.name}.tar`));
    row.remove = this.removeButton(row);
    row.links.append(row.remove);
    row.node = el("article", { class: "card moment" },
      picture ? el("a", { href: picture, target: "_blank", class: "thumb" },
        el("img", { src: picture, alt: `Picture of ${localTime(entry.time)}`, loading: "lazy" })) : null,
      el("div", {}, row.when, row.what, row.links));
    return row;
  }

  showMoment(row, entry) {
    setText(row.when, localTime(entry.time));
    setText(row.what, `${kindOf(entry)} · ${entry.active ? "being made" : bytes(entry.bytes)}`);
    row.remove.hidden = entry.active;
  }

  // --- deleting ---

  removeButton(row) {
    const button = el("button", { type: "button", class: "small danger", "data-control": "" }, "Delete");
    onUse(button, () => this.askToDelete(row.entry));
    return button;
  }

  async askToDelete(entry) {
    const which = `${kindOf(entry)} of ${localTime(entry.from ?? entry.time)}`;
    if (!await sureToDelete(`${which} (${bytes(entry.bytes)}): it is removed from the disk of the service. It cannot be brought back.`)) return;
    try {
      await post("/api/v1/delete", { name: entry.name });
      toast(`${which} deleted.`);
      await this.refresh();
    } catch (error) {
      complain(error);
    }
  }
}

const kindOf = (entry) => (entry.from ? "Recording" : entry.name.startsWith("export-") ? "Export" : "Snapshot");

function link(anchor, file) {
  anchor.href = download(file);
  anchor.download = file;
  return anchor;
}

/** Value of <input type=datetime-local>, which is in local time. */
function localInput(ms) {
  if (!Number.isFinite(ms)) return "";
  return new Date(ms - new Date(ms).getTimezoneOffset() * 60000).toISOString().slice(0, 19);
}
