// One question before something is removed for good.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, onUse, setText } from "/web/ui.js";

let answer = null;

function end(yes) {
  $("delete").close();
  answer?.(yes);
  answer = null;
}

onUse($("delete-yes"), () => end(true));
$("delete-no").addEventListener("click", () => end(false));
$("delete").addEventListener("cancel", () => end(false));
$("delete").addEventListener("keydown", (event) => {
  if (event.key !== "Delete" || event.repeat) return; // the key that asked
  event.preventDefault();
  end(true);
});

/** Resolves with true after a yes. */
export function sureToDelete(text) {
  setText($("delete-text"), text);
  $("delete").showModal();
  $("delete-no").focus();
  return new Promise((done) => { answer = done; });
}
