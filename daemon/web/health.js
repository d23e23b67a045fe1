// Service health: the line at the top, charts, time per stage, and the counts of frames, disk space and clients.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { clock } from "/web/api.js";
import { facts } from "/web/cameras.js";
import { Chart, drawBar } from "/web/charts.js";
import { fits } from "/web/recordings.js";
import { $, bytes, duration, el, finite, localTime, number, setText } from "/web/ui.js";
import { video } from "/web/h264.js";

const SPAN_S = 300;

const STATES = {
  starting: ["Starting", "wait"], idle: ["Idle", "wait"], armed: ["Armed", "wait"], capturing: ["Live", "ok"],
  degraded: ["Degraded", "warn"], draining: ["Stopping", "wait"], failed: ["Failed", "bad"],
};
const STAGE_WORDS = {
  wait: "waiting", change: "change", decode: "decoding", rectify: "rectifying", disparity: "depth", labels: "labels",
  refine: "refining", render: "rendering", encode: "encoding", background: "background",
};

const NOTICED_WORDS = {
  noise: "Noise", blur: "Blurred", "soft-views": "Soft views", jpeg: "JPEG", "missing-views": "Missing views",
  "blank-views": "Dark views", misaligned: "Misaligned", "time-offsets": "Exposed apart",
  "too-slow": "Too slow", removed: "Removed",
};

function saved(skip, digits, unit) {
  if (!skip?.on) return "off";
  const error = finite(skip.error) ? `error ${number(skip.error, digits)} ${unit}` : "error not sampled yet";
  return `${number(skip.skipped_percent)} %, ${error}`;
}

/** Work of the live picture's device, and of the processor. */
function deviceFacts(device) {
  if (!device) return [["Computed on", "the processor"]];
  const { labels } = device;
  const cpu = device.stages_on_cpu.map((name) => STAGE_WORDS[name] ?? name).join(", ");
  const because = ({ reason }) => reason ? `: ${reason}` : "";
  return [
    [device.failing ? "Device fails" : "Device", `${device.name}, ${number(device.pictures)} pictures${device.on_cpu
      ? `, ${number(device.on_cpu)} on the processor${because(device)}` : ""}`, device.failing ? "warn" : ""],
    ...(labels ? [[labels.failing ? "Device fails at labels" : "Labels there", `${number(labels.runs)} runs${labels.on_cpu
      ? `, ${number(labels.on_cpu)} on the processor${because(labels)}` : ""}`, labels.failing ? "warn" : ""]] : []),
    ["On the processor", cpu]];
}

function clockText(time) {
  const off_s = Math.round(clock.offset_ms / 1000);
  return `${String(time).slice(0, 19).replace("T", " ")} UTC${off_s ? `, ${duration(Math.abs(off_s))} ${off_s > 0 ? "ahead of" : "behind"} this device` : ""}`;
}

/** LOW by the quota is the usual state of a loop of recordings. */
function storageKind({ state, limit }) {
  return state === "FULL" ? "bad" : state === "LOW" && limit !== "quota" ? "warn" : "";
}

export class Health {
  constructor() {
    this.rate = new Chart($("chart-rate"), ["first"], SPAN_S);
    this.delay = new Chart($("chart-delay"), ["first", "second"], SPAN_S);
    this.cards = {};
    for (const [key, title] of [["state", "Service"], ["capture", "Capture"], ["hosts", "Hosts"], ["live", "Live picture"], ["storage", "Storage"],
      ["clients", "Viewers and programs"]]) {
      const list = el("dl", { class: "facts" });
      const extra = el("div", {});
      const heading = el("h2", { id: `h-health-${key}` }, title);
      this.cards[key] = { list, extra, heading };
      $("panel-health").append(el("section", { class: "card", "aria-labelledby": `h-health-${key}` }, heading, extra, list));
    }
    this.cards.storage.extra.append(el("div", { class: "meter", role: "img" }, el("i", {})));
  }

  /** No status: the service does not answer, or refuses. */
  unreachable(error) {
    this.showState(error.status ? "Refused" : "Reconnecting", "bad", error.message);
    this.rate.add([NaN]);
    this.delay.add([NaN, NaN]);
  }

  showState(word, kind, why) {
    $("state").dataset.kind = kind;
    setText($("state-word"), word);
    setText($("state-why"), why);
    $("state").title = why;
    document.title = kind === "ok" ? "sst" : `${word} – sst`;
  }

  update(status) {
    const { capture = {}, live = {}, storage = {} } = status;
    const slow = status.state === "capturing" && live.too_slow === true;
    const [word, kind] = slow ? ["Too slow", "warn"] : STATES[status.state] ?? [status.state, "warn"];
    this.showState(word, kind, slow ? "visits may be missed" : status.reason ?? "");
    const absent = capture.cameras - capture.present;
    setText($("v-cameras"), finite(capture.present) ? `${capture.present} / ${capture.cameras}` : "–");
    $("v-cameras").dataset.kind = absent > 0 ? "warn" : "";
    setText($("v-rate"), !live.enabled ? "off" : `${number(live.rate_hz, 1)}${slow ? ` of ${number(live.due_hz, 1)}` : ""} /s`);
    $("v-rate").dataset.kind = slow ? "warn" : "";
    const quota = storage.quota_bytes > 0;
    const share = quota ? `${bytes(storage.used_bytes)} of ${bytes(storage.quota_bytes)}` : "";
    setText($("v-free-name"), quota ? "Disk used" : "Disk free");
    setText($("v-free"), (quota ? `${number(100 * storage.used_bytes / storage.quota_bytes)} %` : bytes(storage.free_bytes)) +
      (storageKind(storage) ? `, ${storage.state.toLowerCase()}` : ""));
    $("v-free").title = [share, storage.reason].filter(Boolean).join("; ");
    $("v-free").dataset.kind = storageKind(storage);
    this.showLive(live);
    this.showCards(status);
  }

  showLive(live) {
    const p50 = live.latency_ms?.p50 ?? NaN;
    const p99 = live.latency_ms?.p99 ?? NaN;
    this.rate.add([live.rate_hz ?? NaN]);
    this.delay.add([p50, p99]);
    setText($("rate-now"), number(live.rate_hz, 1));
    setText($("delay-now"), `${number(p50)} / ${number(p99)}`);
    const stages = Object.entries(live.stages_ms ?? {}).filter(([name, stage]) => finite(stage.p50) &&
      !(live.surface && ["disparity", "labels", "refine"].includes(name)));
    const words = stages.map(([name, stage]) => ({ name: `${STAGE_WORDS[name] ?? name}: ${number(stage.p50)} ms`, value: stage.p50 }));
    drawBar($("stages"), words);
    $("stages").setAttribute("aria-label", words.map((word) => word.name).join(", ") || "not known yet");
    const list = $("stage-list");
    if (list.children.length !== stages.length)
      list.replaceChildren(...stages.map((_, i) => el("li", {}, el("i", { class: `swatch part-${i % 9}`, "aria-hidden": "true" }),
        el("span", {}), el("b", {}), el("small", {}))));
    stages.forEach(([name, stage], i) => {
      const [, label, value, worst] = list.children[i].children;
      setText(label, STAGE_WORDS[name] ?? name);
      setText(value, number(stage.p50));
      setText(worst, `/ ${number(stage.p99)}`);
    });
  }

  showCards(status) {
    const { capture = {}, live = {}, storage = {}, clients = {}, process = {} } = status;
    facts(this.cards.state.list, [
      ["State", `${status.state}${status.reason ? `: ${status.reason}` : ""}`],
      ["Running for", duration(status.uptime_s)], ["Clock", clockText(status.time)], ["Version", status.version ?? "–"],
      ["Memory", bytes(process.rss_bytes)], ["Processor", `${number(process.cpu_percent)} % of a core`],
      ["Open files", number(process.descriptors)]]);
    this.showCapture(capture);
    this.showHosts(status.hosts);
    const skips = live.skips ?? {};
    facts(this.cards.live.list, [
      ["Picture", live.size ? `${live.size.join(" × ")}, of ${number(live.views)} cameras` : "–"],
      ["Sent as", video.words()],
      ["Changed", `${number(live.changed_percent, 1)} % of the scene`],
      ["Processed / passed over", `${number(live.sets)} / ${number(live.dropped)} sets`],
      ["Work saved by change", saved(skips.change, 2, "levels")], ["Work saved on labels", saved(skips.labels, 3, "of labels")],
      ["Processor", `${number(live.cpu_percent)} % of a core`],
      ...deviceFacts(live.device),
      ...(status.noticed ?? []).map(({ what, text }) => [NOTICED_WORDS[what] ?? what, text, "warn"])]);
    this.showStorage(storage);
    facts(this.cards.clients.list, [
      ["Connections", `${number(clients.http)}, ${number(clients.streams)} with pictures, ${number(clients.videos)} of them H.264, ${number(clients.listeners)} with events`],
      ["RTSP", number(clients.rtsp)], ["Requests", `${number(clients.requests)}, ${number(clients.refused)} refused`]]);
  }

  showCapture(capture) {
    const { frames = {}, skew_us: skew = {}, trigger = {}, privacy = {} } = capture;
    const buckets = ["late", "duplicate", "stray", "corrupt", "flagged", "dropped"].filter((name) => frames[name] > 0);
    const over = skew.over > 0;
    facts(this.cards.capture.list, [
      ["Sets", `${number(capture.sets)}, ${number(capture.complete)} complete`],
      ["Rate", `${number(capture.rate_hz, 1)} Hz`],
      ["Trigger", `${trigger.source ?? "–"}, ${number(trigger.edges)} edges${trigger.skipped ? `, ${number(trigger.skipped)} skipped` : ""}`],
      ["Skew p50 / p99 / max", `${number(skew.p50)} / ${number(skew.p99)} / ${number(skew.max)} µs`],
      ["Skew limit", `${number(skew.limit)} µs, ${over ? `${number(skew.over)} sets over, worst ${skew.worst}` : "none over"}`, over ? "warn" : ""],
      ["Frames", `${number(frames.delivered)} delivered, ${number(frames.set)} in sets`],
      ["Not in sets", buckets.length ? buckets.map((name) => `${number(frames[name])} ${name}`).join(", ") : "none"],
      ["Unexplained", number(frames.unexplained), frames.unexplained > 0 ? "bad" : ""],
      ["Privacy masks", privacy.masks > 0 ? `${number(privacy.masks)}, in ${number(privacy.cameras)} cameras` : "none"],
      ...(privacy.withheld > 0 ? [["Withheld", `${number(privacy.withheld)} damaged frames that could not be masked`, "warn"]] : [])]);
  }

  /** Several hosts with one array: the head that a node sends to, or the nodes of a head. */
  showHosts(hosts) {
    const card = this.cards.hosts;
    card.heading.parentElement.hidden = !hosts;
    if (!hosts) return;
    const state = ({ connected, reason }) => connected ? "connected" : `not connected${reason ? `: ${reason}` : ""}`;
    const { head, datagrams = {}, nodes = [], frames = {}, clock = {} } = hosts;
    facts(card.list, [
      ...(head ? [[`Head ${head.address ?? ""}`, state(head), head.connected ? "" : "warn"],
        ["Pictures go", datagrams.used ? "by datagrams" : `over TLS${datagrams.reason ? `: ${datagrams.reason}` : ""}`, datagrams.used ? "" : "warn"],
        ["Frames not sent", `${number(frames.dropped)} dropped, ${number(frames.away)} while the head was away`]] : []),
      ...nodes.map((node) => [`Node ${node.name}`, node.connected
        ? `connected, ${number(node.cameras)} cameras, clock ${number(node.clock_ms, 1)} ms off, ${number(node.slips)} slips put right`
        : state(node), node.connected ? "" : "warn"]),
      ["Clock of this host", clock.synchronised ? "is kept" : "is not kept", clock.synchronised ? "" : "warn"]]);
  }

  showStorage(storage) {
    const { recording = {}, ring = {} } = storage;
    const whole = storage.used_bytes + storage.free_bytes;
    const limit = storage.quota_bytes > 0 ? Math.min(storage.quota_bytes, whole) : whole;
    const share = limit > 0 ? Math.min(1, storage.used_bytes / limit) : 0;
    const meter = this.cards.storage.extra.firstChild;
    meter.firstChild.style.width = `${(share * 100).toFixed(1)}%`;
    meter.dataset.kind = storageKind(storage);
    meter.setAttribute("aria-label", `${number(share * 100)} % used`);
    const modes = { off: "on demand", continuous: "always", event: "on events" };
    facts(this.cards.storage.list, [
      ["State", `${storage.state ?? "–"}${storage.reason ? `: ${storage.reason}` : ""}`, storageKind(storage)],
      ["Used", `${bytes(storage.used_bytes)}${storage.quota_bytes > 0 ? ` of ${bytes(storage.quota_bytes)} allowed` : ""}`],
      ["Free on disk", bytes(storage.free_bytes)],
      ["Recordings", `${number(storage.recordings)}${storage.oldest ? `, since ${localTime(storage.oldest)}` : ""}`],
      ["Records", `${modes[recording.mode] ?? recording.mode ?? "–"}${recording.active ? `, now: ${recording.why}` : ""}`],
      ["Room for", fits(storage) || "–"],
      ["In memory", ring.sets > 0 ? `the last ${number(ring.seconds, 1)} s (${bytes(ring.bytes)})` : "nothing"],
      ["Folder", storage.dir ?? "–"]]);
  }
}
