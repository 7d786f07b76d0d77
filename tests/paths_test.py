#!/usr/bin/env python3
"""Scripts find what is theirs wherever the repository is, also below a folder with a space in its name, and wherever they are called
from. $PLUMBLINE_BUILD is an absolute path, or one from the repository's folder on: scripts/demo runs what is there, scripts/examples
shows what is there, and scripts/setup asks for room there. In a small repository of the real scripts, where what they call says no
more than how it was called. Node's scripts make no path of a URL's, which has %20 for a space."""
import os
import pathlib
import shutil
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCRIPTS = ROOT / "scripts"


def program(file, text):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)


def of_urls():
    """Lines of node's scripts that take a URL's path for a file's."""
    for folder in ("bench", "dashboard/web", "scripts", "tests"):
        for file in (ROOT / folder).rglob("*.mjs"):
            if "node_modules" not in file.parts:
                yield from (f"{file}: {line}" for line in file.read_text().splitlines() if "import.meta.url).pathname" in line)


def main():
    assert not list(of_urls()), list(of_urls())
    with tempfile.TemporaryDirectory(prefix="of paths ") as folder:
        folder = pathlib.Path(folder).resolve()
        root, elsewhere = folder / "root", folder / "elsewhere"
        elsewhere.mkdir()

        def copy(*names):
            for name in names:
                (root / "scripts").mkdir(parents=True, exist_ok=True)
                shutil.copy(SCRIPTS / name, root / "scripts")

        def run(name, build, *arguments):
            environment = {**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}", "PLUMBLINE_BUILD": str(build)}
            done = subprocess.run([root / "scripts" / name, *arguments], cwd=elsewhere, env=environment, capture_output=True, text=True)
            return done.returncode, done.stdout + done.stderr

        copy("help", "demo", "examples")
        for name in ("setup", "build"):
            program(root / "scripts" / name, "true")
        builds = ("of-its-own", elsewhere / "build")
        page = folder / "page.md"
        for build in builds:
            program(root / build / "bin/plumb", 'echo "$0 $*"')
            assert run("demo", build, "--seed", "1") == (0, f"{root / build}/bin/plumb launch {root}/robots/pendulum --seed 1\n"), build
            page.write_text(f"<!-- output: readlink build -->\n```\n{root / build}\n```\n")
            assert run("examples", build, "--check", page)[0] == 0, build

        copy("setup")
        program(root / "scripts/free-memory", "echo 9999")
        program(folder / "bin/dpkg-query", "printf installed")
        program(folder / "bin/df", f'case $3 in "{root}" | "{root}"/*) echo 7M ;; *) echo 9999M ;; esac')
        assert run("setup", "new", "--run") == (1, f"scripts/setup: a build needs 1000 MB, {root} has room for 7 MB. "
                                                   "Cure: make room, or set PLUMBLINE_BUILD to a folder elsewhere\n")
        assert run("setup", elsewhere / "new/build", "--run") == (0, "")


if __name__ == "__main__":
    main()
