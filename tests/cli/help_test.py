#!/usr/bin/env python3
"""Every program and every command of plumb ends its --help with examples, and they are commands that it would take: of programs
and commands that are there, with options that their help knows, and all arguments that are required.

    help_test.py BUILD
"""
import pathlib
import re
import shlex
import subprocess
import sys

folder = pathlib.Path(sys.argv[1]) / "bin"
wrong = []


def help_of(command):
    done = subprocess.run([folder / command[0], *command[1:], "--help"], capture_output=True, text=True)
    if done.returncode != 0:
        wrong.append(f"{' '.join(command)} --help: exit status {done.returncode}")
    return done.stdout


def section(text, title):
    """The lines below a title, up to an empty one."""
    found = re.search(rf"^{title}:\n(.*?)(?:\n\n|\Z)", text, re.MULTILINE | re.DOTALL)
    return found[1].splitlines() if found else []


def names(lines):
    return [line.split()[0] for line in lines if re.match(r"  \S", line)]


def told(text):
    """Without the examples: what only they have is no option."""
    return text.split("\nExamples:")[0]


def judge(example):
    """Why that is no command; None if it is one."""
    words = shlex.split(example)
    if not (folder / words[0]).exists():
        return "no such program"
    command, rest = words[:1], words[1:]
    text = help_of(command)
    known = told(text)
    while rest and rest[0] in names(section(text, "Subcommands")):
        command.append(rest.pop(0))
        text = help_of(command)
        known += told(text)
    options = set(re.findall(r"--[a-z][a-z-]*", known))
    required = [line for line in section(text, "Positionals") if "REQUIRED" in line]
    given = 0
    while rest:
        word = rest.pop(0)
        if not word.startswith("-"):
            given += 1
        elif word not in options:
            return f"{word} is no option of {' '.join(command)}"
        elif re.search(rf"{word}(,--[a-z-]+)? [A-Z]+", known) and rest and not rest[0].startswith("-"):
            rest.pop(0)  # its value
    if section(text, "Subcommands"):
        return "which of its commands?"
    return None if given >= len(required) else f"{given} of {len(required)} arguments"


def look_at(command):
    text = help_of(command)
    examples = [line.strip() for line in section(text, "Examples")]
    if not examples:
        wrong.append(f"{' '.join(command)} --help has no examples")
    for example in examples:
        if "--help" not in example and (why := judge(example)):
            wrong.append(f"{' '.join(command)} --help: {example!r}: {why}")
    for sub in names(section(text, "Subcommands")):
        look_at([*command, sub])


programs = sorted(file.name for file in folder.glob("plumb*"))
assert "plumb" in programs and "plumb-driver" in programs
for program in programs:
    look_at([program])
print("\n".join(wrong) or f"{len(programs)} programs")
sys.exit(1 if wrong else 0)
