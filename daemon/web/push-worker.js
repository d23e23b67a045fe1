// Service worker: notifications of visits when no page is open. It is served at the root, so that its scope is the page.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const PICTURE_MOST = 1 << 20;

/** The picture is fetched here, with the session of this browser; without a session the text is shown alone. */
async function pictureOf(address) {
  if (!address) return undefined;
  try {
    const response = await fetch(address, { credentials: "same-origin", redirect: "error" });
    const blob = response.ok ? await response.blob() : null;
    if (!blob || blob.size > PICTURE_MOST || !blob.type.startsWith("image/")) return undefined;
    let text = "";
    for (const byte of new Uint8Array(await blob.arrayBuffer())) text += String.fromCharCode(byte);
    return `data:${blob.type};base64,${btoa(text)}`;
  } catch {
    return undefined; // the service is not reachable from here
  }
}

async function show({ title, body, tag, url, picture, time }) {
  const at = Date.parse(time);
  await self.registration.showNotification(title, { body, tag, icon: "/web/icon.svg", image: await pictureOf(picture),
    timestamp: Number.isNaN(at) ? undefined : at, data: { url } });
}

/** A page that is open already shows the visit; else one opens. */
async function open(url) {
  const pages = await self.clients.matchAll({ type: "window", includeUncontrolled: true });
  const page = pages.find((one) => new URL(one.url).pathname === "/");
  if (!page) {
    await self.clients.openWindow(url);
    return;
  }
  await page.focus();
  page.postMessage({ open: url });
}

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("push", (event) => event.waitUntil(show(event.data.json())));
self.addEventListener("notificationclick", (event) => {
  event.notification.close();
  event.waitUntil(open(event.notification.data.url));
});
