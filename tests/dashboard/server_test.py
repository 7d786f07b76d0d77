#!/usr/bin/python3
"""server_test.py PROGRAMS ROBOTS: plumb-dashboard as its clients know it, with hostile ones among them, and with a driver.

A client is Python's standard library (client.py). What is said on LCM is what lcm-gen's Python encodes, sent as LCM sends it.
"""
import contextlib
import gzip
import json
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import client
import lcm_sender

PROGRAMS, ROBOTS = (pathlib.Path(argument) for argument in sys.argv[1:3])
sys.path.insert(0, str(PROGRAMS.parent / "lcmtypes" / "python"))
import plumb  # noqa: E402

LCM = lcm_sender.Sender()
PATIENCE = 60  # [s]; who is as late as that hangs


def state(sequence, q=0.25):
    message = plumb.robot_state_t()
    message.utime = 1_700_000_000_000_000 + 2000 * sequence
    message.sequence, message.num_positions, message.num_velocities, message.valid = sequence, 1, 1, True
    message.q, message.v, message.q_sd, message.v_sd, message.effort = [q], [0.5], [0.01], [0.1], [0.0]
    return message


class Process:
    """A program of ours, until the test ends."""

    def __init__(self, test, name, *arguments, environment={}):
        self.log = tempfile.TemporaryFile(mode="w+")
        command = [PROGRAMS / name, ROBOTS / "pendulum", "--lcm-url", LCM.url, "--parent", str(os.getpid()), *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log, text=True,
                                        env=os.environ | environment)
        test.addCleanup(self.stop)

    def stop(self):
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait(PATIENCE)
        self.process.stdout.close()
        self.log.close()


class Dashboard(Process):
    def __init__(self, test, *arguments, page="/nowhere", port=0, environment={}):
        super().__init__(test, "plumb-dashboard", "--address", f"127.0.0.1:{port}", "--page", page, *arguments, environment=environment)
        self.url = self.process.stdout.readline().split()[1]
        self.address = ("127.0.0.1", int(re.search(r":(\d+)/", self.url)[1]))

    def works(self, test):
        """Whoever comes now is served: a file, and a conversation."""
        test.assertIn(b"200 OK", client.get(self.address, "/robot.json"))
        with contextlib.closing(client.Page(self.address)) as page:
            test.assertIn("ROBOT_STATE", page.topics)
        test.assertIsNone(self.process.poll())

    def require_memory_below(self, test, limit):
        """@param limit [MB] of the most memory so far. Not under a sanitizer, whose own memory counts."""
        process = pathlib.Path(f"/proc/{self.process.pid}")
        if re.search(r"/lib[at]san\.so", (process / "maps").read_text()):
            return
        peak = int(re.search(r"VmHWM:\s+(\d+)", (process / "status").read_text())[1]) / 1024
        test.assertLess(peak, limit)


class Served(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.page = pathlib.Path(self.folder.name) / "page"
        self.page.mkdir()
        (self.page / "index.html").write_text("<!doctype html><title>page</title>")
        (self.page / "page.js").write_text("'use strict';")
        (pathlib.Path(self.folder.name) / "secret.js").write_text("secret")

    def test_the_page_is_served_with_what_keeps_others_out(self):
        dashboard = Dashboard(self, page=self.page)
        answer = client.get(dashboard.address, "/?anything")
        self.assertIn(b"<title>page</title>", answer)
        self.assertIn(b"default-src 'self'", answer)
        self.assertIn(b"X-Content-Type-Options: nosniff", answer)
        self.assertIn(b"text/javascript", client.get(dashboard.address, "/page.js"))
        robot = json.loads(client.body(client.get(dashboard.address, "/robot.json")))
        self.assertEqual(robot["name"], "pendulum")
        self.assertTrue(robot["may_control"])
        two = "GET /page.js HTTP/1.1\r\nHost: localhost\r\n\r\n" * 2
        with socket.create_connection(dashboard.address, PATIENCE) as connection:  # one after the other on one connection
            connection.sendall(two.encode())
            answer = b""
            while answer.count(b"'use strict';") < 2:
                answer += connection.recv(4096) or self.fail(answer)

    def test_nothing_else_on_the_disk_is_served(self):
        dashboard = Dashboard(self, page=self.page)
        for path in ("/../secret.js", "/%2e%2e/secret.js", "/..%2fsecret.js", "//etc/passwd", "/etc/passwd", "/.", "/..", "/page.js/",
                     "/page.js%00.html", "/\\..\\secret.js", "http://evil/page.js", "*", "/" + "a" * 5000):
            self.assertIn(b" 404 ", client.get(dashboard.address, path), path)
        dashboard.works(self)

    def test_a_name_or_a_page_from_elsewhere_is_turned_away(self):
        dashboard = Dashboard(self)
        for host in ("evil.example", "evil.example:8765", "127.0.0.1.evil.example", ""):
            self.assertIn(b" 403 ", client.get(dashboard.address, "/robot.json", host=host or " "), host)
            with self.assertRaises(client.Refused):
                client.WebSocket(dashboard.address, host=host or " ")
        self.assertIn(b" 403 ", client.http(dashboard.address, b"GET / HTTP/1.0\r\n\r\n"))
        for origin in ("http://evil.example", "null", f"http://127.0.0.1:{dashboard.address[1] + 1}"):
            with self.assertRaisesRegex(client.Refused, "403"):
                client.WebSocket(dashboard.address, origin=origin)
        client.Page(dashboard.address, origin=f"http://127.0.0.1:{dashboard.address[1]}").close()
        with self.assertRaisesRegex(client.Refused, "400"):
            client.WebSocket(dashboard.address, protocol="chat")
        other = Dashboard(self, "--origin", "https://app.foxglove.dev", "--host", "robot.lab")
        client.Page(other.address, origin="https://app.foxglove.dev").close()
        client.Page(other.address, origin="http://robot.lab:1", host="robot.lab:1").close()

    def test_with_a_key_arming_takes_the_token_and_stopping_does_not(self):
        key = pathlib.Path(self.folder.name) / "key"
        subprocess.run([PROGRAMS / "plumb", "key", key], check=True, capture_output=True)
        dashboard = Dashboard(self, "--key", key)
        token = re.search(r"\?token=(\w{32})$", dashboard.url)[1]
        robot = json.loads(client.body(client.get(dashboard.address, "/robot.json")))
        self.assertFalse(robot["may_control"])
        self.assertIn("token", robot["why_not"])
        self.assertIn(b" 403 ", client.get(dashboard.address, "/?token=" + "0" * 32))
        answer = client.get(dashboard.address, f"/?token={token}")
        self.assertIn(b" 303 ", answer)
        cookie = re.search(rb"Set-Cookie: ([^;]+); HttpOnly; SameSite=Strict", answer)[1].decode()
        # Browsers keep cookies by host: those of two dashboards on one machine have two names.
        with_port = client.get(dashboard.address, f"/?token={token}", host=f"localhost:{dashboard.address[1]}")
        self.assertIn(f"Set-Cookie: plumb_token{dashboard.address[1]}={token};".encode(), with_port)
        more = f"Cookie: {cookie}\r\n"
        self.assertTrue(json.loads(client.body(client.get(dashboard.address, "/robot.json", more=more)))["may_control"])
        page = client.Page(dashboard.address)
        self.assertIn("token", page.call("arm")["text"])
        self.assertIn("no driver answers", page.call("emergency_stop")["text"])
        self.assertIn("no driver answers", client.Page(dashboard.address, more=more).call("arm")["text"])

    def test_requests_that_are_none_are_answered_or_closed(self):
        dashboard = Dashboard(self)
        for request in (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"\0" * 20000, b"GET\r\n\r\n", b"G" * 100000,
                        b"GET / HTTP/9.9\r\n\r\n", b"GET / HTTP/1.1\r\nHost\r\n\r\n",
                        b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 20000 + b"\r\n",
                        b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n",
                        b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFF\r\n",
                        b"DELETE / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"):
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                answer = client.http(dashboard.address, request)
                self.assertRegex(answer[:12], rb"^$|HTTP/1\.1 4\d\d", request[:60])
        dashboard.works(self)

    def test_frames_that_are_none_end_their_own_connection(self):
        dashboard = Dashboard(self)
        watcher = client.Page(dashboard.address)

        def hostile(act):
            page = client.Page(dashboard.address)
            with contextlib.suppress(ConnectionError, BrokenPipeError):
                act(page)
                while True:
                    page.receive()
            page.close()

        hostile(lambda page: page.send_frame(1, b"{}", masked=False))
        hostile(lambda page: page.send_frame(3, b"reserved"))
        hostile(lambda page: page.send_frame(1, b"x" * (65 << 10)))
        hostile(lambda page: page.socket.sendall(b"\x82\xff" + struct.pack(">Q", 1 << 62) + b"mask"))
        hostile(lambda page: page.socket.sendall(b"\xff" * 5000))
        hostile(lambda page: page.send_frame(1, b"\xff\xfe not UTF-8"))
        hostile(lambda page: page.send_frame(9, b"p" * 200))
        hostile(lambda page: [page.send_frame(1 if i == 0 else 0, b"x" * 1000, final=False) for i in range(100)])
        fragmented = client.Page(dashboard.address)  # in as many parts as there are bytes: fine
        text = json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": fragmented.topics["PLUMB_GATEWAY"]["id"]}]}).encode()
        for i, byte in enumerate(text):
            fragmented.send_frame(1 if i == 0 else 0, bytes([byte]), final=i == len(text) - 1)
        fragmented.names[1] = "PLUMB_GATEWAY"
        fragmented.until(lambda one: one and one[0] == "PLUMB_GATEWAY")
        for wrong in ("{", "[" * 60000, '{"op":"advertise"}', '{"op":"subscribe","subscriptions":[{"id":1,"channelId":77777}]}'):
            fragmented.send(wrong)
            fragmented.until(lambda _: fragmented.statuses)
            self.assertEqual(fragmented.statuses.pop()["op"], "status")
        self.assertIn("no driver", watcher.call("emergency_stop")["text"])
        dashboard.works(self)

    def test_a_thousand_connections_that_say_nothing_keep_nobody_out(self):
        dashboard = Dashboard(self)
        connections = []
        for i in range(1000):
            connection = socket.create_connection(dashboard.address, PATIENCE)
            if i % 2:
                connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX: ")  # and never ends
            connections.append(connection)
        dashboard.works(self)
        for connection in connections:
            with contextlib.suppress(OSError):
                connection.sendall(b"a")
        dashboard.works(self)
        for connection in connections:
            connection.close()
        dashboard.works(self)
        dashboard.require_memory_below(self, 100)

    def test_who_does_not_end_a_request_is_not_waited_for(self):
        dashboard = Dashboard(self)
        with socket.create_connection(dashboard.address, PATIENCE) as slow:
            slow.sendall(b"GET / HTTP/1.1\r\nHost: local")
            begun, heard = time.monotonic(), None
            while heard is None:
                try:
                    heard = slow.recv(100)  # closed, ten seconds from the first byte on, however it trickles
                except TimeoutError:
                    self.fail("it is still waited for")
            self.assertEqual(heard, b"")
            self.assertLess(time.monotonic() - begun, PATIENCE)

    def test_nobody_takes_all_places_from_whoever_wants_to_stop_the_robot(self):
        dashboard = Dashboard(self)
        other = client.Page(dashboard.address, source="127.0.0.2")
        pages = [client.Page(dashboard.address) for _ in range(63)]
        last = client.Page(dashboard.address)  # one more than there is room for
        with self.assertRaises(ConnectionError):  # the oldest of the address that has most
            while True:
                pages[0].receive()
        for page in (other, last, pages[1]):
            self.assertIn("no driver answers", page.call("emergency_stop")["text"])
        for page in pages:
            page.close()
        dashboard.works(self)

    def test_who_is_closed_while_what_he_said_is_read_is_forgotten(self):
        dashboard = Dashboard(self, environment={"MALLOC_PERTURB_": "165"})  # what is freed is overwritten
        pages = []

        def speak():
            page = client.Page(dashboard.address)
            pages.append(page)
            topic = page.topics["PLUMB_GATEWAY"]["id"]
            with contextlib.suppress(OSError):
                while True:
                    for _ in range(10):
                        page.send({"op": "unsubscribe", "subscriptionIds": [1]})
                        page.send({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": topic}]})
                    time.sleep(0.003)
        speakers = [threading.Thread(target=speak) for _ in range(100)]
        for speaker in speakers:  # from the 65th on each takes an earlier one's place
            speaker.start()
            time.sleep(0.02)
        watcher = client.Page(dashboard.address)
        watcher.subscribe("PLUMB_GATEWAY")
        for _ in range(2):
            watcher.until(lambda one: one and one[0] == "PLUMB_GATEWAY")
        dashboard.works(self)
        for page in pages:
            with contextlib.suppress(OSError):
                page.socket.shutdown(socket.SHUT_RDWR)
        for speaker in speakers:
            speaker.join()

    def test_the_page_is_compressed_for_whoever_takes_it(self):
        (self.page / "page.js.gz").write_bytes(gzip.compress(b"'compressed';"))
        dashboard = Dashboard(self, page=self.page)
        head, _, content = client.get(dashboard.address, "/page.js", more="Accept-Encoding: deflate, gzip;q=1.0, br\r\n").partition(b"\r\n\r\n")
        self.assertIn(b"Content-Encoding: gzip", head)
        self.assertIn(b"text/javascript", head)
        self.assertEqual(gzip.decompress(content), b"'compressed';")
        for more in ("", "Accept-Encoding: identity\r\n"):
            head, _, content = client.get(dashboard.address, "/page.js", more=more).partition(b"\r\n\r\n")
            self.assertNotIn(b"Content-Encoding", head)
            self.assertEqual(content, b"'use strict';")


class Heard(unittest.TestCase):
    """What is said on LCM."""

    def listen(self, dashboard, *topics, **options):
        """A page, when it hears LCM: what is said before that is nobody's fault."""
        page = client.Page(dashboard.address, **options)
        page.subscribe(*topics)
        return page

    def test_every_message_of_500_a_second_comes_to_three_browsers_and_is_counted(self):
        dashboard, lcm = Dashboard(self), LCM
        pages = [self.listen(dashboard, "ROBOT_STATE", "PLUMB_CHANNELS") for _ in range(3)]
        for page in pages:  # it has dealt with the subscriptions
            page.until(lambda one: one and one[0] == "PLUMB_CHANNELS")

        many = 1500

        def say():  # 520 a second: a machine that is kept from it catches up
            messages = [state(sequence, sequence / 8).encode() for sequence in range(many)]
            begun = time.monotonic()
            for i, message in enumerate(messages):
                time.sleep(max(0, begun + i / 520 - time.monotonic()))
                lcm.say("ROBOT_STATE", message)

        speaker = threading.Thread(target=say)
        speaker.start()
        for page in pages:
            counts = []

            def counted(one):
                if one and one[0] == "PLUMB_CHANNELS":
                    counts.extend(row["count"] for row in one[2]["channels"] if row["channel"] == "ROBOT_STATE")
                return counts and counts[-1] == many

            states = [one for one in page.until(counted) if one[0] == "ROBOT_STATE"]
            self.assertEqual([one[2]["sequence"] for one in states], list(range(many)))
            self.assertTrue(all(one[2]["q"] == [one[2]["sequence"] / 8] for one in states))
            self.assertTrue(all(one[1] == 1000 * one[2]["utime"] for one in states))
        speaker.join()

    def test_one_that_does_not_read_harms_nobody(self):
        dashboard, lcm = Dashboard(self), LCM
        stalled = self.listen(dashboard, "ROBOT_STATE", "PLUMB_SCENE", receive_buffer=4096)
        reader = self.listen(dashboard, "ROBOT_STATE", "PLUMB_GATEWAY")
        reader.until(lambda one: one and one[0] == "PLUMB_GATEWAY")
        many = 40000

        def say():
            for sequence in range(many):
                lcm.say("ROBOT_STATE", state(sequence))
                if sequence % 20 == 0:
                    time.sleep(0.004)

        speaker = threading.Thread(target=say)
        speaker.start()
        dropped, sequences = [0], []

        def done(one):
            if one and one[0] == "ROBOT_STATE":
                sequences.append(one[2]["sequence"])
            if one and one[0] == "PLUMB_GATEWAY":
                dropped.append(one[2]["dropped"])
            return dropped[-1] > 0 and sequences and sequences[-1] == many - 1

        reader.until(done, 2 * PATIENCE)
        speaker.join()
        self.assertEqual(sequences, list(range(many)))
        self.assertIn("no driver", reader.call("emergency_stop")["text"])
        dashboard.require_memory_below(self, 120)
        last = 0
        while last < many - 1:  # it goes on with the newest
            one = stalled.hear()
            if one and one[0] == "ROBOT_STATE":
                self.assertTrue(one[2]["sequence"] >= last)
                last = one[2]["sequence"]

    def test_who_asks_and_never_listens_is_sent_away(self):
        dashboard = Dashboard(self)
        page = client.Page(dashboard.address, receive_buffer=4096)
        with self.assertRaises(ConnectionError):
            for _ in range(200000):
                page.send("{")
        dashboard.works(self)
        dashboard.require_memory_below(self, 100)

    def test_who_comes_late_sees_what_was(self):
        dashboard, lcm = Dashboard(self), LCM
        early = self.listen(dashboard, "TRAINING_STATUS", "PARAMETER_DISTRIBUTION", "PLUMB_CHANNELS")
        early.until(lambda one: one and one[0] == "PLUMB_CHANNELS")
        for update in range(1, 31):
            message = plumb.training_status_t()
            message.utime, message.iteration, message.update, message.mean_return = update, 1, update, float(-update)
            lcm.say("TRAINING_STATUS", message)
            lcm.say("TRAINING_STATUS", message)
        early.until(lambda one: one and one[0] == "TRAINING_STATUS" and one[2]["update"] == 30)
        late = self.listen(dashboard, "TRAINING_STATUS")
        heard = late.until(lambda one: one and one[2]["update"] == 30)
        self.assertEqual([one[2]["mean_return"] for one in heard], [-float(update) for update in range(1, 31)])

    def test_a_server_that_restarts_is_found_again(self):
        dashboard = Dashboard(self)
        page = client.Page(dashboard.address)
        dashboard.process.terminate()
        self.assertEqual(dashboard.process.wait(PATIENCE), 0)
        with self.assertRaises(ConnectionError):
            page.receive()
        dashboard = Dashboard(self, port=dashboard.address[1])
        dashboard.works(self)

    def test_malformed_messages_are_counted_and_nothing_more(self):
        dashboard, lcm = Dashboard(self), LCM
        page = self.listen(dashboard, "ROBOT_STATE", "PLUMB_CHANNELS", "PLUMB_POSTERIOR", "PLUMB_SCENE")
        page.until(lambda one: one and one[0] == "PLUMB_CHANNELS")
        good = state(1).encode()
        for raw in (b"", good[:-1], good + b"\0", good[:24] + b"\x7f\xff\xff\xff" + good[28:], os.urandom(300)):
            lcm.say("ROBOT_STATE", raw)
        lcm.say("ROBOT_STATE", state(2))
        heard = page.until(lambda one: one and one[0] == "PLUMB_CHANNELS" and
                           any(row["count"] == 6 and row["undecodable"] == 5 for row in one[2]["channels"]))
        self.assertEqual([one[2]["sequence"] for one in heard if one[0] == "ROBOT_STATE"], [2])
        dashboard.works(self)


def arm_and_stop(test, page):
    """@param page that listens to DRIVER_STATUS."""
    page.until(lambda one: one and one[0] == "DRIVER_STATUS" and one[2]["state"] == plumb.driver_status_t.IDLE)
    end = time.monotonic() + PATIENCE
    while not (answer := page.call("arm"))["ok"]:  # until the driver's start guard is over
        test.assertLess(time.monotonic(), end, answer)
    # armed until the silence of commands ends it: a stop is another reason
    answer = page.call("emergency_stop")
    test.assertEqual(answer["ok"], True, answer)
    heard = page.until(lambda one: one and one[0] == "DRIVER_STATUS" and one[2]["state"] != plumb.driver_status_t.ARMED and
                       one[2]["stopped_by_request"])
    test.assertIn("emergency stop", heard[-1][2]["reason"])


class Stopped(unittest.TestCase):
    def arm_and_stop(self, dashboard, more=""):
        page = client.Page(dashboard.address, more=more)
        page.subscribe("DRIVER_STATUS")
        arm_and_stop(self, page)

    def test_an_emergency_stop_disarms_the_driver(self):
        bus = f"udp:239.74.163.60:{LCM.port}"
        Process(self, "plumb-robot", "--bus", bus)
        Process(self, "plumb-driver", "--bus", bus, "--virtual")
        self.arm_and_stop(Dashboard(self))

    def test_with_a_key_what_is_signed_is_shown_and_what_is_asked_for_is_signed(self):
        bus = f"udp:239.74.163.60:{LCM.port}"
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        key = pathlib.Path(folder.name) / "key"
        subprocess.run([PROGRAMS / "plumb", "key", key], check=True, capture_output=True)
        dashboard = Dashboard(self, "--key", key)
        token = dashboard.url.rpartition("=")[2]
        page = client.Page(dashboard.address)
        page.subscribe("PLUMB_CHANNELS")
        for i in range(300):  # that somebody invents channels does not get the robot's own refused
            LCM.say(f"INVENTED_{i}", b"nothing")
        page.until(lambda one: one and len(one[2]["channels"]) >= 200)
        page.close()
        Process(self, "plumb-robot", "--bus", bus, "--key", key)
        Process(self, "plumb-driver", "--bus", bus, "--virtual", "--key", key)
        self.arm_and_stop(dashboard, f"Cookie: plumb_token={token}\r\n")
        page = client.Page(dashboard.address)
        page.subscribe("ROBOT_STATE", "PLUMB_CHANNELS")
        page.until(lambda one: one and one[0] == "PLUMB_CHANNELS")
        LCM.say("ROBOT_STATE", state(1))
        heard = page.until(lambda one: one and one[0] == "PLUMB_CHANNELS" and
                           any(row["channel"] == "ROBOT_STATE" and row["refused"] == 1 for row in one[2]["channels"]))
        self.assertEqual({one[0] for one in heard}, {"PLUMB_CHANNELS"})


class Launched(unittest.TestCase):
    def launch(self, *flags):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        run = subprocess.Popen([PROGRAMS / "plumb", "launch", ROBOTS / "pendulum", "--lcm-url", LCM.url, "--bus",
                                f"udp:239.74.163.60:{LCM.port}", "--output", pathlib.Path(folder.name) / "run", *flags],
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

        def stop():
            run.send_signal(signal.SIGINT)
            run.wait(PATIENCE)
            run.stdout.close()

        self.addCleanup(stop)
        return run, [run.stdout.readline(), run.stdout.readline()][1]

    def test_whoever_came_in_a_virtual_run_may_arm_in_the_real_one_that_follows(self):
        dashboard = Dashboard(self)
        run, _ = self.launch()
        watching = client.Page(dashboard.address)
        watching.subscribe("PLUMB_GATEWAY")
        watching.until(lambda one: one and one[0] == "PLUMB_GATEWAY" and one[2]["clock"] == "virtual")
        page = client.Page(dashboard.address)
        page.subscribe("DRIVER_STATUS", "PLUMB_GATEWAY")
        self.assertIn("virtual time", page.call("arm")["text"])
        run.send_signal(signal.SIGINT)
        run.wait(PATIENCE)
        bus = f"udp:239.74.163.60:{LCM.port}"
        Process(self, "plumb-robot", "--bus", bus)
        Process(self, "plumb-driver", "--bus", bus, "--virtual")
        page.until(lambda one: one and one[0] == "PLUMB_GATEWAY" and one[2]["clock"] == "real")
        arm_and_stop(self, page)

    def test_a_run_in_virtual_time_is_shown_and_hears_nothing_but_a_stop(self):
        run, line = self.launch("--dashboard", "127.0.0.1:0")
        address = ("127.0.0.1", int(re.match(r"dashboard: http://127.0.0.1:(\d+)/$", line)[1]))
        page = client.Page(address)
        page.subscribe("DRIVER_STATUS", "PLUMB_GATEWAY")
        heard = page.until(lambda one: one and one[0] == "DRIVER_STATUS" and one[2]["state"] == plumb.driver_status_t.ARMED)
        gateway = page.until(lambda one: one and one[0] == "PLUMB_GATEWAY" and one[2]["utime"] >= heard[-1][2]["utime"])[-1][2]
        self.assertEqual(gateway["clock"], "virtual")  # which keeps everybody from arming, for as long as it lasts
        self.assertTrue(json.loads(client.body(client.get(address, "/robot.json")))["may_control"])
        for service in ("arm", "disarm", "confirm_placed"):
            self.assertEqual(page.call(service), {"ok": False, "text": "a run in virtual time hears nobody from outside"})
        answer = page.call("emergency_stop")
        self.assertTrue(answer["ok"], answer)
        self.assertEqual(run.wait(PATIENCE), 1)
        self.assertIn("asked for a stop: the run ends here", run.stdout.read())
        with self.assertRaises(OSError):
            while True:
                page.receive()

    def test_a_dashboard_that_cannot_be_does_not_keep_the_robot_from_running(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            run, line = self.launch("--dashboard", f"127.0.0.1:{port}")
            self.assertRegex(line, rf"^no dashboard: .*cannot listen on 127.0.0.1:{port}: Address already in use\n$")
            self.assertIn("iter", run.stdout.readline())
        bad = subprocess.run([PROGRAMS / "plumb", "launch", ROBOTS / "pendulum", "--dashboard", "http://x"], capture_output=True, text=True)
        self.assertEqual(bad.returncode, 1)
        self.assertIn("'http://x' is no ADDRESS:PORT such as 127.0.0.1:8765", bad.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
