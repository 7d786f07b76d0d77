#!/usr/bin/env python3
"""examples/servo/table.py: readings at odd times become rows at even ones, up to where the motor is off, and
`plumb calibrate robots/servo` takes them. Usage: servo_table_test.py PLUMB"""
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parent.parent


def table(readings, folder):
    log = pathlib.Path(folder, "log.json")
    log.write_text(json.dumps({"entries": [
        {"timestamp": t, "position": q, "goal_position": goal, "torque_enable": on} for t, q, goal, on in readings]}))
    command = [sys.executable, SOURCE / "examples" / "servo" / "table.py", log, "0.01"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def main():
    with tempfile.TemporaryDirectory() as folder:
        # Straight lines in between: q = 2 t, target = 1 - t, as far as the motor is on (0.031 s).
        times = [0, 0.004, 0.013, 0.019, 0.027, 0.0305, 0.031, 0.05]
        rows = list(csv.DictReader(table([(t, 2 * t, 1 - t, t < 0.031) for t in times], folder).splitlines()))
        assert [row["t"] for row in rows] == ["0.0000", "0.0100", "0.0200", "0.0300"], rows
        for row in rows:
            t = float(row["t"])
            assert math.isclose(float(row["q/shaft"]), 2 * t, abs_tol=1e-6), row
            assert math.isclose(float(row["target_q/shaft"]), 1 - t, abs_tol=1e-6), row

        swing = [(0.0053 * k, 0.3 * math.sin(0.02 * k), 0.5 * math.sin(0.02 * k), True) for k in range(200)]
        log = pathlib.Path(folder, "swing.csv")
        log.write_text(table(swing, folder))
        done = subprocess.run([sys.argv[1], "calibrate", SOURCE / "robots" / "servo", "--csv", log, "--output", pathlib.Path(folder, "servo.json")],
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert "gear_efficiency/shaft" in done.stdout and "nobody has read the velocities" in done.stdout, done.stdout


main()
