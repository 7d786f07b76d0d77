#!/usr/bin/env python3
"""What scripts/examples makes of pages, with commands that are quick and known: what differs is found and put right, what the
machine's speed decides is not compared, slow ones wait for --all, and commands find what others left."""
import pathlib
import re
import subprocess
import sys
import tempfile

SCRIPT = pathlib.Path(__file__).resolve().parent.parent / "scripts" / "examples"
PAGE = """# A page

<!-- output -->
```
$ echo one >left; cat left
one
$ printf '%s\\n' \\
    two | tail -n 1
two
```

<!-- output: cat left; echo '60 updates, 1.5 s' -->
```
one
60 updates, 2.7 s
```

<!-- output, slow: ls robots/hopper/gym.toml -->
```
robots/hopper/gym.toml
```

```
$ echo no comment, no example
```
"""


def examples(page, *arguments):
    done = subprocess.run([sys.executable, SCRIPT, *arguments, page], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def main():
    with tempfile.TemporaryDirectory() as folder:
        page = pathlib.Path(folder, "page.md")

        def check(text, status, words, *arguments):
            page.write_text(text)
            got, said = examples(page, *arguments)
            assert got == status and re.search(words, said, re.S), (arguments, got, said)
            return page.read_text()

        for arguments in (("--check",), ("--check", "--all")):
            assert check(PAGE, 0, "cat left", *arguments) == PAGE
        assert check(PAGE, 0, "cat left") == PAGE.replace("2.7 s", "1.5 s")
        wrong = PAGE.replace("\none\n$", "\n1\n$")
        assert check(wrong, 1, r"-1\n\+one.*run scripts/examples", "--check") == wrong
        assert check(wrong, 0, "one") == PAGE.replace("2.7 s", "1.5 s")
        slow = PAGE.replace("gym.toml\n`", "gym\n`")
        assert check(slow, 0, "cat left", "--check") == slow
        assert check(slow, 1, r"\+robots/hopper/gym.toml", "--check", "--all") == slow
        assert check(slow, 0, "robots", "--all") == PAGE.replace("2.7 s", "1.5 s")
        # The rule for trainings: on a processor that can, every digit counts.
        trained = "<!-- output, trained: echo return 3 -->\n```\nreturn 4\n```\n"
        there = "x86-64-v3 (supported" in subprocess.run(["/lib64/ld-linux-x86-64.so.2", "--help"], capture_output=True, text=True).stdout
        check(trained, 1 if there else 0, "echo return 3", "--check")
        check(trained.replace("return 4", "cost 4"), 1, "differ|show what", "--check")
        check(PAGE.replace("$ echo one", "$ false; echo one"), 1, "false; .*ended with status 1", "--check")
        check(PAGE.replace("output, slow:", "output, slwo:"), 1, "slwo", "--check")


if __name__ == "__main__":
    main()
