// H.264 over a WebSocket, decoded by the browser (WebCodecs). Where either does not work, JPEG is the last rung, and the reason is kept.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { ApiError } from "/web/api.js";

const CODEC = "avc1.42c01f"; // for the question alone; the service names its own
const HEAD = 20; // bytes before a picture: time in us, number of the set, flags
const QUEUE_MAX = 2; // pictures that wait for the decoder; then it goes on with a key picture
const START_MS = 8000; // until the first picture, after the service has sent something
const AGAIN_MS = 60000; // after a failure, connections get JPEG
const FAULTS_MS = 20000; // a decoder that fails twice in this time is not used; browsers take decoders back, too
const STATUS = 4000; // added to an HTTP status in a close code
const NOT_IMPLEMENTED = 501;

/** H.264 cannot be shown, for another reason than that the service is away. */
export class Unusable extends Error {}

async function question() {
  if (typeof VideoDecoder === "undefined")
    return isSecureContext ? "this browser has no VideoDecoder" : "browsers decode H.264 only over HTTPS or on the same machine";
  try {
    const { supported } = await VideoDecoder.isConfigSupported({ codec: CODEC, optimizeForLatency: true });
    return supported ? "" : "this browser decodes no H.264";
  } catch (error) {
    return `this browser decodes no H.264: ${error.message}`;
  }
}

/** The choice between H.264 and JPEG, for all pictures of the page. */
export const video = {
  asked: null, // the browser's answer, a promise of a reason
  failed: null, // {why, at_ms}: the last failure
  fault_ms: -Infinity, // when a decoder failed last
  encoder: "",
  shows: "", // "h264" or "jpeg", of the last picture

  /** "": H.264 can be tried; else why not. */
  async refusal() {
    this.asked ??= question();
    const why = await this.asked;
    if (why) this.failed = { why, at_ms: Infinity };
    return this.failed && Date.now() - this.failed.at_ms < AGAIN_MS ? this.failed.why : "";
  },

  fail(why) {
    this.failed = { why, at_ms: Date.now() };
    return this.failed;
  },

  /** The failure was of another kind. */
  forgive(failure) {
    if (this.failed === failure) this.failed = null;
  },

  /** For people. */
  words() {
    if (this.shows === "h264") return `H.264${this.encoder ? `, by ${this.encoder}` : ""}`;
    return this.shows ? `JPEG${this.failed ? `: ${this.failed.why}` : ""}` : "–";
  },
};

/** One connection, whose pictures are decoded and shown until it ends. */
class Connection {
  constructor(path, { show, alive }, done) {
    this.show = show;
    this.alive = alive;
    this.done = done;
    this.key = true; // the next picture must be one
    this.pictures = 0;
    this.silent = true; // nothing has arrived
    this.decoder = new VideoDecoder({ output: (frame) => this.output(frame),
      error: (error) => this.fault(error) });
    const address = new URL(path, location.href);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => this.take(data);
    this.socket.onclose = (event) => this.closed(event);
    this.arm();
  }

  /** A service that has sent nothing yet, as while a moment of a recording is computed, is waited for. */
  arm() {
    this.timer = setTimeout(() => {
      if (this.silent && this.socket.readyState === WebSocket.OPEN) this.arm();
      else this.end(new Unusable("no picture was decoded in time"));
    }, START_MS);
  }

  take(data) {
    if (this.silent) {
      this.silent = false;
      clearTimeout(this.timer);
      this.arm();
    }
    this.alive();
    try {
      if (typeof data === "string") this.configure(JSON.parse(data));
      else this.decode(data);
    } catch (error) {
      this.fault(error);
    }
  }

  fault(error) {
    const first = this.pictures > 0 && Date.now() - video.fault_ms > FAULTS_MS;
    video.fault_ms = Date.now();
    this.end(first ? null : new Unusable(`the decoder failed: ${error.message}`));
  }

  configure({ codec, width, height, encoder }) {
    video.encoder = encoder;
    // Annex B without a description, or Chromium delivers every picture when the next one comes
    this.decoder.configure({ codec, codedWidth: width, codedHeight: height, optimizeForLatency: true });
    this.key = true;
  }

  decode(data) {
    const head = new DataView(data);
    const key = (head.getUint32(16) & 1) === 1;
    if (this.key && !key) return;
    if (!key && this.decoder.decodeQueueSize > QUEUE_MAX) { // late pictures are dropped, not queued
      this.key = true;
      this.socket.send("key");
      return;
    }
    this.key = false;
    this.decoder.decode(new EncodedVideoChunk({ type: key ? "key" : "delta", timestamp: Number(head.getBigUint64(0)),
      data: new Uint8Array(data, HEAD) }));
  }

  output(frame) {
    clearTimeout(this.timer);
    this.pictures++;
    video.shows = "h264";
    video.failed = null;
    try {
      this.show(frame, frame.timestamp / 1000);
    } finally {
      frame.close();
    }
  }

  closed({ code, reason }) {
    const status = code - STATUS;
    if (status === NOT_IMPLEMENTED) this.end(new Unusable(reason || "the service encodes none"));
    else if (status > 0 && status < 1000) this.end(new ApiError(status, reason));
    else if (this.pictures === 0 && code === 1006) this.end(new Unusable("its WebSocket does not open; a proxy may not let it pass"));
    else this.end(this.pictures ? null : new ApiError(0, "The connection was lost."));
  }

  end(error) {
    clearTimeout(this.timer);
    this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    if (this.decoder.state !== "closed") this.decoder.close();
    this.done(error);
  }
}

/**
 * Shows a picture until its connection ends or `signal` aborts it.
 * @param path   of the WebSocket
 * @param hooks  show(frame, taken_ms); alive(): something arrived
 */
export function watch(path, signal, hooks) {
  return new Promise((resolve, reject) => {
    if (signal.aborted) {
      resolve();
      return;
    }
    const connection = new Connection(path, hooks, (error) => (error ? reject(error) : resolve()));
    signal.addEventListener("abort", () => connection.end(null), { once: true });
  });
}
