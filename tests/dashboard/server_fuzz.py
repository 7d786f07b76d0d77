#!/usr/bin/python3
"""server_fuzz.py PROGRAMS ROBOTS: what no client would say to a running plumb-dashboard, over real sockets: requests and frames
mutated, cut, run together and trickled, random bytes; the same ones each time. After each batch somebody who looks on is shown
the right numbers, and in the end everything that was said is counted."""
import contextlib
import pathlib
import random
import socket
import struct
import sys
import tempfile
import time
import unittest

import client
from server_test import LCM, PATIENCE, Dashboard, state

BATCHES, BATCH = 20, 40
ANSWERS = (b"200", b"303", b"400", b"403", b"404", b"405")
WORDS = (b"\r\n", b"\r\n\r\n", b"\0", b"\xff" * 9, b"GET ", b"HEAD /", b"HTTP/1.1", b"Host: localhost", b"Content-Length: 18446744073709551615",
         b"Transfer-Encoding: chunked", b"Upgrade: websocket", b"Connection: close", b"/../", b"%2e%2e%2f", b"?token=", b"{", b"[" * 99,
         b'"subscriptions":', b'"op":', b"-1", b"1e999", b"\x82\x7f", b"\x89\x7e\xff\xff", b"\x88\x80")


def mutated(chance, parts):
    """One of these, or several, with a few changes."""
    found = bytearray(b"".join(chance.choices(parts, k=chance.choice((1, 1, 1, 2, 3)))))
    for _ in range(chance.choice((0, 1, 1, 2, 4, 16))):
        at = chance.randrange(len(found) + 1)
        what = chance.randrange(5)
        if what == 0:
            found[at:at + 1] = bytes([chance.randrange(256)])
        elif what == 1:
            del found[at:at + chance.choice((1, 2, 8, 64))]
        elif what == 2:
            found[at:at] = chance.choice(WORDS)
        elif what == 3:
            found[at:at] = found[chance.randrange(len(found) + 1):][:chance.choice((1, 16, 256))]
        else:
            del found[at:]
    return bytes(found)


def trickle(chance, connection, content):
    """In one piece, or in some, which come one by one."""
    cuts = sorted(chance.randrange(len(content) + 1) for _ in range(chance.choice((0, 0, 1, 8))))
    for begin, end in zip([0, *cuts], [*cuts, len(content)]):
        connection.sendall(content[begin:end])
        time.sleep(0.001 if cuts else 0)


def finish(connection):
    """What comes until the server closes, which it does when nothing more can come."""
    with contextlib.suppress(OSError):  # it has closed before
        connection.shutdown(socket.SHUT_WR)
    answer = b""
    while part := connection.recv(1 << 16):
        answer += part
    return answer


def frame(opcode, payload, mask=b"\0\0\0\0", final=True):
    """Of fewer than 65536 bytes, as clients send them."""
    length = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
    return bytes([(0x80 if final else 0) | opcode]) + length + mask + bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))


class Fuzzed(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        page = pathlib.Path(folder.name) / "page"
        page.mkdir()
        (page / "index.html").write_text("<!doctype html><title>page</title>")
        (pathlib.Path(folder.name) / "secret.js").write_text("secret")
        self.dashboard = Dashboard(self, page=page)
        self.watcher = client.Page(self.dashboard.address)
        self.addCleanup(self.watcher.close)
        self.watcher.subscribe("ROBOT_STATE", "PLUMB_CHANNELS")
        self.watcher.until(lambda one: one and one[0] == "PLUMB_CHANNELS")

    def batches(self, connect):
        """Calls it for each connection, and looks after each batch whether what is shown is right."""
        chance = random.Random(1)
        for sequence in range(BATCHES):
            for _ in range(BATCH):
                with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # it may close before all has been said
                    connect(chance)
            LCM.say("ROBOT_STATE", state(sequence, sequence / 8))
            heard = self.watcher.until(lambda one: one and one[0] == "ROBOT_STATE", PATIENCE)[-1]
            self.assertEqual((heard[1], heard[2]["sequence"], heard[2]["q"], heard[2]["v"]), (1000 * state(sequence).utime, sequence, [sequence / 8], [0.5]))
        table = self.watcher.until(lambda one: one and one[0] == "PLUMB_CHANNELS" and any(
            row["channel"] == "ROBOT_STATE" and row["count"] == BATCHES for row in one[2]["channels"]))[-1]
        self.assertEqual(sum(row["undecodable"] for row in table[2]["channels"]), 0)
        self.assertIn(b"<title>page</title>", client.get(self.dashboard.address, "/"))
        self.assertIn("no driver answers", self.watcher.call("emergency_stop")["text"])
        self.dashboard.works(self)
        self.dashboard.require_memory_below(self, 100)

    def test_requests(self):
        host = f"Host: 127.0.0.1:{self.dashboard.address[1]}\r\n".encode()
        requests = [b"GET / HTTP/1.1\r\n" + host + b"\r\n", b"HEAD /robot.json HTTP/1.1\r\n" + host + b"Accept-Encoding: gzip;q=0.5\r\n\r\n",
                    b"GET /../secret.js HTTP/1.1\r\n" + host + b"Cookie: plumb_token=1; a\r\n\r\n", b"GET /?token=1 HTTP/1.1\r\n" + host + b"\r\n",
                    b"POST / HTTP/1.1\r\n" + host + b"Content-Length: 3\r\n\r\nabc", b"\x16\x03\x01\x02\x00\x01\x00"]

        def connect(chance):
            request = chance.randbytes(chance.randrange(1, 3000)) if chance.random() < 0.1 else mutated(chance, requests)
            with socket.create_connection(self.dashboard.address, PATIENCE) as connection:
                trickle(chance, connection, request)
                answer = finish(connection)
            if answer:
                self.assertIn(answer[:12][9:], ANSWERS, request)
                self.assertIn(b"default-src 'self'", answer, request)
                self.assertNotIn(b"secret", answer, request)

        self.batches(connect)

    def test_frames(self):
        topic, gateway = (self.watcher.topics[name]["id"] for name in ("ROBOT_STATE", "PLUMB_GATEWAY"))
        subscribe = b'{"op":"subscribe","subscriptions":[{"id":1,"channelId":%d},{"id":2,"channelId":%d}]}' % (topic, gateway)
        call = struct.pack("<BIII", 2, self.watcher.services["emergency_stop"]["id"], 7, 4) + b"json{}"
        frames = [frame(1, subscribe), frame(1, subscribe, b"mask"), frame(1, b'{"op":"unsubscribe","subscriptionIds":[1]}'), frame(2, call), frame(9, b"ping"),
                  frame(1, subscribe[:9], final=False) + frame(0, subscribe[9:]), frame(8, struct.pack(">H", 1000)), frame(2, b"\x01" + bytes(200))]

        def connect(chance):
            page = client.WebSocket(self.dashboard.address)
            said = chance.randbytes(chance.randrange(1, 3000)) if chance.random() < 0.1 else mutated(chance, frames)
            if chance.random() < 0.3:  # a frame that is right, of what is not
                said = frame(chance.choice((1, 2)), mutated(chance, [subscribe, call]))
            with contextlib.closing(page):
                trickle(chance, page.socket, said)
                finish(page.socket)

        self.batches(connect)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
