// Client of the service's API: JSON in and out, every error as one sentence.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const TIMEOUT_MS = 10000;
const STATUS_MS = 4000; // after a longer wait a user would mistake an old picture for a current one

/** Prefix of requests about pictures: "" for live ones, "/replay" for the recording that is played. */
export const source = { base: "" };

export class ApiError extends Error {
  constructor(status, message) {
    super(message);
    this.status = status; // HTTP status; 0: no answer
  }
}

const WORDS = {
  401: "You are not logged in, or the token has changed.",
  403: "This token is read-only: it cannot change anything.",
  429: "Too many at a time: the service takes no more for now.",
  503: "The service has nothing to show yet.",
};

async function fault(response) {
  let sentence = "";
  try {
    sentence = (await response.json()).error;
  } catch {
    sentence = ""; // not an answer of the service: the status code is enough
  }
  return new ApiError(response.status, sentence || WORDS[response.status] || `The service answered ${response.status}.`);
}

function unreachable(error) {
  const late = error.name === "TimeoutError";
  return new ApiError(0, late ? "The service did not answer in time." : "The service does not answer.");
}

async function ask(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { ...options, cache: "no-store", signal: options.signal ?? AbortSignal.timeout(TIMEOUT_MS) });
  } catch (error) {
    throw unreachable(error);
  }
  if (!response.ok) throw await fault(response);
  return response;
}

async function json(response) {
  try {
    return await response.json();
  } catch {
    throw new ApiError(response.status, "The service's answer is not JSON: it may have been restarted meanwhile.");
  }
}

export async function get(path) {
  return json(await ask(path));
}

/** The service's status; also synchronises the clock offset. */
export async function getStatus() {
  const sent = Date.now();
  const status = await json(await ask("/api/v1/status", { signal: AbortSignal.timeout(STATUS_MS) }));
  clock.note(status.time, sent, Date.now());
  return status;
}

export async function getLines(path) {
  const text = await (await ask(path)).text();
  return text.split("\n").filter(Boolean).map((line) => JSON.parse(line));
}

/** A picture, or null if none is available. */
export async function getBlob(path) {
  return (await ask(path)).blob();
}

export async function post(path, body) {
  return json(await ask(path, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
  }));
}

/** Reader of an endless body; `signal` aborts it. */
export async function open(path, signal, headers = {}) {
  const response = await ask(path, { signal, headers });
  return { reader: response.body.getReader(), type: response.headers.get("Content-Type") ?? "" };
}

/** Offset of the service's clock from the browser's: the estimate of the shortest round trip is kept. */
export const clock = {
  offset_ms: 0,
  bestTrip_ms: Infinity,
  note(iso, sent_ms, received_ms) {
    const at = Date.parse(iso);
    const trip = received_ms - sent_ms;
    const offset = at - (sent_ms + received_ms) / 2;
    // a clock step on either side is accepted at once, whatever the round trip took
    const stepped = Math.abs(offset - this.offset_ms) > trip + this.bestTrip_ms;
    if (Number.isFinite(at) && (trip <= this.bestTrip_ms || stepped)) {
      this.offset_ms = offset;
      this.bestTrip_ms = trip;
    }
  },
  now() {
    return Date.now() + this.offset_ms;
  },
};
