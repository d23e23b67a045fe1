// Videos for others: a visit, a selection of visits, or a span of a recording, made by the service and saved by the browser.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { $, bytes, complain, duration, el, icon, onUse, setText, toast, visible } from "/web/ui.js";
import { save } from "/web/recordings.js";

const POLL_MS = 500; // while one is made
const download = (file) => `/api/v1/download/${encodeURIComponent(file)}`;
const link = (file, text) => el("a", { class: "button small", href: download(file), download: file }, icon("down"), ` ${text}`);

/** Name of the saved file: the video, or the archive of several. */
const fileOf = ({ name, videos }) => (videos === 1 ? `${name}.mp4` : `${name}.zip`);

function progress({ state, progress: done, left_s: left }) {
  if (state === "waiting") return "Waits for another video";
  return `${Math.round(100 * done)} %${left === null ? "" : `, ${duration(Math.max(left, 1))} left`}`;
}

export class Videos {
  /** @param replay  plays recordings; @param visits  the cards */
  constructor(replay, visits) {
    this.replay = replay;
    this.visits = visits;
    this.mine = new Set(); // asked for by this page
    this.awaited = new Set(); // of these: saved when they are made
    this.begin = NaN; // of the span that is marked
    this.polling = false;
    onUse($("visit-video"), () => this.make({ visits: [$("visit").dataset.visit] }));
    onUse($("replay-video"), () => this.mark());
    $("visit").addEventListener("close", () => $("visit-videos").replaceChildren());
    $("tab-recordings").addEventListener("click", () => this.poll());
    if ($("selection")) this.addSelection();
    this.poll();
  }

  /** A case of the cards that are selected. */
  addSelection() {
    const button = el("button", { type: "button", class: "small", "data-control": "", title: "One archive with a video of each, for others" }, "Video");
    onUse(button, () => this.make({ visits: this.visits.selection().map(({ visit }) => visit) }));
    $("selection").querySelector("[data-action=export]").before(button);
  }

  async make(what) {
    try {
      const { name } = await post("/api/v1/videos", what);
      this.mine.add(name);
      this.awaited.add(name);
      if (!$("visit").open) toast("The video is being made: below Recordings.", "info");
      await this.poll();
    } catch (error) {
      if (error.status === 404 && $("visit").open && what.visits?.length === 1 && what.visits[0] === $("visit").dataset.visit) setText($("visit-facts"), error.message);
      else complain(error);
    }
  }

  /** The first click marks the beginning, the second one the end. */
  mark() {
    const { replay } = this;
    const at = replay.drawn();
    if (!Number.isFinite(at)) return;
    if (this.markedIn !== replay.id) this.begin = NaN; // in a replay that has ended
    this.markedIn = replay.id;
    if (Number.isFinite(this.begin) && Math.abs(at - this.begin) >= 100) {
      const [from, to] = [this.begin, at].sort((a, b) => a - b).map((ms) => new Date(ms).toISOString());
      this.make({ from, to, recording: replay.state.recording });
      this.begin = NaN;
    } else {
      this.begin = Number.isFinite(this.begin) ? NaN : at;
    }
    const marked = Number.isFinite(this.begin);
    setText($("replay-video-text"), marked ? "Video: to here" : "Video from here");
    $("replay-video").setAttribute("aria-pressed", String(marked));
  }

  // --- the list ---

  async poll() {
    this.again = true; // an answer that is awaited may not know
    if (this.polling) return;
    this.polling = true;
    try {
      while (this.again || this.busy) {
        this.again = false;
        await visible();
        await this.refresh().catch((error) => {
          if (error.status !== 0 || !this.awaited.size) throw error;
          this.again = true; // no answer: once more
        });
        if (this.again || this.busy) await new Promise((done) => setTimeout(done, POLL_MS));
      }
    } catch (error) {
      if (error.status !== 0 && this.mine.size) complain(error); // the status request reports a service that is gone
    } finally {
      this.polling = false;
    }
  }

  async refresh() {
    const { videos } = await get("/api/v1/videos");
    this.busy = videos.some(({ state }) => state === "waiting" || state === "running");
    $("h-videos").hidden = !videos.length;
    $("signing-key").hidden = !videos.length;
    this.list($("videos"), videos);
    this.list($("visit-videos"), $("visit").open ? videos.filter(({ name }) => this.mine.has(name)).slice(0, 1) : []);
    for (const video of videos) {
      if (!this.awaited.has(video.name) || (video.state !== "done" && video.state !== "failed")) continue;
      this.awaited.delete(video.name);
      if (video.state === "done") save(download(fileOf(video)), fileOf(video));
      else complain(new Error(video.error));
    }
  }

  list(box, videos) {
    videos.forEach((video, i) => {
      const there = [...box.children].find(({ dataset }) => dataset.name === video.name);
      const row = there ?? this.build(video);
      if (box.children[i] !== row) box.insertBefore(row, box.children[i] ?? null);
      if (!there && box.id === "visit-videos") row.scrollIntoView({ block: "nearest" });
      this.show(row, video);
    });
    while (box.children.length > videos.length) box.lastChild.remove();
  }

  build(video) {
    const remove = el("button", { type: "button", class: "small danger", "data-control": "" }, "");
    onUse(remove, () => this.remove(video.name));
    return el("div", { class: "card video", dataset: { name: video.name } }, el("strong", {}, video.title), el("p", { class: "quiet" }),
      el("progress", { max: "1", "aria-label": "Progress" }), el("div", { class: "take" }, remove));
  }

  show(row, video) {
    const made = video.state === "waiting" || video.state === "running";
    const [bar, take] = [row.querySelector("progress"), row.querySelector(".take")];
    bar.hidden = !made;
    bar.value = video.progress;
    setText(row.querySelector("p"), made ? progress(video) : video.state === "failed" ? video.error
      : `${video.videos === 1 ? "MP4" : `${video.videos} videos`}, ${bytes(video.bytes)}`);
    setText(take.querySelector("button"), made ? "Cancel" : "Delete");
    if (row.dataset.state === video.state) return;
    row.dataset.state = video.state;
    take.querySelectorAll("a").forEach((old) => old.remove());
    if (video.state === "done")
      take.prepend(...(video.videos === 1 ? [link(`${video.name}.mp4`, "Video"), link(`${video.name}.json`, "Manifest")] : []), link(`${video.name}.zip`, "All of it"));
  }

  async remove(name) {
    this.awaited.delete(name);
    try {
      await post(`/api/v1/videos/${encodeURIComponent(name)}`, { delete: true });
      await this.refresh();
    } catch (error) {
      complain(error);
    }
  }
}
