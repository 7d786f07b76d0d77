#!/usr/bin/env python3
"""Logs read in Python, by python/plumb_log.py, with the generated types. log_tools_test.py SOURCE BUILD"""
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

SOURCE, BUILD = map(pathlib.Path, sys.argv[1:])
sys.path += [str(SOURCE / "python"), str(BUILD / "lcmtypes/python")]
import plumb  # noqa: E402
import plumb_log  # noqa: E402

SEAL = b"PLUMSEAL" + bytes(64)
BEGIN = 1_700_000_000_000_000


def state(i):
    message = plumb.robot_state_t()
    message.utime, message.sequence, message.num_positions, message.num_velocities = BEGIN + 1000 * i - 300, i, 2, 2
    message.q, message.v = [i / 3, -i / 7], [math.nan, 1e-300]
    message.q_sd = message.v_sd = message.effort = [0.0, 0.0]
    return message


def write_log(file, messages):
    with open(file, "wb") as stream:
        for number, (utime, channel, data) in enumerate(messages):
            head = plumb_log.HEAD.pack(plumb_log.SYNC, number, utime, len(channel), len(data))
            stream.write(head + channel.encode() + data)


def sample(number=300):
    log = [(BEGIN + 1000 * i, "ROBOT_STATE", state(i).encode() + SEAL) for i in range(number)]
    status = plumb.driver_status_t()
    status.reason = "it says \"no\"\n\u00e4\x1b[31m"
    return log + [(BEGIN + 5, "DRIVER_STATUS", status.encode())]


def require(so, what):
    if not so:
        sys.exit(f"FAILED: {what}")


def refusal(function):
    try:
        function()
    except ValueError as error:
        return str(error)
    return "nothing was refused"


def test_python(folder):
    file = folder / "a.lcmlog"
    write_log(file, sample())
    messages = list(plumb_log.read_log(file))
    require(len(messages) == 301, "all messages")
    states = list(plumb_log.read_log(file, channels=["ROBOT_STATE"]))
    require(len(states) == 300, "those of a channel")
    for i, message in enumerate(states):
        decoded = message.decode()
        require(isinstance(decoded, plumb.robot_state_t), "the type is the message's")
        require(list(decoded.q) == state(i).q and decoded.utime == state(i).utime, "values")
        require(message.utime == BEGIN + 1000 * i and abs(message.seconds - i / 1000) < 1e-9, "times")
        require(message.sealed == message.data + SEAL, "the seal")
    require(messages[-1].decode().reason.startswith("it says"), "a text")

    whole = file.read_bytes()
    for cut in (1, 27, 28, 50, len(whole) - 1):
        file.write_bytes(whole[:cut])
        require(len(list(plumb_log.read_log(file))) == (300 if cut == len(whole) - 1 else 0), f"cut at {cut}")
    second = len(plumb_log.HEAD.pack(0, 0, 0, 0, 0)) + len("ROBOT_STATE") + len(state(0).encode()) + len(SEAL)
    for at in (second, second + 20, second + 24):  # sync word, length of channel, length of data
        file.write_bytes(whole[:at] + b"\xff" + whole[at + 1:])
        require(refusal(lambda: list(plumb_log.read_log(file))) == f"{file}: damaged at byte {second}", f"damage at {at}")
    file.write_bytes(b"no log at all, but long enough to have a head")
    require(refusal(lambda: list(plumb_log.read_log(file))) == f"{file}: is no LCM log", "no log")

    good = state(1).encode()
    hostile = [good[:-1], good[:8], good[:24] + struct.pack(">i", -1) + good[28:], good[:24] + b"\x7f" + good[25:],
               bytes(100), b"", SEAL]
    write_log(file, [(BEGIN, "ROBOT_STATE", data) for data in hostile])
    for message in plumb_log.read_log(file):
        require("nothing" not in refusal(message.decode), f"{message.data!r} is refused")

    write_log(file, sample())
    printed = subprocess.run([sys.executable, SOURCE / "python/plumb_log.py", file], capture_output=True, text=True)
    require(re.search(r"'ROBOT_STATE' +300 messages", printed.stdout) and "0.299 s" in printed.stdout, "the summary")


def run_example(folder):
    """The ten lines of the module's documentation do what they say."""
    file = folder / "run.lcmlog"
    write_log(file, sample(3))
    example = plumb_log.__doc__.split("\n\n")[1]
    code = "\n".join(line[4:] for line in example.splitlines()).replace('"python"', repr(str(SOURCE / "python")))
    code = code.replace('"build/lcmtypes/python"', repr(str(BUILD / "lcmtypes/python")))
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    require(done.returncode == 0 and len(done.stdout.splitlines()) == 3, f"the example: {done.stderr}")


with tempfile.TemporaryDirectory() as temporary:
    test_python(pathlib.Path(temporary))
    run_example(pathlib.Path(temporary))
print("all as it must be")
