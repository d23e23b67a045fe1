# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Client of sstd's API (docs/integrate/api.md): state, events, visits, pictures as arrays. Standard library alone."""
import http.client
import json
import os
import socket
import ssl
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from typing import NamedTuple

import numpy as np

from .pictures import decode_picture

_MOST_JSON = 16 << 20
_MOST_PICTURE = 64 << 20
_MOST_LINE = 1 << 20
# X509_V_ERR_ of OpenSSL.
_EXPIRED = 10
_OTHER_HOST = (62, 64)  # a name, an address


class ServiceError(OSError):
    """The service refused, does not answer, or answers something else. `status`: of HTTP; None: no answer came."""

    def __init__(self, text, status=None):
        super().__init__(text)
        self.status = status


class Picture(NamedTuple):
    """A picture of the service."""
    image: np.ndarray  # (height, width, 3) uint8
    time: float        # of its set, seconds since 1970; NaN: not known
    set: int           # number of its set; -1: not known


class _UnixConnection(http.client.HTTPConnection):
    def __init__(self, path, timeout):
        super().__init__("localhost", timeout=timeout)
        self._path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self._path)


class _UnixHandler(urllib.request.HTTPHandler):
    def __init__(self, path):
        super().__init__()
        self._path = path

    def http_open(self, req):
        return self.do_open(lambda host, timeout=None, **_: _UnixConnection(self._path, timeout), req)


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A token goes to no other address."""

    def redirect_request(self, req, fp, code, msg, headers, newurl):
        return None


def _context(cafile):
    try:
        return ssl.create_default_context(cafile=cafile)
    except ssl.SSLError:
        raise ValueError(f"{cafile} has no certificates in PEM") from None
    except OSError as e:
        raise type(e)(f"{cafile}, the file of certificates, cannot be read: {e.strerror}") from None


def _silence(why, timeout):
    """Why no answer came, without numbers of errors and lines of OpenSSL."""
    if isinstance(why, TimeoutError):
        return f"no answer within {timeout:g} s"
    if isinstance(why, ssl.SSLCertVerificationError):
        if why.verify_code in _OTHER_HOST:
            return f"its certificate is for another host ({why.verify_message.rstrip('.')}); connect by a name that is in it"
        if why.verify_code == _EXPIRED:
            return "its certificate has expired; renew it"
        return f"its certificate is not trusted ({why.verify_message}); name the file of its authority by cafile"
    return getattr(why, "strerror", None) or why


def _umask():
    """The process's umask, read without changing it where other threads make files."""
    try:
        with open("/proc/self/status", encoding="ascii", errors="replace") as f:
            return next(int(line.split()[1], 8) for line in f if line.startswith("Umask:"))
    except (OSError, StopIteration, ValueError):
        return 0o077


class Client:
    """A service.

        sst.Client("unix:/run/sst/control.sock")
        sst.Client("https://gate.example:8090", token_file="token", cafile="ca.pem")

    url         http://, https:// or unix:PATH of the socket
    token       of the service; token_file: a file with it
    timeout     seconds for connecting, and for each wait for bytes
    cafile      PEM file of the certificates that are trusted, also a self-signed one of the service; default: those of the system
    verify      False: any certificate is accepted. Only for tests: whoever is in between reads the token

    Proxies of the environment are not used, redirects are refused. All methods raise ServiceError, an OSError of one sentence.
    """

    def __init__(self, url, token=None, token_file=None, timeout=10.0, cafile=None, verify=True):
        if token_file is not None:
            try:
                with open(token_file, encoding="utf-8") as f:
                    token = f.read(4097).strip()
            except OSError as e:
                raise type(e)(f"{token_file}, the file of the token, cannot be read: {e.strerror}") from None
        if token is not None and (not token or len(token) > 4096 or not token.isascii() or not token.isprintable()):
            raise ValueError("the token is empty, or no plain text of at most 4096 characters")
        self._token, self.timeout = token, timeout
        handlers = [urllib.request.ProxyHandler({}), _NoRedirect()]
        if url.startswith("unix:"):
            handlers.append(_UnixHandler(url[5:]))
            self.url, self._base = url, "http://localhost"
        else:
            parts = urllib.parse.urlsplit(url)
            if parts.scheme not in ("http", "https") or not parts.hostname or parts.query or parts.fragment or parts.username:
                raise ValueError(f"{url} is not an address like http://127.0.0.1:8090 or unix:/run/sst/control.sock")
            if parts.scheme == "https":
                context = _context(cafile)
                if not verify:
                    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
                handlers.append(urllib.request.HTTPSHandler(context=context))
            self.url = self._base = url.rstrip("/")
        self._opener = urllib.request.build_opener(*handlers)

    def _open(self, path, query=None, body=None, accept=None):
        query = {k: v for k, v in (query or {}).items() if v is not None}
        address = self._base + path + ("?" + urllib.parse.urlencode(query) if query else "")
        request = urllib.request.Request(address, method="GET" if body is None else "POST")
        if body is not None:
            request.data = json.dumps(body).encode()
            request.add_header("Content-Type", "application/json")
        if self._token:
            request.add_unredirected_header("Authorization", "Bearer " + self._token)
        if accept:
            request.add_header("Accept", accept)
        try:
            return self._opener.open(request, timeout=self.timeout)
        except urllib.error.HTTPError as e:
            with e:
                raise ServiceError(f"{self.url}{path}: {self._sentence(e)}", e.code) from None
        except (OSError, http.client.HTTPException) as e:
            raise ServiceError(f"{self.url} does not answer: {_silence(getattr(e, 'reason', e), self.timeout)}") from None

    @staticmethod
    def _sentence(e):
        try:
            text = json.loads(e.read(65536))["error"]
        except (ValueError, KeyError, TypeError, OSError, http.client.HTTPException):
            text = ""
        text = text if isinstance(text, str) and text else f"HTTP {e.code} {e.reason}"
        return "".join(c if c.isprintable() else "?" for c in text[:500])

    def _read(self, answer, limit, path):
        try:
            with answer:
                data = answer.read(limit + 1)
        except (OSError, http.client.HTTPException) as e:
            raise ServiceError(f"{self.url}{path}: the answer ends early: {e}") from None
        if len(data) > limit:
            raise ServiceError(f"{self.url}{path}: the answer is larger than {limit} bytes")
        return data

    def _json(self, path, query=None, body=None):
        data = self._read(self._open(path, query, body), _MOST_JSON, path)
        try:
            return json.loads(data)
        except (ValueError, RecursionError):
            raise ServiceError(f"{self.url}{path}: the answer is not JSON; is this the address of sstd?") from None

    def _object(self, path, query=None, objects=None):
        """Answer that is an object, and has a list of objects under the name `objects`."""
        made = self._json(path, query)
        fits = isinstance(made, dict)
        if fits and objects:
            fits = isinstance(made.get(objects), list) and all(isinstance(one, dict) for one in made[objects])
        if not fits:
            raise ServiceError(f"{self.url}{path}: the answer has another form than sstd's; is this the address of sstd, of this version?")
        return made

    def get(self, path, **query):
        """Answer of a GET as objects of JSON."""
        return self._json(path, query)

    def post(self, path, **body):
        """Answer of a POST with these members."""
        return self._json(path, body=body)

    def status(self):
        """State of the service (docs/integrate/status.md): a dict."""
        return self._object("/api/v1/status")

    def cameras(self):
        """The grid: state, skew and drops of each camera."""
        return self._object("/api/v1/cameras", objects="cameras")

    def labels(self):
        """Classes: list of dicts with label, name, colour, share."""
        return self._object("/api/v1/labels", objects="labels")["labels"]

    def _lines(self, answer, path):
        with answer:
            while True:
                try:
                    line = answer.readline(_MOST_LINE)
                except TimeoutError:
                    raise ServiceError(f"{self.url}{path}: nothing came for {self.timeout:g} s") from None
                except (OSError, http.client.HTTPException) as e:
                    raise ServiceError(f"{self.url}{path}: the stream ends: {e}") from None
                if not line:
                    return
                if len(line) == _MOST_LINE:
                    raise ServiceError(f"{self.url}{path}: a line is larger than {_MOST_LINE} bytes")
                if line.strip():
                    try:
                        event = json.loads(line)
                    except (ValueError, RecursionError):
                        event = None
                    if not isinstance(event, dict):
                        raise ServiceError(f"{self.url}{path}: a line is no object of JSON")
                    yield event

    def events(self, after=0, limit=100000):
        """Events that the service keeps, the oldest first: a list of at most `limit` dicts with id, time, level, type, message, data."""
        path, made = "/api/v1/events", []
        while len(made) < limit:
            page = list(self._lines(self._open(path, {"after": after, "limit": min(limit - len(made), 1000)}), path))
            if not page or not all(isinstance(e.get("id"), int) and e["id"] > after for e in page[:1] + page[-1:]):
                break
            made += page
            after = page[-1]["id"]
        return made[:limit]

    def follow(self, after=None, timeout=60.0):
        """Events as they come: a generator. It ends when the service does; ServiceError after `timeout` seconds of silence (the service
        sends a sign of life every 15 s)."""
        path, usual = "/api/v1/events/stream", self.timeout
        self.timeout = max(timeout, usual)
        try:
            answer = self._open(path, {"after": after}, accept="application/x-ndjson")
        finally:
            self.timeout = usual
        return self._lines(answer, path)

    def visits(self, since=None, until=None, label=None, zone=None, reviewed=None, limit=100):
        """Visits on disk, the newest first: a list of at most `limit` dicts. since, until: times like "2026-11-21T18:00:00Z"."""
        made, before = [], None
        while len(made) < limit:
            page = self._object("/api/v1/visits", {"from": since, "to": until, "label": label, "zone": zone, "before": before,
                                                   "reviewed": None if reviewed is None else str(bool(reviewed)).lower(), "limit": min(limit - len(made), 100)},
                                objects="visits")
            made += page["visits"]
            if not page.get("more") or not page["visits"] or page["visits"][-1].get("visit") in (None, before):
                break
            before = page["visits"][-1]["visit"]
        return made

    def _picture(self, path):
        answer = self._open(path)
        headers = answer.headers
        image = decode_picture(self._read(answer, _MOST_PICTURE, path), self.url + path)
        try:
            time, number = float(headers.get("X-Timestamp", "nan")), int(headers.get("X-Sst-Set", "-1"))
        except ValueError:
            time, number = float("nan"), -1
        return Picture(np.repeat(image[..., None], 3, 2) if image.ndim == 2 else image, time, number)

    def snapshot(self, of=""):
        """The newest picture. of: "" (the main view), "labels", "disparity", a camera like "r0c5", or the id of a view."""
        of = str(of)
        camera = of[:1] == "r" and of[1:].replace("c", "", 1).isdigit()
        return self._picture("/snapshot" + (f"/camera/{of}" if camera else f"/{urllib.parse.quote(of, safe='')}" if of else ""))

    def visit_picture(self, visit, of="seen"):
        """Picture of a visit, by its name. of: "seen" (through what stood in front) or "camera"."""
        if of not in ("seen", "camera"):
            raise ValueError(f"of {of!r} is neither seen nor camera")
        return self._picture(f"/api/v1/visits/{urllib.parse.quote(str(visit), safe='')}/{of}")

    def recordings(self):
        """What is stored: a dict with recordings, snapshots, exports."""
        return self._object("/api/v1/recordings")

    def _piece(self, answer, path):
        try:
            return answer.read(1 << 20)
        except (OSError, http.client.HTTPException) as e:
            raise ServiceError(f"{self.url}{path}: the answer ends early: {_silence(e, self.timeout)}") from None

    def download(self, name, path, limit=1 << 40):
        """Fetch something that is stored (NAME.tar, NAME.mkv, NAME.r0c5.mkv, NAME.mp4 ...) into a file, whole or not at all.

        Returns its bytes; ServiceError also where it is larger than `limit`.
        """
        route, path = "/api/v1/download/" + urllib.parse.quote(name, safe=""), os.fsdecode(path)
        if os.path.isdir(path):
            raise IsADirectoryError(f"{path} is a folder; name a file to write")
        answer = self._open(route)
        total, expected = 0, answer.headers.get("Content-Length")
        with tempfile.NamedTemporaryFile(dir=os.path.dirname(os.path.abspath(path)), prefix=".sst-", delete=False) as f:
            try:
                with answer:
                    while piece := self._piece(answer, route):
                        total += len(piece)
                        if total > limit:
                            raise ServiceError(f"{self.url}{route}: it is larger than {limit} bytes")
                        f.write(piece)
                if expected and expected != str(total):
                    raise ServiceError(f"{self.url}{route}: {total} of {expected} bytes came")
                f.flush()
                os.fchmod(f.fileno(), 0o666 & ~_umask())
                os.fsync(f.fileno())
                os.replace(f.name, path)
            except BaseException:
                os.unlink(f.name)
                raise
        return total

    def __repr__(self):
        return f"<sst.Client {self.url}>"
