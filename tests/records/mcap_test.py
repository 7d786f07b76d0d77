#!/usr/bin/env python3
"""plumb export --mcap, read by MCAP's official reader: every message of every type in lcmtypes/, all values, and the robot as
foxglove.SceneUpdate, by Foxglove's own schema. Exit status 77, with the reason, where node or its modules are missing: npm install
in tests/records/mcap_core, or $MCAP_MODULES names a folder with them in its node_modules.

    mcap_test.py SOURCE BUILD
"""
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import made_up

SOURCE, BUILD = map(pathlib.Path, sys.argv[1:])
sys.path += [str(SOURCE / "python"), str(BUILD / "lcmtypes/python")]
import plumb  # noqa: E402
import plumb_log  # noqa: E402

SEAL = b"PLUMSEAL" + bytes(64)
BEGIN = 1_700_000_000_000_000
STATES = 10_000  # which fill several chunks
TYPES = {file.stem: file for file in (SOURCE / "lcmtypes").glob("*.lcm")}


def modules():
    for folder in filter(None, (os.environ.get("MCAP_MODULES"), SOURCE / "tests/records/mcap_core")):
        if all((pathlib.Path(folder) / "node_modules" / name).is_dir() for name in ("@mcap/core", "@foxglove/schemas", "ajv", "fzstd")):
            return str(folder)
    return None


def require(so, what):
    if not so:
        sys.exit(f"FAILED: {what}")


def state(i):
    message = plumb.robot_state_t()
    message.utime, message.sequence, message.num_positions, message.num_velocities = BEGIN + 1000 * i - 300, i, 1, 1
    message.q, message.v, message.q_sd, message.v_sd, message.effort = [i / 3000], [-i / 7], [math.nan], [1e-300], [0.0]
    return message


def everything():
    """[(received, channel, message, JSON)] in order of time: of each type one without elements in its arrays, one with one, one with
    several; and a run of the pendulum."""
    maker = made_up.MadeUp(TYPES, plumb)
    said = [(BEGIN + 1000 * i, "ROBOT_STATE", state(i), None) for i in range(STATES)]
    for number, (name, count) in enumerate((name, count) for name in sorted(TYPES) for count in (0, 1, 3)):
        message, meant = maker.message(name, count)
        if "utime" in meant:
            message.utime = meant["utime"] = BEGIN + number
        said.append((BEGIN + 500 + 1000 * number, name.upper(), message, meant))
    return sorted(said, key=lambda one: one[0])


def write_log(file, said):
    with open(file, "wb") as stream:
        for number, (received, channel, message, _) in enumerate(said):
            data = message.encode() + (SEAL if number % 2 else b"")
            stream.write(plumb_log.HEAD.pack(plumb_log.SYNC, number, received, len(channel), len(data)) + channel.encode() + data)


def difference(shown, meant, path=""):
    """Where they differ first, or nothing. Truths are no numbers."""
    if isinstance(meant, dict) and isinstance(shown, dict) and list(shown) == list(meant):
        return next(filter(None, (difference(shown[key], meant[key], f"{path}.{key}") for key in meant)), "")
    if isinstance(meant, list) and isinstance(shown, list) and len(shown) == len(meant):
        return next(filter(None, (difference(*pair, f"{path}[{i}]") for i, pair in enumerate(zip(shown, meant)))), "")
    same = meant == shown and isinstance(meant, bool) == isinstance(shown, bool)
    same = same and (not isinstance(meant, float) or math.copysign(1, meant) == math.copysign(1, shown))
    return "" if same else f"{path}: {shown!r}, not {meant!r}"


def compare(message, received, channel, meant, utime):
    require(message["topic"] == channel and message["encoding"] == "json", f"its channel: {message}")
    require(message["schemaEncoding"] == "jsonschema", "its schema")
    require(message["logged"] == str(1000 * received), f"when {channel} was logged")
    require(message["published"] == str(1000 * utime), f"when {channel} was published")
    wrong = difference(message["data"], meant, channel)
    require(not wrong, wrong)


def compare_scene(message, i):
    require(message["published"] == message["logged"] == str(1000 * (BEGIN + 1000 * i)), "when the picture is")
    robot = next(one for one in message["data"]["entities"] if one["id"] == "robot")
    require(robot["frame_id"] == "world" and robot["spheres"] + robot["cylinders"] + robot["cubes"], "the robot has solids")
    seconds = robot["timestamp"]["sec"] * 10**9 + robot["timestamp"]["nsec"]
    require(str(seconds) == message["logged"], f"its time: {robot['timestamp']}")
    return robot


def main(folder):
    log, mcap = folder / "a.lcmlog", folder / "a.mcap"
    said = everything()
    write_log(log, said)
    exported = subprocess.run([BUILD / "bin/plumb", "export", log, "--mcap", mcap, "--robot", SOURCE / "robots/pendulum"],
                              capture_output=True, text=True)
    require(exported.returncode == 0 and "left out" not in exported.stdout, exported.stdout + exported.stderr)
    read = subprocess.run(["node", SOURCE / "tests/records/mcap_core/read.mjs", mcap], capture_output=True, text=True,
                          env={**os.environ, "MCAP_MODULES": modules()})
    require(read.returncode == 0, read.stderr)
    messages = [json.loads(line, parse_int=lambda digits: -0.0 if digits == "-0" else int(digits)) for line in read.stdout.splitlines()]
    scenes = [message for message in messages if message["topic"] == "PLUMB_SCENE"]
    others = [message for message in messages if message["topic"] not in ("PLUMB_SCENE", "PLUMB_FRAME")]
    require(len(others) == len(said), f"{len(others)} messages of {len(said)}")
    for message, (received, channel, one, meant) in zip(others, said):
        name = type(one).__name__
        require(message["schema"] == f"plumb.{name}", f"{message['schema']} of {name}")
        if meant is None:
            meant = meant_state(one)
        compare(message, received, channel, meant, meant.get("utime", received))
    require({message["schema"] for message in others} == {f"plumb.{name}" for name in TYPES}, "every type is there")

    # 30 pictures a second of 10 s; the pendulum's solids turn with its joint.
    require(len(scenes) in range(285, 302) and {scene["schema"] for scene in scenes} == {"foxglove.SceneUpdate"}, f"{len(scenes)} pictures")
    places = []  # of what turns most
    for scene in scenes:
        i = (int(scene["logged"]) // 1000 - BEGIN) // 1000
        robot = compare_scene(scene, i)
        solids = [one["pose"]["position"] for kind in ("cubes", "spheres", "cylinders") for one in robot[kind]]
        places.append((i / 3000, solids))
    q, solids = places[len(places) // 10]
    bob = max(range(len(solids)), key=lambda k: solids[k]["x"])
    length = solids[bob]["x"] / math.sin(q)
    pivot = solids[bob]["z"] - length * math.cos(q)
    require(length > 0.1, "something turns")
    for q, solids in places:
        x, z = solids[bob]["x"], solids[bob]["z"]
        require(abs(x - length * math.sin(q)) < 1e-6 and abs(z - pivot - length * math.cos(q)) < 1e-6, f"{solids} at {q} rad")


def meant_state(message):
    """What JSON says of `state`."""
    names = ["utime", "sequence", "num_positions", "q", "num_velocities", "v", "q_sd", "v_sd", "effort", "num_contacts", "contact", "model_based", "valid", "restarted"]
    said = {name: getattr(message, name) for name in names}
    return {**said, "q_sd": [None], "contact": [], "model_based": False, "valid": False, "restarted": False}


if not shutil.which("node") or not modules():
    print("skipped: " + ("node is not installed" if not shutil.which("node") else
                         "@mcap/core and what goes with it are missing (scripts/setup --browser), or set MCAP_MODULES"))
    sys.exit(77)
with tempfile.TemporaryDirectory() as temporary:
    main(pathlib.Path(temporary))
print("all as it must be")
