// Recorded spans of time, for all parts of the page that show them: one request every ten seconds.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get } from "/web/api.js";

const FRESH_MS = 10000;
const NEAR_MS = 5000; // a recording may begin after the visit that it is of

let spans = null; // {from, to, name}, in ms; null: not known
let asked_ms = 0;
let pending = null;

/** The newest answer, asked for again if it is old; throws as get() does. */
export async function recordings(now = false) {
  if (!pending && (now || Date.now() - asked_ms > FRESH_MS))
    pending = get("/api/v1/recordings").then((kept) => {
      spans = kept.recordings.map(({ from, to, name, active }) => ({ from: Date.parse(from), to: active ? Infinity : Date.parse(to), name }));
      asked_ms = Date.now();
    }).finally(() => { pending = null; });
  await pending;
  return spans;
}

/** The moment, or the one next to it that was recorded while something was there; null: none; NaN: not known yet. */
export function recordedMoment(at, from, to) {
  if (!spans) return NaN;
  const there = spans.filter((span) => span.from <= to + NEAR_MS && span.to >= from);
  const near = there.map((span) => Math.min(Math.max(at, span.from), span.to));
  return near.reduce((best, moment) => (best === null || Math.abs(moment - at) < Math.abs(best - at) ? moment : best), null);
}
