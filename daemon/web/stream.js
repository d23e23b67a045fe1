// A moving picture on a canvas: H.264, or multipart JPEG where that fails. An <img> could show JPEG too, but would not reveal how old its
// picture is or that the service is gone, and would keep decoding in the background.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { ApiError, clock, open } from "/web/api.js";
import { Unusable, video, watch } from "/web/h264.js";

const SILENCE_MS = 9000; // a still picture is sent every 5 s; a connection that is silent for longer is reopened
const PART_MAX = 64 << 20;
const HEADER_MAX = 8192;
const RETRY_MS = [300, 700, 1500, 3000];
const SLOTS = 4;
const JPEG_QUALITY = 0.95;

/** Takes a lock, released by the returned function; null if another window holds it. */
function lock(name) {
  return new Promise((done) => {
    navigator.locks.request(name, { ifAvailable: true },
      (got) => (got ? new Promise((release) => { done(release); }) : done(null))).catch(() => done(() => {}));
  });
}

/** A browser opens six connections per host, shared by all its windows. Streams occupy theirs for long: some are left for requests. */
async function takeSlot() {
  if (!navigator.locks) return () => {}; // plain HTTP from another machine
  for (let i = 0; i < SLOTS; i++) {
    const release = await lock(`sst-picture-${i}`);
    if (release) return release;
  }
  throw new ApiError(429, `${SLOTS} moving pictures are open in other windows of this browser, and it takes no more. Close or cover `
    + "one of them, and this one starts by itself.");
}

/** Splits a multipart body of parts with a Content-Length. */
class Parts {
  constructor() {
    this.data = new Uint8Array(1 << 18);
    this.have = 0;
  }

  push(chunk) {
    if (this.have + chunk.length > this.data.length) {
      const bigger = new Uint8Array(Math.max(this.data.length * 2, this.have + chunk.length));
      bigger.set(this.data.subarray(0, this.have));
      this.data = bigger;
    }
    this.data.set(chunk, this.have);
    this.have += chunk.length;
  }

  /** {headers, body} of the next whole part, or null. */
  next() {
    const end = this.find();
    if (end < 0) {
      if (this.have > HEADER_MAX) throw new ApiError(0, "The stream of pictures is not multipart.");
      return null;
    }
    const text = new TextDecoder("latin1").decode(this.data.subarray(0, end));
    const headers = new Map(text.split("\r\n").filter((line) => line.includes(":"))
      .map((line) => [line.slice(0, line.indexOf(":")).toLowerCase(), line.slice(line.indexOf(":") + 1).trim()]));
    const length = Number(headers.get("content-length"));
    if (!Number.isInteger(length) || length <= 0 || length > PART_MAX)
      throw new ApiError(0, "A picture of the stream has no Content-Length.");
    const start = end + 4;
    if (this.have < start + length) return null;
    const body = this.data.slice(start, start + length);
    this.data.copyWithin(0, start + length, this.have);
    this.have -= start + length;
    return { headers, body };
  }

  find() {
    const limit = Math.min(this.have, HEADER_MAX) - 3;
    for (let i = 0; i < limit; i++)
      if (this.data[i] === 13 && this.data[i + 1] === 10 && this.data[i + 2] === 13 && this.data[i + 3] === 10) return i;
    return -1;
  }
}

export class Stream {
  /**
   * @param canvas   resized to the pictures
   * @param address  async () => path below /stream; called for each connection
   * @param notify   called with "picture", "lost" (reason: ApiError or null)
   */
  constructor(canvas, address, notify) {
    this.canvas = canvas;
    this.address = address;
    this.notify = notify;
    this.abort = null;
    this.shown_ms = NaN;  // time of the shown picture by the service's clock
    this.shown = null;    // Blob of JPEG; null: H.264
    this.blamed = null;   // failure of H.264 in this connection
    this.pictures = 0;
    this.waiting = null;  // the newest picture, not decoded yet
    this.decoding = false;
  }

  start() {
    if (this.abort) return;
    this.abort = new AbortController();
    this.run(this.abort);
  }

  stop() {
    this.abort?.abort();
    this.abort = null;
  }

  age_ms() {
    return clock.now() - this.shown_ms;
  }

  /** The picture that is shown, as JPEG; null: none. */
  picture() {
    if (this.shown || !this.pictures) return this.shown;
    return new Promise((done) => this.canvas.toBlob(done, "image/jpeg", JPEG_QUALITY));
  }

  async run(abort) {
    let failures = 0;
    while (!abort.signal.aborted) {
      const before = this.pictures;
      let why = null;
      try {
        await this.receive(abort);
      } catch (error) {
        why = error instanceof ApiError ? error : new ApiError(0, "The connection was lost.");
      }
      if (abort.signal.aborted) return;
      failures = this.pictures > before ? 0 : failures + 1;
      this.notify("lost", why);
      await new Promise((done) => setTimeout(done, RETRY_MS[Math.min(failures, RETRY_MS.length - 1)]));
    }
  }

  /** One connection. That H.264 failed is forgotten where JPEG does not come either: then it was another fault. */
  async receive(abort) {
    const connection = new AbortController();
    const end = () => connection.abort();
    const { pictures } = this;
    this.blamed = null;
    let silence = setTimeout(end, SILENCE_MS);
    const alive = () => {
      clearTimeout(silence);
      silence = setTimeout(end, SILENCE_MS);
    };
    abort.signal.addEventListener("abort", end, { once: true });
    try {
      const path = await this.address();
      if (!await this.receiveVideo(path, connection.signal, alive)) {
        alive();
        await this.receiveParts(path, abort, connection.signal, alive);
      }
    } catch (error) {
      if (this.pictures === pictures && this.blamed) video.forgive(this.blamed);
      throw error;
    } finally {
      clearTimeout(silence);
      abort.signal.removeEventListener("abort", end);
      end();
    }
  }

  /** @return false: H.264 does not work, for a reason that is kept */
  async receiveVideo(path, signal, alive) {
    if (await video.refusal()) return false;
    try {
      await watch(path.replace("/stream", "/video"), signal, { alive, show: (frame, taken_ms) => {
        if (!signal.aborted) this.show(frame, { width: frame.displayWidth, height: frame.displayHeight }, null, taken_ms);
      } });
      return true;
    } catch (error) {
      if (!(error instanceof Unusable)) throw error;
      this.blamed = video.fail(error.message);
      return signal.aborted;
    }
  }

  async receiveParts(path, abort, signal, alive) {
    let release = null;
    try {
      release = await takeSlot();
      const { reader } = await open(path, signal);
      const parts = new Parts();
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return;
        alive();
        parts.push(value);
        for (let part = parts.next(); part; part = parts.next()) this.take(part, abort);
      }
    } finally {
      release?.();
    }
  }

  take(part, abort) {
    const seconds = Number(part.headers.get("x-timestamp"));
    this.waiting = {
      blob: new Blob([part.body], { type: "image/jpeg" }),
      taken_ms: seconds > 0 ? seconds * 1000 : clock.now(),
      abort,
    };
    if (!this.decoding) this.decode();
  }

  /** Decodes one picture at a time; the newest that arrives meanwhile is kept. */
  async decode() {
    this.decoding = true;
    while (this.waiting) {
      const { blob, taken_ms, abort } = this.waiting;
      this.waiting = null;
      try {
        const bitmap = await createImageBitmap(blob);
        if (!abort.signal.aborted) {
          video.shows = "jpeg";
          this.show(bitmap, bitmap, blob, taken_ms);
        }
        bitmap.close();
      } catch {
        continue; // a damaged picture: the next one follows
      }
    }
    this.decoding = false;
  }

  show(image, { width, height }, blob, taken_ms) {
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.canvas.getContext("2d", { alpha: false }).drawImage(image, 0, 0);
    this.shown = blob;
    this.shown_ms = taken_ms;
    this.pictures++;
    this.notify("picture", null);
  }
}
