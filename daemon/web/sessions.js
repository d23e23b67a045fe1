// Access: sessions with addresses and times, logging out and ending other sessions; named tokens.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { $, complain, el, localTime, onUse, sentence, setText } from "/web/ui.js";

/** "Firefox on Linux", of a User-Agent. */
export function device(agent) {
  const find = (names) => names.find(([pattern]) => pattern.test(agent))?.[1];
  const browser = find([[/Edg\//, "Edge"], [/Firefox\//, "Firefox"], [/Chrom(e|ium)\//, "Chrome"], [/Safari\//, "Safari"]]);
  const system = find([[/iPhone|iPad/, "iOS"], [/Android/, "Android"], [/Windows/, "Windows"], [/Mac OS X/, "macOS"], [/Linux/, "Linux"]]);
  return browser ? `${browser}${system ? ` on ${system}` : ""}` : agent.split(/[ /]/)[0] || "A browser";
}

export class Sessions {
  constructor() {
    onUse($("account"), () => this.show());
    $("sessions-close").addEventListener("click", () => $("sessions").close());
    $("sessions").addEventListener("close", () => this.forget());
    onUse($("log-out"), () => this.end(null));
    $("token-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.make().catch((error) => setText($("token-made"), sentence(error.message)))
        .finally(() => $("token-made").scrollIntoView({ block: "nearest" })); // the lists above may fill the window
    });
  }

  async show() {
    try {
      await this.refresh();
      $("sessions").showModal();
    } catch (error) {
      complain(error);
    }
  }

  async refresh() {
    const control = document.getElementById("role-badge").hidden;
    // Both before anything is shown: a row that comes later would take a click from the one that it replaces.
    const [{ sessions }, { tokens }] = await Promise.all([get("/api/v1/sessions"), control ? get("/api/v1/tokens") : { tokens: [] }]);
    sessions.sort((a, b) => Number(b.own) - Number(a.own) || b.seen.localeCompare(a.seen));
    $("log-out").hidden = !sessions.some((session) => session.own);
    setText($("sessions-note"), control ? "A session that is ended needs the token to come back. Another token in token_file ends all of them."
      : "With the control token all sessions are shown here.");
    $("session-list").replaceChildren(...sessions.map((session) => this.row(session, control)));
    $("tokens").hidden = !control;
    $("token-list").replaceChildren(...tokens.map((token) => this.tokenRow(token)));
  }

  row(session, control) {
    const role = session.role === "control" ? "Control" : "View only";
    const facts = `${role}${[undefined, "control", "view"].includes(session.user) ? "" : ` · ${session.user}`} · ${session.address} · since ${localTime(session.since)}`
      + (session.own ? "" : ` · last seen ${localTime(session.seen)}`);
    const end = control && !session.own
      ? el("button", { type: "button", class: "small danger", onclick: () => this.end(session.session) }, "End") : null;
    return el("li", {}, el("span", {}, el("strong", {}, device(session.agent), session.own ? " (this one)" : ""),
      el("span", { class: "quiet" }, facts)), end);
  }

  tokenRow(token) {
    const until = !token.expires ? "never expires" : `${token.expired ? "expired" : "expires"} ${localTime(token.expires)}`;
    return el("li", {}, el("span", {}, el("strong", {}, token.name), el("span", { class: "quiet" }, `${token.rights.join(", ")} · ${until}`)),
      el("button", { type: "button", class: "small danger", onclick: () => this.revoke(token.name) }, "Revoke"));
  }

  /** The secret is in the answer alone, and on the page until the dialog closes. */
  async make() {
    const name = $("token-name").value;
    const rights = [...$("token-rights").querySelectorAll("input:checked")].map((box) => box.value);
    const expires = Number($("token-expires").value);
    this.forget();
    if (!rights.length) throw new Error("A token needs a right: choose one.");
    $("token-make").disabled = true; // one secret for one click
    try {
      const { token } = await post("/api/v1/tokens", { name, rights, ...(expires ? { expires_s: expires } : {}) });
      $("token-form").reset();
      this.showSecret(name, token);
      await this.refresh();
    } finally {
      $("token-make").disabled = false;
    }
  }

  showSecret(name, token) {
    const field = el("input", { type: "text", readonly: true, "aria-label": `Token ${name}`, onfocus: () => field.select() });
    const copy = navigator.clipboard // of secure pages
      ? el("button", { type: "button", class: "small", onclick: () => navigator.clipboard.writeText(token).then(() => setText(copy, "Copied")).catch(() => field.select()) }, "Copy")
      : null;
    field.value = token;
    $("token-made").replaceChildren(el("span", {}, `Token ${name}; it is shown now and never again:`), field, ...(copy ? [copy] : []));
  }

  forget() {
    $("token-made").replaceChildren();
  }

  async revoke(name) {
    this.forget();
    try {
      await post(`/api/v1/tokens/${encodeURIComponent(name)}`, { revoke: true });
      await this.refresh();
    } catch (error) {
      $("sessions").close();
      complain(error);
    }
  }

  /** @param name  null: one's own */
  async end(name) {
    try {
      await post(name ? `/api/v1/sessions/${name}` : "/api/v1/logout", name ? { end: true } : {});
      if (name) await this.refresh();
      else location.assign("/login");
    } catch (error) {
      $("sessions").close();
      complain(error);
    }
  }
}
