#!/usr/bin/env python3
"""Links between the documents lead somewhere: to a file that is there, and to a heading that it has; and so do tests that are named
as `folder/file`: "words" or "words": to a file in tests/ that has these words. Exit status 1 names every one that does not."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
CODE = re.compile(r"^```.*?^```", re.M | re.S)
LINK = re.compile(r"\]\(([^)\s]+)\)")


TEST = re.compile(r'`([\w/]+_test\.(?:cc|py))`:((?: (?:and )?"[^"]+")+)')


def missing_tests(text):
    """Tests that are named and are not there. A name in C++ may go on in the next line."""
    for name, words in TEST.findall(text):
        file = ROOT / "tests" / name
        source = re.sub(r'"\s*"', "", file.read_text()) if file.exists() else ""
        yield from (f'{name}: "{word}"' for word in re.findall(r'"([^"]+)"', words) if word not in source)


def anchors(text):
    """As GitHub makes them: the heading in lower case, without punctuation, hyphens for spaces."""
    headings = re.findall(r"^#+ +(.+?) *$", CODE.sub("", text), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def main():
    files = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wrong, count = [], 0
    for file in sorted(files):
        wrong += [f"{file.relative_to(ROOT)}: there is no {test}" for test in missing_tests(file.read_text())]
        for link in LINK.findall(CODE.sub("", file.read_text())):
            if re.match(r"[a-z]+:", link):
                continue
            count += 1
            path, _, anchor = link.partition("#")
            target = (file.parent / path).resolve() if path else file
            if not target.exists():
                wrong.append(f"{file.relative_to(ROOT)}: there is no {link}")
            elif anchor and anchor not in anchors(target.read_text()):
                wrong.append(f"{file.relative_to(ROOT)}: no heading makes {link}")
    print("\n".join(wrong) or f"{count} links in {len(files)} documents lead somewhere")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
