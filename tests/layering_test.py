#!/usr/bin/env python3
"""Dependencies point down only: which folder may include which. Exit status 1 names every line that does not.

Also: SimTK headers only in sim/*.cc and what two of these share, sim/virtual/simbody_tree.h, MuJoCo's only in sim/virtual/mujoco_backend.cc, ODE's only in sim/virtual/ode_*,
MPI's only in common/ranks.cc, ONNX and protobuf only in trainer/onnx_*.cc, LCM and sockets only in main.cc files, common/ and drivers/can/, Boost's network in http/ and the servers that stand on it (tests aside).

And no two headers define a class of one name: a program that has both would have one's functions for the other's objects.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Each folder may include the named ones and all that these may.
STANDS_ON = {
    "common": set(),
    "plot": {"common"},
    "robot/urdf": {"common"},
    "robot": {"robot/urdf"},
    "records": {"sim/view"},
    "drivers/can": {"common"},
    "drivers/protocols": {"robot", "drivers/can"},
    "drivers/bus": {"drivers/protocols"},
    "drivers/driver": {"drivers/bus"},
    "drivers": {"drivers/driver"},
    "estimator": {"robot"},
    "estimator/model": {"sim", "estimator"},
    "controller": {"sim/tasks"},
    "sim/dynamics": {"robot"},
    "sim/tasks": {"robot"},
    "sim": {"sim/dynamics", "sim/tasks"},
    "sim/virtual": {"sim"},
    "sim/view": {"sim"},
    "calibrator/inference": {"common"},
    "calibrator/motion": {"sim"},
    "calibrator/fit": {"calibrator/motion", "calibrator/inference"},
    "calibrator/diagnostics": {"calibrator/fit"},
    "calibrator/gap": {"calibrator/diagnostics"},
    "calibrator/design": {"calibrator/diagnostics"},
    "calibrator/results": {"calibrator/design", "calibrator/gap"},
    "calibrator/report": {"calibrator/results", "plot"},
    "calibrator/live": {"calibrator/results"},
    "calibrator": {"calibrator/report", "calibrator/live"},
    "trainer": {"sim", "controller"},
    "cli": {"records", "umbridge", "plot", "drivers", "sim/virtual", "sim/view", "estimator", "controller", "calibrator", "trainer"},
    "http": {"common"},
    "umbridge": {"http", "calibrator"},
    "dashboard": {"http", "sim/view"},
    "chaos": {"cli"},
    "python": {"calibrator", "trainer"},
    "experiments": {"drivers", "sim/virtual", "estimator", "controller", "calibrator", "trainer"},
}


def all_below(room, path=()):
    if room in path:
        sys.exit("a circle: " + " -> ".join((*path, room)))
    nearest = STANDS_ON[room]
    return nearest.union(*(all_below(below, (*path, room)) for below in nearest))


BELOW = {room: all_below(room) for room in STANDS_ON}
# Of the virtual robot's room only the part on the bus knows drivers: it speaks the protocols' device side, and virtual_bus joins it with a driver.
ON_THE_BUS = [f"sim/virtual/{file}" for file in
              ("virtual_bus.h", "virtual_bus.cc", "virtual_robot.h", "virtual_robot.cc", "virtual_devices.h",
               "virtual_drives.cc", "virtual_sensors.cc")]
# Only the estimator's process knows its filter on the simulator.
EXCEPTIONS = {(file, room) for file in ON_THE_BUS for room in BELOW if room.startswith("drivers/")} | {
    ("sim/main.cc", "sim/virtual"), ("sim/main.cc", "drivers/can"),
    ("estimator/main.cc", "estimator/model"), ("estimator/main.cc", "sim")}
SYSTEM = {
    r"(SimTK\w*|Simbody)\.h|simbody/": lambda p: p.startswith("sim/") and p.endswith(".cc") or p == "sim/virtual/simbody_tree.h",
    r"mujoco/": lambda p: p == "sim/virtual/mujoco_backend.cc",
    r"ode/": lambda p: p.startswith("sim/virtual/ode_"),
    r"onnx/|google/protobuf/": lambda p: p.startswith("trainer/onnx_") and p.endswith(".cc"),
    r"lcm/": lambda p: p.startswith(("common/", "drivers/can/")) or p.endswith("main.cc"),
    r"mpi\.h": lambda p: p == "common/ranks.cc",
    r"boost/(asio|beast)": lambda p: p.startswith("http/") or p in (
        "umbridge/server.cc",         "dashboard/server.h", "dashboard/request_answers.cc", "dashboard/viewer_connection.cc", "dashboard/main.cc"),
    r"sys/socket\.h|netinet/|linux/can": lambda p: p.startswith(("common/", "drivers/can/")) or p.endswith("main.cc"),
}


def folder(path):
    """The room of a file."""
    nested = [f for f in BELOW if "/" in f and path.startswith(f + "/")]
    return nested[0] if nested else path.split("/")[0]


def classes(text):
    """Those of a header, with their namespaces."""
    inside = []
    for line in text.splitlines():
        opened = re.match(r"namespace ([\w:]*) ?\{", line)
        defined = re.match(r"(?:class|struct|enum class) ([\w:]+)[^;(]*\{", line)
        if opened:
            if opened[1].split("::")[0] == "plumb":
                inside.clear()  # what was opened to declare another library's names
            inside.append(opened[1])
        elif line.startswith("}  // namespace"):
            inside.pop()
        elif defined:
            yield "::".join((*inside, defined[1]))


def main():
    wrong, homes = [], {}
    files = [f for room in {r.split("/")[0] for r in BELOW} for f in (ROOT / room).rglob("*") if f.suffix in (".h", ".cc")]
    for file in sorted(files):
        path = file.relative_to(ROOT).as_posix()
        here = folder(path)
        for name in classes(file.read_text()) if file.suffix == ".h" else ():
            if homes.setdefault(name, path) != path:
                wrong.append(f"{path}: {name} is the name of a class in {homes[name]}, too")
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
