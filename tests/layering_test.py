#!/usr/bin/env python3
"""Dependencies point down only: which folder may include which. Exit status 1 names every line that does not.

Also: SimTK headers only in sim/*.cc, MuJoCo's only in sim/virtual/mujoco_backend.cc, MPI's only in common/ranks.cc,
ONNX and protobuf only in trainer/onnx_*.cc, LCM and sockets only in main.cc files, common/ and drivers/can/ (tests aside).
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# "drivers/*": all rooms of that folder.
BELOW = {
    "common": set(),
    "robot/urdf": {"common"},
    "robot": {"common", "robot/urdf"},
    "drivers/can": {"common"},
    "drivers/protocols": {"common", "robot", "drivers/can"},
    "drivers/bus": {"common", "robot", "drivers/can", "drivers/protocols"},
    "drivers/driver": {"common", "robot", "drivers/can", "drivers/protocols", "drivers/bus"},
    "drivers": {"common", "robot", "drivers/*"},
    "estimator": {"common", "robot"},
    "estimator/model": {"common", "robot", "sim", "estimator"},
    "controller": {"common", "robot", "sim/tasks"},
    "sim/dynamics": {"robot"},
    "sim/tasks": {"common", "robot"},
    "sim": {"common", "robot", "sim/dynamics", "sim/tasks"},
    "sim/virtual": {"common", "robot", "sim"},
    "sim/view": {"common", "robot", "sim"},
    "calibrator/inference": {"common"},
    "calibrator": {"common", "robot/urdf", "robot", "sim", "sim/tasks", "calibrator/inference"},
    "trainer": {"common", "robot", "sim", "sim/tasks", "controller"},
    "cli": {"common", "robot", "sim", "sim/*", "drivers/*", "estimator", "controller", "calibrator", "calibrator/*", "trainer"},
    "experiments": {"common", "robot", "sim", "sim/*", "drivers/*", "estimator", "calibrator", "calibrator/*", "trainer", "controller"},
}
# Of the virtual robot's room only the part on the bus knows drivers: it speaks the protocols' device side.
ON_THE_BUS = [f"sim/virtual/{file}" for file in
              ("virtual_bus.h", "virtual_bus.cc", "virtual_robot.h", "virtual_robot.cc", "virtual_devices.h",
               "virtual_drives.cc", "virtual_sensors.cc")]
# Only the estimator's process knows its filter on the simulator.
EXCEPTIONS = {(file, room) for file in ON_THE_BUS for room in BELOW if room.startswith("drivers/")} | {
    ("sim/main.cc", "sim/virtual"), ("sim/main.cc", "drivers/can"),
    ("estimator/main.cc", "estimator/model"), ("estimator/main.cc", "sim")}
SYSTEM = {
    r"(SimTK\w*|Simbody)\.h|simbody/": lambda p: p.startswith("sim/") and p.endswith(".cc"),
    r"mujoco/": lambda p: p == "sim/virtual/mujoco_backend.cc",
    r"onnx/|google/protobuf/": lambda p: p.startswith("trainer/onnx_") and p.endswith(".cc"),
    r"lcm/": lambda p: p.startswith(("common/", "drivers/can/")) or p.endswith("main.cc"),
    r"mpi\.h": lambda p: p == "common/ranks.cc",
    r"sys/socket\.h|netinet/|linux/can": lambda p: p.startswith(("common/", "drivers/can/", "cli/doctor"))
    or p.endswith("main.cc"),
}


def folder(path):
    """The room of a file."""
    nested = [f for f in BELOW if "/" in f and path.startswith(f + "/")]
    return nested[0] if nested else path.split("/")[0]


def main():
    wrong = []
    files = [f for room in {r.split("/")[0] for r in BELOW} for f in (ROOT / room).rglob("*") if f.suffix in (".h", ".cc")]
    for file in sorted(files):
        path = file.relative_to(ROOT).as_posix()
        here = folder(path)
        for number, line in enumerate(file.read_text().splitlines(), 1):
            quoted = re.match(r'#include "([^"]+)"', line)
            if quoted:
                there = folder(quoted[1])
                known = there == here or BELOW[here] & {there, there.split("/")[0] + "/*"} or (path, there) in EXCEPTIONS
                if there in BELOW and not known:
                    wrong.append(f"{path}:{number}: {here} must not include {there}")
            system = re.match(r"#include <([^>]+)>", line)
            if system:
                for pattern, allowed in SYSTEM.items():
                    if re.match(pattern, system[1]) and not allowed(path):
                        wrong.append(f"{path}:{number}: <{system[1]}> has no place here")
    print("\n".join(wrong) or f"{len(files)} files keep to the layers")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
