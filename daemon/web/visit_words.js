// A visit in words, for cards, the large one, events and the day.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { duration, finite, localTime, number } from "/web/ui.js";

const LEAD_MS = 1500; // before the moment that is on the card

export const KINDS = { seen: "See-through", camera: "Camera" };
export const address = (visit, kind) => `/api/v1/visits/${encodeURIComponent(visit.visit)}/${kind}`;
export const what = (visit) => visit.label || "Something";

/** "gate, crossed drive forward" */
function places({ zones, crossed = [] }) {
  const lines = crossed.map(({ zone }) => zone);
  return [...zones.filter((zone) => !lines.includes(zone)), ...crossed.map(({ zone, direction }) => `crossed ${zone} ${direction}`)].join(", ");
}

export function facts(visit) {
  return [visit.active ? "there now" : duration(visit.seconds), places(visit), visit.nearest_m === null ? "" : `nearest ${number(visit.nearest_m, 1)}\u00a0m`,
    visit.direction, visit.hidden ? "behind the foreground" : "", visit.keep ? "kept" : ""].filter(Boolean).join("\u00a0· ");
}

export const title = (visit) => `${what(visit)}, ${localTime(visit.from)}`;

/** "See-through" before "Camera", as far as there are any. */
export const pictures = (visit) => Object.keys(KINDS).filter((kind) => visit.pictures.includes(kind));

/** A moment before the pictures of the card were taken, when the visitor was fully in view; of older data the point of its way that is nearest to them. */
export function momentOf({ from, path, picture_s, box: [x0, , x1, y1] }) {
  const far = ([, x, y]) => Math.hypot(x - (x0 + x1) / 2, y - y1);
  const [nearest] = path.reduce((best, point) => (far(point) < far(best) ? point : best), path[0] ?? [0, 0, 0]);
  const at = finite(picture_s) ? picture_s : nearest;
  return Math.max(Date.parse(from) + 1000 * at - LEAD_MS, Date.parse(from));
}
