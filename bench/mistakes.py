"""Deliberate mistakes, made one at a time in a copy of the tree, to see whether anything finds them: bench/chaos_mistakes by
plumb-chaos, bench/broken_lines by the rooms' tests. A mistake begins with its name, the file, what stands there once, and what
stands there instead."""
import argparse
import contextlib
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def run(command, **options):
    return subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)


def parser(description):
    options = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    where = options.add_mutually_exclusive_group(required=True)
    where.add_argument("--tree", type=pathlib.Path, help="the copy, with its build folder in build/")
    where.add_argument("--check", action="store_true", help="only look whether each can still be made of this tree's source")
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("names", nargs="*", help="mistakes; default: all")
    return options


def chosen(arguments, mistakes):
    """The tree, and those of the mistakes that are asked for; nothing of them if they are only to be checked."""
    tree = ROOT if arguments.check else arguments.tree.resolve()
    if tree == ROOT and not arguments.check:
        sys.exit("mistakes are made in a copy of the tree, not in this one")
    asked = [m for m in mistakes if not arguments.names or m[0] in arguments.names]
    others = set(arguments.names) - {m[0] for m in asked}
    others |= {f"{name}: {file} is another by now" for name, file, right, *_ in asked if (tree / file).read_text().count(right) != 1}
    if others:
        sys.exit("cannot be made: " + ", ".join(sorted(others)))
    return tree, [] if arguments.check else asked


def build(tree, target, jobs):
    done = run(["ninja", "-C", tree / "build", f"-j{jobs}", target])
    if done.returncode != 0:
        sys.exit(done.stdout[-4000:] + "\nthe copy does not build")


@contextlib.contextmanager
def made(tree, target, jobs, file, right, wrong):
    """While it lasts the mistake is there, and the target is built with it."""
    source = tree / file
    text = source.read_text()
    try:
        source.write_text(text.replace(right, wrong))
        build(tree, target, jobs)
        yield
    finally:
        source.write_text(text)
