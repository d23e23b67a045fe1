// Plays a recording's video: Matroska with JPEG pictures, which browsers do not play themselves. Its index is read once,
// then a second at a time by Range requests; the same second again comes from memory.

import { ApiError } from "/web/api.js";
import { complain, el, icon, setText, stopwatch } from "/web/ui.js";

const HEAD_BYTES = 262144;
const KEPT = 12; // seconds of pictures in memory
const ID = { segment: 0x18538067, info: 0x1549a966, duration: 0x4489, tracks: 0x1654ae6b, codec: 0x86, track: 0xae,
  cues: 0x1c53bb6b, cue: 0xbb, cueTime: 0xb3, cuePlaces: 0xb7, cuePlace: 0xf1, cluster: 0x1f43b675, stamp: 0xe7, block: 0xa3 };
const INNER = new Set([ID.segment, ID.info, ID.tracks, ID.track, ID.cues, ID.cue, ID.cuePlaces, ID.cluster]);

/** Visits every element of a buffer, master elements before their children: visit(id, start, end, whole) */
function walk(view, visit, at = 0, end = view.byteLength) {
  while (at + 2 <= end) {
    const idBytes = Math.clz32(view.getUint8(at)) - 23;
    if (idBytes > 4 || at + idBytes >= end) return;
    let id = 0;
    for (let i = 0; i < idBytes; i++) id = id * 256 + view.getUint8(at + i);
    at += idBytes;
    const sizeBytes = Math.clz32(view.getUint8(at)) - 23;
    if (sizeBytes > 8 || at + sizeBytes > end) return;
    let size = view.getUint8(at) & (0xff >> sizeBytes);
    for (let i = 1; i < sizeBytes; i++) size = size * 256 + view.getUint8(at + i);
    at += sizeBytes;
    const whole = at + size <= end;
    const stop = visit(id, at, at + size, whole) === false;
    if (stop) return;
    if (INNER.has(id)) walk(view, visit, at, Math.min(at + size, end));
    at += size;
  }
}

function number(view, start, end) {
  let value = 0;
  for (let i = start; i < end; i++) value = value * 256 + view.getUint8(i);
  return value;
}

class Video {
  constructor(url) {
    this.url = url;
    this.tag = "";
    this.size = 0;
    this.duration_ms = 0;
    this.cues = []; // {ms, at} of the first picture of each second
    this.seconds = new Map(); // number of a cue -> promise of its frames [{ms, blob}]
  }

  async part(first, last) {
    const headers = { Range: `bytes=${first}-${last}` };
    if (this.tag) headers["If-Range"] = this.tag;
    const response = await fetch(this.url, { headers, cache: "no-store", signal: AbortSignal.timeout(this.tag ? 60000 : 600000) });
    if (response.status === 200) { // it is still growing, or was replaced
      response.body?.cancel();
      throw new ApiError(200, this.tag ? "The recording has changed meanwhile; open it again." : "It can be played when it has ended.");
    }
    if (response.status !== 206)
      throw new ApiError(response.status, (await response.json().catch(() => ({}))).error || `The service answered ${response.status}.`);
    this.tag = response.headers.get("ETag") ?? "";
    this.size = Number((response.headers.get("Content-Range") ?? "").split("/")[1]);
    return new DataView(await response.arrayBuffer());
  }

  async open() {
    let need = HEAD_BYTES;
    while (!(await this.readHead(need))) {
      need *= 4;
      if (need > 1 << 26) throw new ApiError(0, "This is no video that can be played here.");
    }
    if (!this.cues.length) throw new ApiError(0, "There is no picture in it.");
  }

  /** @returns false if the index continues after these bytes */
  async readHead(bytes) {
    const view = await this.part(0, bytes - 1);
    let segment = 0, ms = 0, whole = false, codec = "";
    this.cues = [];
    walk(view, (id, start, end, complete) => {
      if (id === ID.segment) segment = start;
      else if (id === ID.duration) this.duration_ms = view.getFloat64(start);
      else if (id === ID.codec) codec = new TextDecoder().decode(new Uint8Array(view.buffer, start, end - start));
      else if (id === ID.cues) whole = complete;
      else if (id === ID.cueTime) ms = number(view, start, end);
      else if (id === ID.cuePlace && !(ms - this.cues.at(-1)?.ms < 1000)) this.cues.push({ ms, at: segment + number(view, start, end) });
      return id !== ID.cluster;
    });
    if (codec && codec !== "V_MJPEG") throw new ApiError(0, "These are raw frames, which no browser shows: download them.");
    return whole || this.size <= bytes;
  }

  cueAt(ms) {
    let i = this.cues.length - 1;
    while (i > 0 && this.cues[i].ms > ms) i--;
    return i;
  }

  frames(i) {
    if (!this.seconds.has(i)) {
      this.seconds.set(i, this.load(i).catch((error) => {
        this.seconds.delete(i);
        throw error;
      }));
      if (this.seconds.size > KEPT) this.seconds.delete(this.seconds.keys().next().value);
    }
    return this.seconds.get(i);
  }

  async load(i) {
    const view = await this.part(this.cues[i].at, (this.cues[i + 1]?.at ?? this.size) - 1);
    const frames = [];
    let stamp = 0;
    walk(view, (id, start, end, whole) => {
      if (id === ID.stamp) stamp = number(view, start, end);
      if (id !== ID.block || !whole) return;
      const time = start + (view.getUint8(start) & 0x80 ? 1 : 2); // behind the track's number
      frames.push({ ms: stamp + view.getInt16(time), blob: new Blob([view.buffer.slice(time + 3, end)], { type: "image/jpeg" }) });
    });
    return frames;
  }
}

export class Player {
  /** @param onTime  (ms since the beginning) => void */
  constructor(onTime) {
    this.onTime = onTime;
    this.canvas = el("canvas", { role: "img", "aria-label": "Recorded picture" });
    this.button = el("button", { type: "button", class: "icon", "aria-label": "Pause" }, icon("pause"));
    this.slider = el("input", { type: "range", min: "0", step: "100", value: "0", "aria-label": "Position" });
    this.time = el("output", {});
    this.node = el("div", { class: "player" }, this.canvas, el("div", { class: "player-bar" }, this.button, this.slider, this.time));
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.stop();
  }

  /** Stops playing; frames still in flight are discarded. */
  stop() {
    this.run = {}; // of one video
    this.video = null;
    this.playing = false;
  }

  /** @param at_ms  start position */
  async open(url, at_ms = 0) {
    this.stop();
    const run = this.run, video = new Video(url);
    setText(this.time, "…");
    await video.open();
    if (run !== this.run) return;
    this.video = video;
    this.slider.max = String(Math.max(0, Math.floor(video.duration_ms)));
    this.at_ms = Math.min(at_ms, video.duration_ms);
    this.play(true);
    this.follow(run).catch((error) => {
      if (run !== this.run) return;
      this.play(false);
      complain(error);
    });
  }

  play(playing) {
    this.playing = playing;
    this.since = performance.now() - (this.at_ms ?? 0);
    this.button.setAttribute("aria-label", playing ? "Pause" : "Play");
    this.button.replaceChildren(icon(playing ? "pause" : "play"));
  }

  toggle() {
    if (!this.video) return;
    if (!this.playing && this.at_ms >= this.video.duration_ms) this.at_ms = 0;
    this.play(!this.playing);
  }

  seek(ms) {
    this.at_ms = ms;
    this.since = performance.now() - ms;
  }

  async follow(run) {
    let shown = null;
    while (run === this.run && this.node.isConnected) {
      if (this.playing) this.at_ms = performance.now() - this.since;
      if (this.playing && this.at_ms >= this.video.duration_ms) {
        this.at_ms = this.video.duration_ms;
        this.play(false);
      }
      const at = this.at_ms, i = this.video.cueAt(at), asked = performance.now();
      const frames = await this.video.frames(i);
      if (this.playing && performance.now() - asked > 50) this.since += performance.now() - asked; // buffering: the playing time stands still
      if (i + 1 < this.video.cues.length) this.video.frames(i + 1).catch(() => {}); // a failed prefetch is retried when it is due
      const frame = frames.findLast((one) => one.ms <= at) ?? frames[0];
      if (run !== this.run) return;
      if (frame && frame !== shown) await this.draw(frame.blob);
      shown = frame;
      this.showTime(at);
      await new Promise((done) => setTimeout(done, 25));
    }
  }

  async draw(blob) {
    const picture = await createImageBitmap(blob).catch(() => null); // a damaged frame: the previous one stays
    if (!picture) return;
    if (this.canvas.width !== picture.width || this.canvas.height !== picture.height)
      Object.assign(this.canvas, { width: picture.width, height: picture.height });
    this.canvas.getContext("2d").drawImage(picture, 0, 0);
    picture.close();
  }

  showTime(ms) {
    if (document.activeElement !== this.slider || this.playing) this.slider.value = String(Math.floor(ms));
    this.slider.setAttribute("aria-valuetext", stopwatch(ms / 1000));
    setText(this.time, `${stopwatch(ms / 1000)} / ${stopwatch(this.video.duration_ms / 1000)}`);
    this.onTime(ms);
  }
}
