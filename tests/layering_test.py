#!/usr/bin/env python3
"""Dependencies point down only: which folder may include which. Exit status 1 names every line that does not.

Also: SimTK headers only in sim/*.cc, MuJoCo's only in sim/mujoco_engine.cc, MPI's only in common/ranks.cc, ONNX and protobuf only in trainer/onnx_*.cc, LCM and sockets only in
main.cc files, common/ and drivers/can/ (tests aside).
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BELOW = {
    "common": set(),
    "robot/urdf": {"common"},
    "robot": {"common", "robot/urdf"},
    "sim/tasks": {"common", "robot"},
    "drivers": {"common", "robot"},
    "estimator": {"common", "robot"},
    "estimator/model": {"common", "robot", "sim", "estimator"},
    "controller": {"common", "robot", "sim/tasks"},
    "sim": {"common", "robot", "sim/tasks"},
    "calibrator/inference": {"common"},
    "calibrator": {"common", "robot/urdf", "robot", "sim", "sim/tasks", "calibrator/inference"},
    "trainer": {"common", "robot", "sim", "sim/tasks", "controller"},
    "cli": {"common", "robot", "sim", "sim/tasks", "drivers", "estimator", "controller", "calibrator", "calibrator/inference", "trainer"},
    "experiments": {"common", "robot", "sim", "sim/tasks", "drivers", "estimator", "calibrator", "calibrator/inference", "trainer", "controller"},
}
# The virtual robot speaks the protocols' device side. Only the estimator's process knows its filter on the simulator.
EXCEPTIONS = {(f"sim/{file}", "drivers") for file in
              ("main.cc", "virtual_bus.h", "virtual_bus.cc", "virtual_robot.h", "virtual_robot.cc", "virtual_devices.h", "virtual_drives.cc", "virtual_sensors.cc")} | {("estimator/main.cc", "estimator/model"), ("estimator/main.cc", "sim")}
SYSTEM = {
    r"(SimTK\w*|Simbody)\.h|simbody/": lambda p: p.startswith("sim/") and p.endswith(".cc"),
    r"mujoco/": lambda p: p == "sim/mujoco_engine.cc",
    r"onnx/|google/protobuf/": lambda p: p.startswith("trainer/onnx_") and p.endswith(".cc"),
    r"lcm/": lambda p: p.startswith(("common/", "drivers/can/")) or p.endswith("main.cc"),
    r"mpi\.h": lambda p: p == "common/ranks.cc",
    r"sys/socket\.h|netinet/|linux/can": lambda p: p.startswith(("common/", "drivers/can/", "cli/doctor"))
    or p.endswith("main.cc"),
}


def folder(path):
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
                if there in BELOW and there != here and there not in BELOW[here] and (path, there) not in EXCEPTIONS:
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
