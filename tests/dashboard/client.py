"""A client of plumb-dashboard, by nothing but Python's standard library: HTTP, WebSocket (RFC 6455) and Foxglove's protocol."""
import base64
import hashlib
import json
import os
import socket
import struct
import time

PROTOCOL = "foxglove.websocket.v1"


class Refused(Exception):
    """The server has answered a wish for a WebSocket with something else: the answer's first line."""


def http(address, request, timeout=20):
    """What the server answers to these bytes, until it closes or its answer is complete."""
    with socket.create_connection(address, timeout) as connection:
        connection.sendall(request)
        answer = b""
        while True:
            head, _, body = answer.partition(b"\r\n\r\n")
            length = [line.split(b":")[1] for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
            if length and len(body) >= int(length[0]):
                return answer
            try:
                part = connection.recv(65536)
            except ConnectionResetError:
                return answer
            if not part:
                return answer
            answer += part


def get(address, path, host=None, more=""):
    host = host or f"{address[0]}:{address[1]}"
    return http(address, f"GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n".encode())


def body(answer):
    return answer.partition(b"\r\n\r\n")[2].decode()


class WebSocket:
    def __init__(self, address, origin=None, host=None, protocol=PROTOCOL, more="", receive_buffer=None, source=""):
        self.socket = socket.socket()
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(20)
        self.socket.bind((source, 0))
        self.socket.connect(address)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [f"Host: {host or f'{address[0]}:{address[1]}'}", "Upgrade: websocket", "Connection: Upgrade",
                 f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: {protocol}"]
        if origin:
            lines.append(f"Origin: {origin}")
        self.socket.sendall(("GET / HTTP/1.1\r\n" + "\r\n".join(lines) + f"\r\n{more}\r\n").encode())
        self.rest = b""
        while b"\r\n\r\n" not in self.rest:
            part = self.socket.recv(4096)
            if not part:
                raise Refused("closed")
            self.rest += part
        head, _, self.rest = self.rest.partition(b"\r\n\r\n")
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise Refused(head.split(b"\r\n")[0].decode())
        accept = base64.b64encode(hashlib.sha1((key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest())
        assert accept in head, head

    def close(self):
        self.socket.close()

    def send_frame(self, opcode, payload, final=True, masked=True):
        head = bytes([(0x80 if final else 0) | opcode])
        mask = os.urandom(4) if masked else b""
        flag = 0x80 if masked else 0
        if len(payload) < 126:
            head += bytes([flag | len(payload)])
        elif len(payload) < 65536:
            head += bytes([flag | 126]) + struct.pack(">H", len(payload))
        else:
            head += bytes([flag | 127]) + struct.pack(">Q", len(payload))
        if masked:
            repeated = (mask * (len(payload) // 4 + 1))[:len(payload)]
            payload = (int.from_bytes(payload, "big") ^ int.from_bytes(repeated, "big")).to_bytes(len(payload), "big")
        self.socket.sendall(head + mask + payload)

    def send(self, message):
        if isinstance(message, bytes):
            self.send_frame(2, message)
        else:
            self.send_frame(1, (message if isinstance(message, str) else json.dumps(message)).encode())

    def _take(self, size):
        while len(self.rest) < size:
            part = self.socket.recv(1 << 16)
            if not part:
                raise ConnectionError("closed")
            self.rest += part
        taken, self.rest = self.rest[:size], self.rest[size:]
        return taken

    def receive(self):
        """The next message: a dict of a text, or the bytes of a binary one."""
        while True:
            first, second = self._take(2)
            size = second & 0x7F
            if size == 126:
                size, = struct.unpack(">H", self._take(2))
            elif size == 127:
                size, = struct.unpack(">Q", self._take(8))
            payload = self._take(size)
            opcode = first & 0xF
            assert first & 0x80, "the server fragments nothing"
            if opcode == 1:
                return json.loads(payload)
            if opcode == 2:
                return payload
            if opcode == 9:
                self.send_frame(10, payload)
            if opcode == 8:
                raise ConnectionError(f"closed by the server: {payload!r}")


class Page(WebSocket):
    """What the page does: knows topics and services by name."""

    def __init__(self, address, **options):
        super().__init__(address, **options)
        self.info = self.receive()
        assert self.info["op"] == "serverInfo", self.info
        self.topics, self.services = {}, {}
        self.names = {}  # of subscriptions
        self.answers = {}  # of calls
        self.statuses = []
        self.time = None  # [ns] of the run, as we were told it last
        self.next = 1
        while not self.services:
            self.hear()

    def _text(self, message):
        if message["op"] == "advertise":
            self.topics.update({topic["topic"]: topic for topic in message["channels"]})
        elif message["op"] == "advertiseServices":
            self.services.update({service["name"]: service for service in message["services"]})
        elif message["op"] in ("status", "serviceCallFailure"):
            self.statuses.append(message)
        else:
            raise AssertionError(message)

    def subscribe(self, *names):
        wishes = []
        for name in names:
            self.names[self.next] = name
            wishes.append({"id": self.next, "channelId": self.topics[name]["id"]})
            self.next += 1
        self.send({"op": "subscribe", "subscriptions": wishes})

    def hear(self):
        """The next message of a topic: its name, its time [ns], what it says. None: it was something else."""
        message = self.receive()
        if isinstance(message, dict):
            return self._text(message)
        if message[0] == 1:
            subscription, nanoseconds = struct.unpack("<IQ", message[1:13])
            return self.names[subscription], nanoseconds, json.loads(message[13:])
        if message[0] == 2:
            self.time, = struct.unpack("<Q", message[1:])
            return None
        assert message[0] == 3, message[:20]
        service, call, size = struct.unpack("<III", message[1:13])
        assert message[13:13 + size] == b"json"
        self.answers[call] = json.loads(message[13 + size:])
        return None

    def until(self, so, seconds=60):
        """All messages of topics until one, or what has come so far, is so."""
        heard, end = [], time.monotonic() + seconds
        while time.monotonic() < end:
            one = self.hear()
            if one:
                heard.append(one)
            if so(one):
                return heard
        raise AssertionError(f"not within {seconds} s; heard {len(heard)} messages, {[one[0] for one in heard[-5:]]}")

    def ask(self, name):
        """Calls a service. @return the call's number."""
        self.next += 1
        self.send(struct.pack("<BIII", 2, self.services[name]["id"], self.next, 4) + b"json{}")
        return self.next

    def call(self, name):
        call = self.ask(name)
        self.until(lambda _: call in self.answers)
        return self.answers[call]
