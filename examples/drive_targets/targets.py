#!/usr/bin/env python3
"""What a robot logs whose drives are told positions: of a table that `plumb sim --csv` has written, times, positions and
targets alone. Usage: targets.py ROBOT.toml TABLE.csv > LOG.csv. Each driven joint needs kp and rest in [joint.dynamics]."""
import csv
import pathlib
import sys
import tomllib


def drives(file):
    """{joint: (kp, rest)}, of this file and those that it extends."""
    settings = tomllib.loads(file.read_text())
    found = drives(file.parent / settings["extends"]) if "extends" in settings else {}
    for joint in settings.get("joint", []):
        dynamics = joint.get("dynamics", {})
        if "kp" in dynamics:
            found[joint["name"]] = dynamics["kp"], dynamics.get("rest", 0)
    return found


def main():
    kinds = drives(pathlib.Path(sys.argv[1]))
    with open(sys.argv[2], newline="") as table:
        rows = list(csv.DictReader(table))
    joints = [name[2:] for name in rows[0] if name.startswith("q/")]
    log = csv.writer(sys.stdout, lineterminator="\n")
    log.writerow(["t"] + ["q/" + j for j in joints] + ["target_q/" + j for j in joints])
    for row in rows:
        targets = [kinds[j][1] + float(row["u/" + j]) / kinds[j][0] for j in joints]
        log.writerow([f"{float(row['t']):.3f}"] + [f"{float(row['q/' + j]):.5f}" for j in joints]
                     + [f"{target:.6f}" for target in targets])


main()
