#!/usr/bin/python3
"""server_test.py BUILD SOURCE: plumb serve-model as UM-Bridge's clients know it, with hostile ones among them. A client is Python's standard library."""
import json
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import unittest
import urllib.error
import urllib.request

BUILD, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
PLUMB, ROBOT = BUILD / "bin" / "plumb", SOURCE / "robots" / "hopper" / "gym.toml"
TRUTH = [3.6, 4.1, 2.8, 5.2]
PATIENCE = 120  # [s]; who is as late as that hangs


def jacobian_request():
    body = json.dumps({"name": "errors", "input": [TRUTH], "inWrt": 0, "outWrt": 0, "vec": [1, 0, 0, 0]}).encode()
    return b"POST /ApplyJacobian HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)


class Served(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.table = pathlib.Path(cls.folder.name) / "hop.csv"
        masses = [f"mass/{link}={mass}" for link, mass in zip(("torso", "thigh", "leg", "foot"), TRUTH)]
        subprocess.run([PLUMB, "sim", ROBOT, "--random", "--episodes", "20", "--seed", "3", "--noise", "0.003", "--csv", cls.table, "--set", *masses],
                       check=True, stdout=subprocess.DEVNULL)
        cls.server = subprocess.Popen([PLUMB, "serve-model", ROBOT, "--csv", cls.table, "--address", "127.0.0.1:0", "--host", "lab.example"],
                                      stdout=subprocess.PIPE, text=True)
        cls.said = []
        for line in cls.server.stdout:
            cls.said.append(line)
            if line.startswith("http://"):
                break
        cls.url = cls.said[-1].strip()
        cls.address = ("127.0.0.1", int(cls.url.rsplit(":", 1)[1]))

    @classmethod
    def tearDownClass(cls):
        cls.server.kill()
        cls.server.wait(PATIENCE)
        cls.server.stdout.close()
        cls.folder.cleanup()

    def ask(self, path, request=None, status=200, headers={}):
        data = None if request is None else request if isinstance(request, bytes) else json.dumps(request).encode()
        try:
            with urllib.request.urlopen(urllib.request.Request(self.url + path, data, headers), timeout=PATIENCE) as answer:
                self.assertEqual(answer.status, status)
                return json.load(answer)
        except urllib.error.HTTPError as error:
            with error:
                self.assertEqual(error.code, status)
                return json.load(error)

    def evaluate(self, name, parameters):
        return self.ask("/Evaluate", {"name": name, "input": [parameters], "config": {}})["output"][0]

    def busy(self):
        try:
            urllib.request.urlopen(self.url + "/Info", timeout=PATIENCE).close()
            return False
        except urllib.error.HTTPError as error:
            with error:
                return error.code == 503

    def works(self):
        self.assertEqual(self.ask("/Info")["protocolVersion"], 1.0)
        self.assertIsNone(self.server.poll())

    def test_a_client_finds_its_way(self):
        names = self.ask("/Info")["models"]
        self.assertEqual(names, ["log_likelihood", "errors", "next_states"])
        self.assertIn("mass/torso [kg] mass/thigh [kg] mass/leg [kg] mass/foot [kg]", "".join(self.said))
        for name in names:
            self.assertEqual(self.ask("/InputSizes", {"name": name})["inputSizes"], [4])
            size, = self.ask("/OutputSizes", {"name": name})["outputSizes"]
            self.assertEqual(len(self.evaluate(name, TRUTH)), size)

    def test_the_gradient_leads_uphill_to_the_truth(self):
        request = {"name": "log_likelihood", "input": [[3.7, 4.2, 2.9, 5.3]], "config": {}, "inWrt": 0, "outWrt": 0, "sens": [1.0]}
        gradient = self.ask("/Gradient", request)["output"]
        # Of a quadratic function: half of the gradient times the way.
        here, there = self.evaluate("log_likelihood", request["input"][0])[0], self.evaluate("log_likelihood", TRUTH)[0]
        self.assertGreater(there, here)
        self.assertGreater(sum(g * (t - x) for g, t, x in zip(gradient, TRUTH, request["input"][0])), 0)
        h = 1e-3
        moved = [value + h * (i == 0) for i, value in enumerate(request["input"][0])]
        back = [value - h * (i == 0) for i, value in enumerate(request["input"][0])]
        slope = (self.evaluate("log_likelihood", moved)[0] - self.evaluate("log_likelihood", back)[0]) / (2 * h)
        self.assertAlmostEqual(gradient[0] / slope, 1, delta=0.02)

    def test_a_sampler_finds_what_plumbline_has_found(self):
        folder = pathlib.Path(self.folder.name)
        subprocess.run([PLUMB, "calibrate", ROBOT, "--csv", self.table, "--horizons", "1", "--output", folder / "p.json"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([PLUMB, "export-model", ROBOT, "--posterior", folder / "p.json", "--randomisation", folder / "t.json"], check=True, stdout=subprocess.DEVNULL)
        printed = subprocess.run(["/usr/bin/python3", SOURCE / "examples/umbridge/sample.py", self.url, folder / "t.json"], check=True, capture_output=True,
                                 text=True, timeout=PATIENCE).stdout
        rows = [line.replace("±", " ").split() for line in printed.splitlines() if line.startswith("mass/")]
        self.assertEqual(len(rows), 4, printed)
        for _, mean, sd, their_mean, their_sd in rows:
            self.assertAlmostEqual(float(mean), float(their_mean), delta=0.5 * float(their_sd), msg=printed)
            self.assertAlmostEqual(float(sd) / float(their_sd), 1, delta=0.4, msg=printed)

    def test_our_own_simulator_behind_a_server_is_calibrated_as_here(self):
        folder = pathlib.Path(self.folder.name)
        calibrate = [PLUMB, "calibrate", ROBOT, "--csv", self.table, "--method", "laplace"]
        subprocess.run([*calibrate, "--output", folder / "here.json", "--horizons", "1"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([*calibrate, "--output", folder / "there.json", "--model", self.url], check=True, stdout=subprocess.DEVNULL)
        here, there = (json.loads((folder / name).read_text()) for name in ("here.json", "there.json"))
        for mean, other, sd, other_sd in zip(here["mean"], there["mean"], here["sd"], there["sd"]):
            self.assertAlmostEqual(mean, other, delta=0.2 * sd)
            self.assertAlmostEqual(other_sd / sd, 1, delta=0.1)

    def test_what_is_wrong_is_an_error_object(self):
        for path, request, status, kind in (
                ("/Evaluate", {"name": "errors", "input": [[1, 2]]}, 400, "InvalidInput"),
                ("/Evaluate", {"name": "errors", "input": [[-1, 2, 3, 4]]}, 400, "InvalidInput"),
                ("/Evaluate", {"name": "nothing"}, 400, "ModelNotFound"),
                ("/Evaluate", b"\xff\x00{", 400, "InvalidInput"),
                ("/Evaluate", b"[" * 5000, 400, "InvalidInput"),
                ("/ApplyHessian", {"name": "errors"}, 400, "UnsupportedFeature"),
                ("/nowhere", {"name": "errors"}, 404, "UnsupportedFeature")):
            answer = self.ask(path, request, status)
            self.assertEqual(list(answer), ["error"])
            self.assertEqual(answer["error"]["type"], kind)
        self.assertEqual(self.ask("/Info", headers={"Origin": "https://example.org"}, status=403)["error"]["type"], "InvalidInput")
        answer = self.ask("/Info", headers={"Host": "rebound.example:80"}, status=403)
        self.assertIn("not a name of ours", answer["error"]["message"])
        self.assertEqual(self.ask("/Info", headers={"Host": "Lab.Example:80"})["protocolVersion"], 1.0)
        self.assertEqual(self.evaluate("log_likelihood", [-1, 2, 3, 4]), [-1e300])
        self.works()

    def test_who_asks_and_goes_away_does_not_stand_in_others_way(self):
        request = jacobian_request()
        for _ in range(1000):
            with socket.create_connection(self.address, PATIENCE) as connection:
                connection.sendall(request)
        while self.busy():
            pass
        self.works()

    def test_requests_that_are_none_end_their_own_connection(self):
        for request in (b"\x16\x03\x01\x02\x00\x01", b"POST /Evaluate HTTP/1.1\r\nContent-Length: 999999999999\r\n\r\n{",
                        b"POST /Evaluate HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nfffffffffff\r\n", b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 10000):
            with socket.create_connection(self.address, PATIENCE) as connection:
                try:
                    connection.sendall(request)
                    answer = connection.recv(4096)
                except ConnectionResetError:
                    answer = b""
                self.assertTrue(answer == b"" or b" 400 " in answer, answer)
        self.works()

    def test_who_says_nothing_keeps_nobody_out(self):
        silent = [socket.create_connection(self.address, PATIENCE) for _ in range(200)]
        self.works()
        for connection in silent:
            connection.close()

    def test_who_says_nothing_costs_nobody_an_answer(self):
        asking = [socket.create_connection(self.address, PATIENCE) for _ in range(40)]
        for connection in asking:
            connection.sendall(jacobian_request())
        silent = [socket.create_connection(self.address, PATIENCE) for _ in range(200)]
        for connection in asking:
            self.assertIn(b" 200 OK", connection.recv(4096))
        for connection in asking + silent:
            connection.close()

    def test_several_at_once_are_all_answered(self):
        answers = []
        def ask():
            answers.append(self.evaluate("log_likelihood", TRUTH))
        threads = [threading.Thread(target=ask) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
        self.assertEqual(len(answers), 8)
        self.assertTrue(all(answer == answers[0] for answer in answers))

    def test_who_calibrates_a_silent_simulator_may_stop(self):
        with socket.create_server(("127.0.0.1", 0)) as silent:
            url = f"http://127.0.0.1:{silent.getsockname()[1]}"
            calibrate = subprocess.Popen([PLUMB, "calibrate", ROBOT, "--csv", self.table, "--model", url, "--output", pathlib.Path(self.folder.name) / "silent.json"],
                                         stdout=subprocess.DEVNULL)
            connection, _ = silent.accept()
            with connection:
                calibrate.send_signal(signal.SIGTERM)
                self.assertEqual(calibrate.wait(PATIENCE), 130)

    def test_it_ends_when_it_is_told_to(self):
        server = subprocess.Popen([PLUMB, "serve-model", ROBOT, "--csv", self.table, "--address", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
        while not server.stdout.readline().startswith("http://"):
            pass
        server.send_signal(signal.SIGINT)
        self.assertEqual(server.wait(PATIENCE), 0)
        server.stdout.close()
        taken = subprocess.run([PLUMB, "serve-model", ROBOT, "--csv", self.table, "--address", f"127.0.0.1:{self.address[1]}"], capture_output=True, text=True,
                               timeout=PATIENCE)
        self.assertEqual(taken.returncode, 1)
        self.assertIn("cannot listen on", taken.stderr)


unittest.main(argv=sys.argv[:1])
