# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""push_server.py FOLDER CERT KEY: a push service that keeps what it is sent: FOLDER/N.json has path and headers, FOLDER/N.body the
message. The last part of the path is the answer's status; "503-201" is 503 the first time. Writes its port to FOLDER/port."""
import http.server
import json
import os
import ssl
import sys

folder, cert, key = sys.argv[1:]
seen, count = set(), 0


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_POST(self):
        global count
        body = self.rfile.read(int(self.headers["Content-Length"]))
        status = self.path.rsplit("/", 1)[1].split("-")
        again = self.path in seen
        seen.add(self.path)
        with open(f"{folder}/{count}.body", "wb") as f:
            f.write(body)
        with open(f"{folder}/new", "w") as f:
            json.dump({"path": self.path, "headers": {k.lower(): v for k, v in self.headers.items()}}, f)
        os.rename(f"{folder}/new", f"{folder}/{count}.json")
        count += 1
        self.send_response(int(status[-1] if again else status[0]))
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
context.load_cert_chain(cert, key)
server.socket = context.wrap_socket(server.socket, server_side=True)
with open(f"{folder}/port.new", "w") as f:
    f.write(str(server.server_address[1]))
os.rename(f"{folder}/port.new", f"{folder}/port")
server.serve_forever()
