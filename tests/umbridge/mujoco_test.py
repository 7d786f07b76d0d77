#!/usr/bin/python3
"""mujoco_test.py BUILD SOURCE: a hopper that lives in MuJoCo, whose masses plumb calibrate finds by a MuJoCo in a process of its own."""
import json
import pathlib
import subprocess
import sys
import tempfile

BUILD, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
PLUMB, EXAMPLES, ROBOT = BUILD / "bin" / "plumb", BUILD / "examples", SOURCE / "robots" / "hopper" / "gym.toml"
TRUTH = [3.6, 4.1, 2.8, 5.2]


def run(*command, status=0):
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == status, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout + done.stderr


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    run(PLUMB, "export-model", ROBOT, "--mjcf", folder / "prior.xml")
    run(PLUMB, "sim", ROBOT, "--random", "--episodes", "20", "--seed", "3", "--csv", folder / "efforts.csv")
    run(EXAMPLES / "mujoco-record", ROBOT, folder / "prior.xml", folder / "efforts.csv", folder / "motion.csv", *map(str, TRUTH))
    server = subprocess.Popen([EXAMPLES / "mujoco-serve", ROBOT, folder / "prior.xml", folder / "motion.csv", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        url = server.stdout.readline().strip()
        calibrate = [PLUMB, "calibrate", ROBOT, "--csv", folder / "motion.csv", "--model", url, "--output", folder / "p.json"]
        printed = run(*calibrate)
        found = json.loads((folder / "p.json").read_text())
        for truth, mean, sd, prior in zip(TRUTH, found["mean"], found["sd"], found["prior"]["sd"]):
            assert abs(mean - truth) < 4 * sd, printed
            assert sd < 0.1 * prior, printed
        # What it has written is a posterior like any other.
        run(PLUMB, "export-model", ROBOT, "--posterior", folder / "p.json", "--mjcf", folder / "found.xml")
        assert "mass/foot = 5." in (folder / "found.xml").read_text()
        # Other motion than the server's, another method, another name: a line each.
        run(PLUMB, "sim", ROBOT, "--random", "--episodes", "2", "--csv", folder / "other.csv")
        assert "outputSizes" in run(*calibrate, "--csv", folder / "other.csv", status=1)
        assert "laplace" in run(*calibrate, "--method", "reps", status=2)
        assert "--strict" in run(*calibrate, "--strict", status=2)
        assert "next_states" in run(*calibrate, "--model-name", "forward", status=1)
    finally:
        server.terminate()
        assert server.wait(100) == 0
        server.stdout.close()
    assert "Connection refused" in run(*calibrate, status=1)
