#!/usr/bin/env python3
"""scripts/lcm-spy starts, and finds our types. Exit status 77, with the reason, where Java, Debian's jars, the types' jar or
xvfb-run are missing.

    lcm_spy_test.py SOURCE BUILD
"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys

source, build = map(pathlib.Path, sys.argv[1:])
jars = ["lcm", "jchart2d", "jide-oss", "xmlgraphics-commons"]
missing = [program for program in ("java", "xvfb-run") if not shutil.which(program)]
missing += [f"{jar}.jar" for jar in jars if not pathlib.Path(f"/usr/share/java/{jar}.jar").exists()]
for types, folder in ("plumb", ""), ("drake", "drake/"):
    if not (build / f"lcmtypes/{folder}{types}_lcmtypes.jar").exists():
        missing.append(f"{types}_lcmtypes.jar (ninja {types}_lcmtypes_java)")
if missing:
    print("skipped: not there: " + ", ".join(missing))
    sys.exit(77)

spy = subprocess.Popen(["xvfb-run", "-a", source / "scripts/lcm-spy"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                       text=True, start_new_session=True, env={**os.environ, "PLUMBLINE_BUILD": str(build)})
said, found = "", False
for line in spy.stdout:
    said += line
    if line.startswith("Found ") and "LCM types" in line:
        found = int(line.split()[1]) >= len(list((source / "lcmtypes").glob("*.lcm")))
    if "Found 0 plugins" in line or "xception" in line or "rror" in line:
        break
os.killpg(spy.pid, signal.SIGTERM)
spy.wait()
print(said)
sys.exit(0 if found and "xception" not in said and "rror" not in said else 1)
