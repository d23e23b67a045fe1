// Starts the page: one view, one status request a second, and the panels that follow them.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { Adjust } from "/web/adjust.js";
import { get, getStatus } from "/web/api.js";
import { Calendar } from "/web/calendar.js";
import { Cameras } from "/web/cameras.js";
import { Clear } from "/web/clear.js";
import { Events } from "/web/events.js";
import { Focus } from "/web/focus.js";
import { Health } from "/web/health.js";
import { Keys } from "/web/keys.js";
import { Labels } from "/web/labels.js";
import { Light } from "/web/light.js";
import { Masks } from "/web/masks.js";
import { Notify } from "/web/notify.js";
import { Push } from "/web/push.js";
import { recordedMoment } from "/web/recorded.js";
import { Recordings } from "/web/recordings.js";
import { Replay } from "/web/replay.js";
import { Sessions } from "/web/sessions.js";
import { Stage } from "/web/stage.js";
import { Timeline } from "/web/timeline.js";
import { $, complain, finite, forbid, localTime, sentence, session, toast, visible } from "/web/ui.js";
import { Videos } from "/web/video.js";
import { View } from "/web/view.js";
import { address, momentOf, pictures } from "/web/visit_words.js";
import { Visits } from "/web/visits.js";
import { Zones } from "/web/zones.js";

const STATUS_MS = 1000;
const STILL_TAKING_MS = 4000;
const FOLLOW_MS = 200;
const FOLLOW_TRIES = 10; // a track that just came is not in the view's answer at once
const SLOW = 2; // cameras and labels: every second status request
const SLOWER = 5; // recordings, while they are shown
const OWN_AGAIN = 30; // retry interval while the main view is shown instead

const KEPT = ["method", "focus_px", "focus_label", "cut_px", "remove_label", "outline", "tint", "keep_moving", "follow"]; // not reset by the drawer

let status = null;
let taken = { sets: -1, idle: 0, at_ms: 0, still: false }; // the last frameset that the service processed, and whether anything moved
let failures = 0;
let trouble = null; // the latest one
let wake = () => {}; // requests the status now
let played = null; // visit whose recording is open; null: another one
let cutBefore = null; // {px: of the live picture}, while a visit is played with another

const app = {
  mode: "clear", // or "sst": see-through
  /** Value moved by the wheel, two fingers, plus and minus. */
  depth: () => (app.mode === "clear" ? app.clear : app.focus),
  /** True while the service has only just found the range of disparities or the cut. */
  settling: () => status?.live?.ready === true && status.live.settling === true,
  /** Levels of 16-bit frames that are shown black and white, in words; "": frames of 8 bits. */
  levels: () => (status?.live?.levels ? `levels ${status.live.levels[0]} to ${status.live.levels[1]}` : ""),
  /** True while framesets arrive and the scene is still. */
  still: () => taken.still && Date.now() - taken.at_ms < STILL_TAKING_MS,
  /** Applies settings to the picture and to the one that it is compared with. */
  change(settings) {
    app.view.change(settings);
    if (app.mode !== "clear") app.stage.plain?.change(settings); // the camera's picture has settings of its own
  },
};
app.focus = new Focus((px) => {
  app.focus.followed_px = NaN; // a manual focus ends following
  app.change(app.view.settings.follow ? { focus_px: px, follow: false } : { focus_px: px });
  unfollow();
});
app.clear = new Clear(app.focus, app.change, () => app.view.restore());
app.labels = new Labels((settings) => {
  app.change(settings);
  if ("focus_label" in settings) unfollow();
});
app.view = new View($("canvas"), { method: "clear", tint: true }, (what, why) => {
  if (what === "refused") {
    complain(why);
    if (why.status === 403) adopt(app.view.id).catch(complain); // the controls show the settings in force
    if (why.status === 400) show(app.view.settings);
  }
  else if (what === "shared") {
    toast(`${sentence(why.message)} The main view is shown, which all share.`, "error");
    app.view.current().then((view) => view && show(view.settings)).catch(() => {}); // the next status request reports it
  }
  else if (what === "made") {
    show({ ...why, ...app.view.settings });
    app.clear.forget();
  }
  else app.stage.onStream(what, why);
});
app.stage = new Stage(app);
const adjust = new Adjust(app, () => {
  const kept = Object.fromEntries(Object.entries(app.view.settings).filter(([key]) => KEPT.includes(key)));
  app.view.renew(kept);
  app.stage.plain?.renew({ ...kept, method: "refocus" });
});
const cameras = new Cameras((name) => app.stage.overlays.showCamera(name), (name, button) => app.masks.openFor(name, button));
new Light();
new Sessions();
const zones = new Zones(app);
const closeZones = () => { if (zones.open) zones.toggle(false); };
const closeAdjust = () => { if (!$("drawer").hidden) adjust.toggle(false); };
app.masks = new Masks(app, () => {
  closeZones();
  closeAdjust();
});
for (const [button, other] of [["zones", closeAdjust], ["adjust", closeZones]])
  $(button).addEventListener("click", () => {
    other();
    if (app.masks.open) app.masks.toggle(false, false);
  });
const health = new Health();
app.replay = new Replay(() => {
  if (!app.replay.open && cutBefore) {
    app.view.settings.cut_px = cutBefore.px;
    app.clear.adopt(app.view.settings);
    cutBefore = null;
  }
  followed = null;
  app.view.settings.follow_track = 0; // tracks of one source mean nothing in the other
  app.focus.stopSweep();
  app.focus.forget();
  app.view.move(app.view.settings);
  app.stage.sourceChanged();
  app.labels.refresh().catch(() => {}); // not there yet; the next round
}, (state) => {
  if (state.live) followScene(state.live);
  app.stage.explain(explanation());
}, () => app.stage.drawn_ms());
const recordings = new Recordings(() => app.view.stream.picture(), app.replay, () => { played = null; });
const visits = new Visits(async (visit) => {
  played = visit;
  const at = recordedMoment(momentOf(visit), Date.parse(visit.from), Date.parse(visit.to));
  await app.replay.start({ time: new Date(finite(at) ? at : momentOf(visit)).toISOString() });
  if (app.replay.open && played === visit) keepVisitor(visit); // else closed, or another one was chosen meanwhile
}, () => (app.replay.open ? played?.visit ?? "" : ""));
const timeline = new Timeline(app, (time) => {
  played = null;
  return app.replay.start({ time });
});
new Videos(app.replay, visits);
new Calendar((day) => {
  $("visits-day").value = day;
  timeline.setDay(day ? new Date(`${day}T00:00:00`).getTime() : Date.now());
  visits.filter();
});
const keys = new Keys();
visits.listenKeys(keys, () => app.replay.toggle());
keys.add("Recording that is played", [["Space", "plays, pauses, unless a button has the focus"], [", .", "5 seconds back, on"], ["L", "back to the live picture"]],
  () => app.replay.open && !document.querySelector("dialog[open]"), { ",": () => app.replay.step(-5), ".": () => app.replay.step(5), l: () => app.replay.close() });
keys.add("", [], ({ target }) => app.replay.open && target === document.body, { " ": () => app.replay.toggle() });
new Notify((visit) => visits.wants(visit), openVisit);
new Push(openVisit);
const events = new Events((event) => {
  if (event.type === "visit" && !$("panel-visits").hidden) visits.soon();
  if (event.type === "visit" && !$("timeline").hidden) timeline.soon();
  if (event.level === "error") toast(event.message, "error");
});

// --- a visit that is played ---

const MARGIN_PX = 0.5; // of the cut before a visitor
const MARGIN = 1.05;
const MARGIN_HIDDEN = 1.15; // objects that all views together see are placed less exactly

/** A visitor is not removed with the objects in front: the cut is just before its nearest point, until the picture is live again. */
function keepVisitor({ nearest_px: px, hidden }) {
  if (app.mode !== "clear" || !finite(px)) return;
  cutBefore ??= { px: app.clear.cut_px };
  app.clear.set((hidden ? MARGIN_HIDDEN : MARGIN) * px + MARGIN_PX);
}

// --- picked objects that move ---

let followed = null; // {track, name, px: its last disparity}; null: nothing

app.followed = () => followed;

/** The focus and the ring follow a track until another focus is chosen, or it has gone. */
app.follow = (track, name) => {
  followed = { track, name, px: NaN, seen: false, waits: 0 };
  app.change({ follow_track: track });
  watch(followed);
};

/** Another focus was chosen, which ends following on the service, too. */
function unfollow() {
  followed = null;
  app.view.settings.follow_track = 0;
  app.stage?.closePick();
}

function lose({ name, px }) {
  followed = null;
  app.stage.closePick();
  toast(`${name || "What you picked"} is gone.`);
  if (finite(px)) app.focus.set(px); // where it was last, as on the service
}

async function watch(mine) {
  while (followed === mine) {
    await visible();
    try {
      const view = await app.view.current();
      if (followed !== mine || app.view.pending) continue;
      const ours = view?.settings.follow_track === mine.track; // not yet, or another client's choice
      if (ours && !view.track && (mine.seen || mine.waits++ > FOLLOW_TRIES)) lose(mine);
      else if (ours && view.track) {
        Object.assign(mine, { seen: true, px: view.track.disparity_px, name: view.track.name || mine.name });
        app.stage.showFollowed(view.track);
        app.focus.setFollowed(mine.px);
      }
    } catch { /* the next status request reports it */ }
    await new Promise((done) => setTimeout(done, FOLLOW_MS));
  }
}

async function adopt(id) {
  const settings = await app.view.adopt(id);
  if (settings) show(settings);
  if (settings?.follow_track) app.follow(settings.follow_track, "");
}

/** The controls show settings. */
function show(settings) {
  showMode(settings.method === "clear" ? "clear" : "sst");
  for (const part of [app.focus, app.clear, app.labels, app.stage?.boxes]) part?.adopt(settings);
}

function showMode(mode) {
  app.mode = mode;
  $("viewer").dataset.mode = mode;
  for (const radio of $("mode").querySelectorAll("input")) radio.checked = radio.value === mode;
  app.labels.setKey(mode === "clear" ? "remove_label" : "focus_label");
  app.focus.stopSweep();
  if (mode === "clear") followed = null;
  if (mode === "clear" && !$("drawer").hidden) adjust.toggle(false);
  app.stage.setMode(mode);
}

for (const radio of $("mode").querySelectorAll("input"))
  radio.addEventListener("change", () => {
    app.view.change({ method: radio.value });
    showMode(radio.value);
  });

// --- panels ---

const tabs = [...document.querySelectorAll("[role=tab]")];

function openTab(tab) {
  for (const other of tabs) {
    const on = other === tab;
    other.setAttribute("aria-selected", on);
    other.tabIndex = on ? 0 : -1;
    $(other.getAttribute("aria-controls")).hidden = !on;
  }
  timeline.show(tab.id === "tab-visits" || tab.id === "tab-recordings");
  if (tab.id === "tab-events") events.seen().catch(complain);
  if (tab.id === "tab-visits") visits.refresh().catch(complain);
  if (tab.id === "tab-recordings") recordings.refresh().catch(complain);
}

/** Of a notification, or of the address: /#visit=NAME. */
function openVisit(name) {
  openTab($("tab-visits"));
  visits.openByName(name).catch(complain);
}

/** Of an event: /#recording=NAME. */
function openRecording(name) {
  openTab($("tab-recordings"));
  recordings.open(name).catch(complain);
}

function followAddress() {
  const where = new URLSearchParams(location.hash.slice(1));
  if (where.get("visit")) openVisit(where.get("visit"));
  if (where.get("recording")) openRecording(where.get("recording"));
}

addEventListener("hashchange", followAddress);

for (const tab of tabs) {
  tab.addEventListener("click", () => openTab(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs[(tabs.indexOf(tab) + step + tabs.length) % tabs.length];
    openTab(next);
    next.focus();
  });
}

// --- messages in place of the picture ---

const ADVICE = {
  starting: ["Starting", "Cameras are being opened and their settings read back. That takes some seconds.", []],
  idle: ["Not capturing", "The service runs, but captures nothing.",
    ["`sst cameras` lists the cameras that are plugged in.", "`/etc/sst/sstd.yaml` binds them to their places; `sst reload` applies it."]],
  armed: ["Waiting for the trigger", "All is ready, but no trigger has come yet.",
    ["Check the trigger's line and source in `trigger:` of `/etc/sst/sstd.yaml`.", "`sst doctor` measures whether edges arrive."]],
  draining: ["Stopping", "The service finishes what it writes and ends. This page reconnects when it is back.", []],
  failed: ["The service has failed", "It cannot go on by itself.",
    ["`sst doctor` diagnoses the cause.", "`journalctl -u sstd -e` shows what happened before."]],
};

/** The picture of a visit that was stored when it came, under its own time. */
function pictureOf(visit) {
  const [kind] = visit ? pictures(visit) : [];
  const time = visit && new Date(Date.parse(visit.from) + 1000 * (visit.picture_s ?? 0));
  return kind && { url: address(visit, kind), text: `The card's picture, of ${localTime(time.toISOString())}` };
}

function explanation() {
  if (failures > 1 && trouble.status) return { title: "The service refuses this page", text: `${sentence(trouble.message)} This page tries again by itself.` };
  if (failures > 1) return { title: "The service does not answer", text: "It may be restarting, or the network is cut. This page tries again by itself.",
    todo: status ? [] : ["`systemctl status sstd` shows whether it runs."] };
  if (!status) return { title: "Connecting", text: "Asking the service how it is." };
  if (app.replay.open) return (!app.replay.awaits || app.replay.recorded) && app.view.stream.pictures ? null : {
    title: `Computing the picture of ${app.replay.words(app.replay.at(), true)}`,
    picture: pictureOf(played),
    text: sentence(app.replay.state.live?.reason ?? "") || "Depth and labels of all views of that moment. The recording plays on when it is there." };
  const { state, reason, capture = {}, live = {} } = status;
  if (ADVICE[state]) {
    const [title, text, todo] = ADVICE[state];
    return { title, text: sentence(reason || text), todo };
  }
  if (capture.present === 0) return { title: "No camera", text: sentence(reason) || "None of the cameras answers.",
    todo: ["Check the power of the hubs and the USB cables.", "`sst cameras` lists what is plugged in, `sst doctor` diagnoses the cause."] };
  if (live.enabled === false) return { title: "The live picture is switched off", text: "The cameras are captured and can be recorded.",
    todo: ["Set `live.enabled: true` in `/etc/sst/sstd.yaml`, then `sst reload`."] };
  if (app.stage.refused) return { title: "No moving picture", text: sentence(app.stage.refused) };
  if (app.view.stream.pictures === 0) return live.ready === false
    ? { title: "Computing the first picture", text: sentence(live.reason ?? "") || "The first set is computed whole: depth and labels of all views. That takes some seconds." }
    : { title: "The picture is on its way", text: "Waiting for the first picture of this view." };
  return null;
}

// --- following the service ---

function showRole() {
  const viewer = status?.role === "view";
  $("role-badge").hidden = !viewer;
  const reason = viewer ? "Your token is read-only. Log in with the control token for this." : failures > 1 ? "The service does not answer." : "";
  for (const button of document.querySelectorAll("[data-control]")) {
    const full = button.id === "record" && status?.storage?.state === "FULL" && !recordings.onDemand()
      ? `Nothing can be recorded: ${status.storage.reason || "the disk is full."}` : "";
    forbid(button, reason || full);
  }
}

/** The service may have been updated while the page was disconnected. */
function welcome(body) {
  if (status && status.version !== body.version) { // the page changed with it
    app.masks.stays = true;
    location.reload();
  }
  if (status && body.uptime_s < status.uptime_s) {
    events.restarted();
    app.focus.forget();
  }
  if (failures > 1) { // a broken connection can stay silent for long
    app.view.restart();
    app.stage.plain?.restart();
  }
}

/** Depths of the picture's scene. */
function followScene(live) {
  app.focus.update(live);
  app.clear.update(live);
  app.stage.overlays.setLattice(!live?.surface);
  if (live?.size) document.documentElement.style.setProperty("--shape", live.size.join(" / ")); // of pictures that are on their way
}

function take(body) {
  welcome(body);
  status = body;
  failures = 0;
  const { sets, idle } = status.live ?? {};
  if (finite(sets) && sets !== taken.sets)
    taken = { sets, idle, at_ms: Date.now(), still: sets - taken.sets === idle - taken.idle };
  if (!app.replay.open) followScene(status.live);
  health.update(status);
  recordings.update(status);
  adjust.update(status);
}

async function ask(round) {
  try {
    take(await getStatus());
  } catch (error) {
    if (error.status === 401) {
      location.assign("/login");
      return;
    }
    failures++;
    trouble = error;
    health.unreachable(error);
  }
  if (failures === 0) await askMore(round);
  if (app.view.shared && round % OWN_AGAIN === 0) app.view.renew(app.view.settings);
  showRole();
  app.stage.explain(explanation());
}

/** Values that only the service knows: the disparity of a label that the focus follows, and the parts of the clear picture. */
async function showView() {
  const clear = app.mode === "clear";
  const follows = !clear && app.view.settings.follow && app.labels.chosen;
  const view = follows || clear ? await app.view.current() : null;
  if (!followed) app.focus.setFollowed(follows && finite(view?.shown_focus_px) ? view.shown_focus_px : NaN);
  if (clear) app.clear.setView(view);
}

async function askMore(round) {
  try {
    await events.refresh();
    if (round % SLOW !== 0) return;
    const body = await get("/api/v1/cameras");
    adjust.setGrid(body.rows, body.cols);
    app.stage.overlays.setGrid(body.rows, body.cols);
    cameras.update(body);
    await app.labels.refresh();
    await showView();
    if (round % (SLOW * SLOWER) === 0 && !$("panel-recordings").hidden) await recordings.refresh();
  } catch (error) {
    if (error.status !== 503 && error.status !== 0) complain(error); // 503: nothing captured yet, 0: the next status request reports it
  }
}

async function follow() {
  for (let round = 0; ; round++) {
    if (!document.hidden) await ask(round);
    await new Promise((done) => {
      wake = done;
      setTimeout(done, STATUS_MS);
    });
  }
}

addEventListener("online", () => wake());

/** Hidden streams are closed: a browser has few connections per host, and pictures cost the service work. */
function whileVisible() {
  if (document.hidden) {
    for (const picture of [app.view, app.stage.plain, app.stage.overlays.stream]) picture?.stop();
  } else {
    for (const picture of [app.view, app.stage.plain, app.stage.overlays.stream]) picture?.start();
  }
}

/** A reloaded page adopts its previous view; a duplicated tab does not. */
const KEPT_VIEW = "sst-view";

async function start() {
  show(app.view.settings);
  const id = session(KEPT_VIEW);
  session(KEPT_VIEW, "");
  if (id) await adopt(id).catch(() => {}); // the next status request reports it
  openTab($("tab-visits"));
  await app.replay.resume();
  document.addEventListener("visibilitychange", whileVisible);
  whileVisible();
  follow();
  followAddress();
}

addEventListener("pagehide", () => session(KEPT_VIEW, app.view.shared || app.replay.open ? "" : app.view.id ?? ""));
addEventListener("pageshow", () => session(KEPT_VIEW, ""));
start();
