#!/usr/bin/env python3
"""A log of Rhoban's BAM (github.com/Rhoban/bam: JSON, a reading whenever the servo answers) as a table of positions and targets
at a constant period, up to where the motor is switched off. Usage: table.py LOG.json PERIOD > TABLE.csv"""
import csv
import json
import sys


def main():
    with open(sys.argv[1]) as file:
        readings = json.load(file)["entries"]
    period = float(sys.argv[2])
    off = (r["timestamp"] for r in readings if not r["torque_enable"])
    end = next(off, readings[-1]["timestamp"])
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(["t", "q/shaft", "target_q/shaft"])
    row = 0
    for before, after in zip(readings, readings[1:]):
        if after["timestamp"] >= end:
            break
        while row * period < before["timestamp"]:
            row += 1
        while row * period < after["timestamp"]:
            share = (row * period - before["timestamp"]) / (after["timestamp"] - before["timestamp"])
            table.writerow([f"{row * period:.4f}"] + [
                f"{before[name] + share * (after[name] - before[name]):.6f}" for name in ("position", "goal_position")])
            row += 1


main()
