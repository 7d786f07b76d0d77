#!/usr/bin/env python3
"""What systemd is to be told, a service manager hears: that a process is ready, that it is at work, that it stops.

    notices_test.py BUILD ROBOTS
"""
import os
import socket
import subprocess
import sys
import tempfile

build, robots = map(os.path.abspath, sys.argv[1:])
LCM = f"udpm://239.255.76.67:{20000 + os.getpid() % 20000}?ttl=0"
COMMANDS = {
    "plumb-driver": [f"{robots}/pendulum", "--bus", "loop:notices", "--virtual"],
    "plumb-estimator": [f"{robots}/pendulum"],
    "plumb-controller": [f"{robots}/pendulum", "--rest", "5"],
    "plumb": ["record", "notices.lcmlog"],
}

with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
    manager.bind(f"{folder}/notify")
    manager.settimeout(60)
    for program, arguments in COMMANDS.items():
        process = subprocess.Popen([f"{build}/bin/{program}", *arguments, "--lcm-url", LCM], cwd=folder, stderr=subprocess.DEVNULL,
                                   env={**os.environ, "NOTIFY_SOCKET": f"{folder}/notify", "WATCHDOG_USEC": "1000000"})
        try:
            heard = [manager.recv(100).decode() for _ in range(3)]
            assert heard == ["READY=1", "WATCHDOG=1", "WATCHDOG=1"], f"{program}: {heard}"
            process.terminate()
            while (last := manager.recv(100).decode()) == "WATCHDOG=1":
                pass
            assert last == "STOPPING=1", f"{program}: {last}"
            assert process.wait() == 0, program
            manager.setblocking(False)
            try:
                while last := manager.recv(100).decode():  # from its last moments
                    assert last == "WATCHDOG=1", f"{program}: {last}"
            except BlockingIOError:
                manager.settimeout(60)
        finally:
            process.kill()
            process.wait()
