#!/usr/bin/env bash
# npm onvif 0.8.3 (Cam.getAudioSources): a camera without audio answers GetAudioSources of ONVIF's Media service by a response without
# elements, which the service's WSDL allows (AudioSources, minOccurs 0). The client then fails by a TypeError in its own callback in place of an empty
# list; GetOSDs with the same kind of answer is fine. So a test that calls all of its functions names a camera without audio as broken.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
command -v node >/dev/null && command -v npm >/dev/null || { echo "node and npm are not installed"; exit 2; }
npm install --silent --no-audit --no-fund onvif@0.8.3 >npm.log 2>&1 || { echo "onvif 0.8.3 cannot be installed: $(tail -n 1 npm.log)"; exit 2; }
cat >ask.js <<'J'
const http = require("http");
const { Cam } = require("onvif");
const server = http.createServer((request, response) => {
  let body = "";
  request.on("data", (data) => { body += data; });
  request.on("end", () => {
    const name = /<(Get\w+) /.exec(body)[1];
    response.end(`<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"><s:Body><t:${name}Response xmlns:t="http://www.onvif.org/ver10/media/wsdl"/></s:Body></s:Envelope>`);
  });
}).listen(0, "127.0.0.1", async () => {
  const cam = new Cam({ hostname: "127.0.0.1", port: server.address().port, autoconnect: false });
  cam.uri = { media: { path: "/media" } };
  for (const name of ["getAudioSources", "getOSDs"]) {
    const ended = await new Promise((ok) => {
      process.once("uncaughtException", (err) => ok(err.name));
      try { cam[name]((err) => ok(err ? err.constructor.name : "no error")); } catch (err) { ok(err.name); }
    });
    process.removeAllListeners("uncaughtException");
    console.log(`${name}: ${ended}`);
  }
  process.exit(0);
});
J
timeout 60 node ask.js 2>/dev/null | tee seen
printf '%s\n' 'getAudioSources: TypeError' 'getOSDs: no error' >expected
holds "an empty list of audio sources is a TypeError" cmp -s seen expected
# Seen: these two lines, Node.js 20
