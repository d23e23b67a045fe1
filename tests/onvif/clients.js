// Foreign clients of npm on sst-onvif: clients.js PORT USER PASSWORD ADDRESS. Prints a line for each call; status 1 where one of them fails.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
"use strict";
const [port, username, password, hostname] = [+process.argv[2], process.argv[3], process.argv[4], process.argv[5]];
let failed = 0;
const say = (ok, ...words) => { console.log(ok ? "ok  " : "FAIL", ...words); failed += !ok; };
const within = (ms, what, promise) => Promise.race([promise, new Promise((_, no) => setTimeout(() => no(new Error(`${what}: nothing within ${ms} ms`)), ms))]);
const short = (v) => JSON.stringify(v).slice(0, 160);

// Calls that only read; getAudioSources is none of them: it fails on an empty list (findings/npm-onvif-empty-list.sh).
const CALLS = ["getDeviceInformation", "getHostname", "getScopes", "getCapabilities", "getServices", "getNetworkInterfaces", "getUsers", "getNTP", "getDNS",
  "getSystemDateAndTime", "getProfiles", "getVideoSources", "getVideoSourceConfigurations", "getVideoEncoderConfigurations",
  "getVideoEncoderConfigurationOptions", "getEventProperties", "getEventServiceCapabilities", "getSnapshotUri", "getOSDs", "getNetworkDefaultGateway"];

async function onvif() {
  const { Cam, Discovery } = require("onvif");
  // Not resolved: the client would ask the cameras as a user "undefined".
  const found = await within(20000, "discovery", new Promise((ok) => Discovery.probe({ timeout: 3000, resolve: false }, (err, cams) => ok(cams || []))));
  const places = found.map((c) => c.probeMatches.probeMatch.XAddrs);
  say(places.includes(`http://${hostname}:${port}/onvif/device_service`), "onvif: discovery", places.join(" "));
  const cam = await within(30000, "connect", new Promise((ok, no) => {
    const c = new Cam({ hostname, port, username, password, timeout: 20000 }, (err) => err ? no(err) : ok(c));
  }));
  say(cam.defaultProfile.videoEncoderConfiguration, "onvif: connect", short(cam.activeSource));
  for (const name of CALLS) {
    try {
      say(true, "onvif:", name, short(await within(20000, name, new Promise((ok, no) => cam[name]((err, data) => err ? no(err) : ok(data))))));
    } catch (err) {
      say(false, "onvif:", name, err.message);
    }
  }
  for (const protocol of ["RTSP", "UDP"]) {
    const { uri } = await new Promise((ok, no) => cam.getStreamUri({ protocol }, (err, data) => err ? no(err) : ok(data)));
    say(uri.startsWith("rtsp://"), "onvif: getStreamUri", protocol, uri);
  }
  const topics = await within(20000, "events", new Promise((ok) => {
    const seen = [];
    cam.on("event", (m) => { seen.push(m.topic._); if (seen.length === 4) ok(seen); });
  }));
  say(topics.includes("tns1:VideoSource/MotionAlarm"), "onvif: events", topics.join(" "));
  cam.removeAllListeners("event");
}

async function nodeOnvif() {
  const { OnvifDevice } = require("node-onvif");
  const device = new OnvifDevice({ xaddr: `http://${hostname}:${port}/onvif/device_service`, user: username, pass: password });
  say((await device.init()).Manufacturer === "sst", "node-onvif: init", device.getUdpStreamUrl());
  const picture = await device.fetchSnapshot();
  say(picture.headers["content-type"] === "image/jpeg", "node-onvif: fetchSnapshot", picture.body.length, "bytes");
}

async function onvifNvt() {
  const camera = await require("onvif-nvt").connect(hostname, port, username, password);
  say(camera.deviceInformation.Manufacturer === "sst", "onvif-nvt: connect", short(camera.deviceInformation));
}

(async () => {
  const log = console.log;
  for (const client of [onvif, nodeOnvif, onvifNvt]) {
    try {
      console.error = () => {};
      await client();
    } catch (err) {
      console.log = log;
      say(false, client.name, err.message || err);
    }
  }
  process.exit(failed ? 1 : 0);
})();
