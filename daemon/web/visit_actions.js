// Actions on visits: one table, from which the card, the selection and keys have their buttons.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { post } from "/web/api.js";
import { sureToDelete } from "/web/confirm.js";
import { complain, finite, toast } from "/web/ui.js";
import { title } from "/web/visit_words.js";

const count = (n) => (n === 1 ? "1 visit" : `${n} visits`);

/** The light field of the moment at which it was nearest. */
function nearest({ from, path }) {
  const [seconds] = path.reduce((best, point) => ((point[3] ?? Infinity) < (best[3] ?? Infinity) ? point : best), path[path.length >> 1] ?? [0]);
  return new Date(Date.parse(from) + 1000 * (finite(seconds) ? seconds : 0)).toISOString();
}

export const exportOne = (visit) => post("/api/v1/export", { time: nearest(visit) });

async function exportAll(list) {
  let made = 0, lost = 0;
  for (const visit of list) {
    try {
      await exportOne(visit);
      made++;
    } catch (error) {
      if (error.status !== 404) throw error;
      lost++;
    }
    if (list.length > 1) toast(`Light fields: ${made + lost} of ${list.length}.`, "info", null, "export");
  }
  const gone = lost ? ` ${lost === 1 ? "One moment was" : `${lost} moments were`} not recorded, or the recording is gone.` : "";
  toast(made ? `The light fields of ${count(made)} are kept, below Recordings.${gone}` : gone.trim(), "info", null, "export");
}

async function remove(list, visits) {
  const ended = list.filter((visit) => !visit.active);
  if (!ended.length) {
    toast("It has not gone yet. It can be deleted when it has.");
    return;
  }
  const which = ended.length === 1 ? `The visit ${title(ended[0])}` : count(ended.length);
  if (await sureToDelete(`${which}: pictures and data are removed from the disk of the service. Recordings stay. It cannot be brought back.`))
    await visits.change(ended, { delete: true });
}

/** name, icon, text; `card`: on each card; `many`: for a selection; `control`: needs the token that controls; `pressed` and `off` of one visit:
 *  state, and why it cannot be done; `run(visits chosen, Visits)`. */
export const ACTIONS = [
  { name: "play", icon: "play", text: "Play", card: true, off: (visit, visits) => visits.unrecorded(visit), run: ([visit], visits) => visits.play(visit) },
  { name: "reviewed", icon: "check", text: "Reviewed", card: true, many: true, pressed: (visit) => visit.reviewed,
    run: (list, visits) => visits.change(list, { reviewed: !list.every((visit) => visit.reviewed) }) },
  { name: "keep", icon: "pin", text: "Keep", card: true, many: true, control: true, pressed: (visit) => visit.keep,
    run: (list, visits) => visits.change(list, { keep: !list.every((visit) => visit.keep) }) },
  { name: "export", icon: "down", text: "Light field", many: true, control: true, run: (list) => exportAll(list) },
  { name: "delete", icon: "bin", text: "Delete", many: true, control: true, danger: true, run: remove },
];

export async function act(name, list, visits) {
  const action = ACTIONS.find((one) => one.name === name);
  try {
    if (list.length) await action.run(list, visits);
  } catch (error) {
    complain(error);
  }
}
