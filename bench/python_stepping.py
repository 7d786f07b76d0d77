#!/usr/bin/python3
"""Control steps a second from Python, and their ratio to C++'s, batch by batch: the two take turns in one run. Where MuJoCo's own
Python module is installed, gym's Hopper in it, too.

    PYTHONPATH=build/python bench/python_stepping.py [--robot robots/hopper/gym.toml] [--turns 21] [--threads 0]
"""
import argparse
import concurrent.futures
import os
import pathlib
import re
import statistics
import subprocess
import time

import numpy
import plumbline

try:
    import mujoco
except ImportError:
    mujoco = None

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / os.environ.get("PLUMBLINE_BUILD", "build")
COUNTS = 16, 128, 1024, 8192
SIMULATED = 400_000  # control steps of a turn
LONGEST = 100  # control steps from one reset to the next


class Cpp:
    """bench/batch_stepping, which waits for its turns."""

    def __init__(self, robot, count, threads):
        self.process = subprocess.Popen([BUILD / "bench/batch_stepping", robot, str(count), str(threads)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)

    def seconds(self, steps):
        print(steps, file=self.process.stdin, flush=True)
        return float(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


class Python:
    def __init__(self, robot, count, threads):
        self.simulation = plumbline.Simulation(plumbline.load_robot(str(robot)), count, threads)
        size = len(plumbline.load_robot(str(robot)).actions)
        self.actions = numpy.random.default_rng(1).uniform(-1, 1, (count, size)).astype(numpy.float32)

    def seconds(self, steps):
        self.simulation.reset(seed=1)
        begin = time.perf_counter()
        for _ in range(steps):
            self.simulation.step(self.actions)
        return time.perf_counter() - begin


class Mujoco:
    """gym's Hopper, four frames of 2 ms to a control step, as published: tests/sim/mujoco_hopper.h. All threads call mj_step, which
    lets the others run meanwhile."""

    def __init__(self, count, threads, integrator):
        xml = re.search(r'R"\((.*?)\)"', (ROOT / "tests/sim/mujoco_hopper.h").read_text(), re.S)[1]
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        self.data = [mujoco.MjData(self.model) for _ in range(count)]
        self.threads = threads or os.cpu_count()
        self.pool = concurrent.futures.ThreadPoolExecutor(self.threads)
        actions = numpy.random.default_rng(1).uniform(-1, 1, (count, 3))
        for data, action in zip(self.data, actions):
            data.ctrl[:] = action

    def step(self, first):
        for data in self.data[first::self.threads]:
            mujoco.mj_step(self.model, data, 4)

    def seconds(self, steps):
        for data in self.data:
            data.qpos[:], data.qvel[:] = [0, 1.25, 0, 0, 0, 0], 0
        begin = time.perf_counter()
        for _ in range(steps):
            list(self.pool.map(self.step, range(self.threads)))
        return time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=pathlib.Path, default=ROOT / "robots/hopper/gym.toml")
    parser.add_argument("--turns", type=int, default=21)
    parser.add_argument("--threads", type=int, default=0, help="0 = one per core")
    arguments = parser.parse_args()
    peers = ("RK4", "EULER") if mujoco else ()
    print(f"{'environments':>12}{'Python [1/s]':>14}{'C++ [1/s]':>12}{'ratio':>8}{'quartiles':>14}" +
          "".join(f"{'MuJoCo ' + name + ' [1/s]':>20}" for name in peers))
    for count in COUNTS:
        steps = min(LONGEST, max(1, SIMULATED // count))
        repeats = max(1, SIMULATED // count // steps)
        rivals = {"Python": Python(arguments.robot, count, arguments.threads), "C++": Cpp(arguments.robot, count, arguments.threads)}
        rivals |= {name: Mujoco(count, arguments.threads, name) for name in peers}
        for rival in rivals.values():
            rival.seconds(steps)
        seconds = {name: [] for name in rivals}
        for turn in range(arguments.turns):
            for name in sorted(rivals, reverse=turn % 2 == 1):  # who is first changes
                of_a_turn = [rivals[name].seconds(steps) for _ in range(1 if name in peers else repeats)]
                seconds[name].append(statistics.mean(of_a_turn))
        rivals["C++"].close()
        rate = {name: count * steps / statistics.median(of) for name, of in seconds.items()}
        ratios = [cpp / python for cpp, python in zip(seconds["C++"], seconds["Python"])]
        low, middle, high = statistics.quantiles(ratios, n=4)
        print(f"{count:12}{rate['Python']:14.0f}{rate['C++']:12.0f}{middle:8.3f}{low:8.3f}-{high:.3f}" +
              "".join(f"{rate[name]:20.0f}" for name in peers), flush=True)


if __name__ == "__main__":
    main()
