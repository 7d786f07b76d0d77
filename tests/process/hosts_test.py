#!/usr/bin/env python3
"""Work shared by ranks on two hosts: two networks with names of their own on this machine, a wire between them, and mpirun, which
reaches the second host by an agent as it would by ssh. Arguments: the programs plumb and plumb-figure-1, the folder robots/. Exit status 77 where nobody may make
a network, or without OpenMPI.
"""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

NETWORK, HOSTS = "10.9.1.0/24", ("10.9.1.1", "10.9.1.2")


def run(command, **options):
    return subprocess.run(command, check=True, **options)


def skip_for(said, cause, words):
    """Ends: as skipped if that is the cause, and as failed for any other."""
    if not re.search(cause, said):
        sys.exit(said)
    print(f"skipped: {words}")
    sys.exit(77)


def second_host():
    """@return a process whose network and name are the second host's; ours is the first one."""
    host = subprocess.Popen(["unshare", "--net", "--uts", "sh", "-c", "hostname second; echo; exec sleep 600"], stdout=subprocess.PIPE)
    host.stdout.readline()
    there = ["nsenter", "-t", str(host.pid), "-n", "-u"]
    wire = subprocess.run(["ip", "link", "add", "name", "first0", "type", "veth", "peer", "name", "second0", "netns", str(host.pid)], stderr=subprocess.PIPE, text=True)
    if wire.returncode:
        host.kill()
        skip_for(wire.stderr, r"Unknown device type|Operation not supported", "the kernel has no veth interfaces")
    for prefix, interface, address in (([], "first0", HOSTS[0]), (there, "second0", HOSTS[1])):
        run([*prefix, "ip", "link", "set", "lo", "up"])
        run([*prefix, "ip", "addr", "add", f"{address}/24", "dev", interface])
        run([*prefix, "ip", "link", "set", interface, "up"])
    run(["hostname", "first"])
    return host, there


class Cluster:
    def __init__(self, folder):
        self.host, there = second_host()
        self.agent = folder / "agent"
        self.agent.write_text(f'#!/bin/sh\nshift\nexec {" ".join(there)} sh -c "$*"\n')
        self.agent.chmod(0o755)

    def mpirun(self, ranks, *command):
        """Half of the ranks on each host; with one it is on the second."""
        first = ranks // 2
        hosts = ",".join(f"{host}:{n}" for host, n in zip(HOSTS, (first, ranks - first)) if n)
        mca = {"plm_rsh_agent": self.agent, "btl_tcp_if_include": NETWORK, "oob_tcp_if_include": NETWORK, "btl": "self,vader,tcp"}
        settings = [word for name, value in mca.items() for word in ("--mca", name, str(value))]
        return ["mpirun", *settings, "--host", hosts, "-n", str(ranks), *map(str, command)]

    def ranks_there(self, program):
        """@return process ids of the program on the second host."""
        ours = os.readlink(f"/proc/{self.host.pid}/ns/net")
        found = []
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if os.readlink(entry / "ns/net") == ours and os.readlink(entry / "exe") == program:
                    found.append(int(entry.name))
            except OSError:
                pass  # it has ended
        return found


def result(file):
    """A posterior without when it was made, how fast, and by which command."""
    posterior = json.loads(file.read_text())
    del posterior["run"]
    return posterior


def test_calibrate(cluster, plumb, robots, folder):
    table = folder / "hop.csv"
    run([plumb, "sim", f"{robots}/hopper/gym.toml", "--random", "--episodes", "6", "--seed", "3", "--noise", "0.003", "--csv", table], stdout=subprocess.DEVNULL)
    posteriors = []
    for ranks in (1, 2, 4):
        output = folder / f"of_{ranks}.json"
        run(cluster.mpirun(ranks, plumb, "calibrate", f"{robots}/hopper/gym.toml", "--csv", table, "--threads", 1, "--output", output), stdout=subprocess.DEVNULL)
        posteriors.append(result(output))
    assert posteriors[0] == posteriors[1] == posteriors[2]


def train(plumb, robots, output):
    return [plumb, "train", f"{robots}/pendulum", "--distribution", "prior", "--steps", "30000", "--seed", "2", "--threads", "1", "--output", output]


def test_train(cluster, plumb, robots, folder):
    policies = []
    for ranks in (1, 2, 4):
        output = folder / f"of_{ranks}.onnx"
        run(cluster.mpirun(ranks, *train(plumb, robots, output)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        policies.append(output.read_bytes())
    assert policies[0] == policies[1] == policies[2]


def test_experiment(cluster, figure, folder):
    tables = []
    for ranks in (1, 2):
        output = folder / f"figure_{ranks}"
        run(cluster.mpirun(ranks, figure, "--quick", "--output", output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        tables.append((output / "figure_1.csv").read_bytes())
    assert tables[0] == tables[1]


def test_a_rank_that_dies(cluster, plumb, robots, folder):
    """The others end, with an error, and the same command comes to the same bits."""
    whole = folder / "whole.onnx"
    command = [word if word != "30000" else "120000" for word in train(plumb, robots, whole)]
    run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    broken = folder / "broken.onnx"
    command = cluster.mpirun(2, *[word if word != whole else broken for word in command])
    progress = folder / "progress.csv"
    command += ["--csv", str(progress)]
    going = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while going.poll() is None and not (progress.exists() and progress.read_text().count("\n") > 3):
        time.sleep(0.02)
    for rank in cluster.ranks_there(plumb):
        os.kill(rank, signal.SIGKILL)
    said = going.communicate(timeout=60)[0]
    assert going.returncode != 0, said
    assert "signal 9" in said and (HOSTS[1] in said or "second" in said), said
    assert not cluster.ranks_there(plumb)
    assert not broken.exists()
    run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    assert broken.read_bytes() == whole.read_bytes()


def main():
    if "PLUMBLINE_HOSTS" not in os.environ:  # in networks of its own
        if not shutil.which("mpirun"):
            print("skipped: OpenMPI (openmpi-bin) is not installed")
            sys.exit(77)
        network = subprocess.run(["unshare", "--net", "--uts", "true"], stderr=subprocess.PIPE, text=True)
        if network.returncode:
            skip_for(network.stderr, r"Operation not permitted", "this user may not make a network")
        os.environ.update({"PLUMBLINE_HOSTS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})
        os.execvp("unshare", ["unshare", "--net", "--uts", sys.executable, *sys.argv])
    plumb, figure, robots = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        cluster = Cluster(folder)
        try:
            test_calibrate(cluster, plumb, robots, folder)
            test_train(cluster, plumb, robots, folder)
            test_experiment(cluster, figure, folder)
            test_a_rank_that_dies(cluster, plumb, robots, folder)
        finally:
            cluster.host.kill()
    print("one, two and four ranks on two hosts come to the same bits")


if __name__ == "__main__":
    main()
