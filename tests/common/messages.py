#!/usr/bin/env python3
"""messages.py LCMTYPES MODULES: messages of every type in the folder LCMTYPES, filled at random by what its .lcm file says,
as lcm-gen's Python encodes them and decodes them again. A line for each: type, hexadecimal bytes, JSON."""
import json
import math
import pathlib
import random
import re
import sys

lcmtypes = pathlib.Path(sys.argv[1])
sys.path.insert(0, sys.argv[2])
import plumb  # noqa: E402

FIELDS = {file.stem: re.findall(r"^  (?!const )(\w+) (\w+)((?:\[\w+\])*);", file.read_text(), re.M) for file in lcmtypes.glob("*.lcm")}
BITS = {"int8_t": 8, "int16_t": 16, "int32_t": 32, "int64_t": 64}
chance = random.Random(1)


def value(kind):
    if kind in BITS:
        most = 2 ** (BITS[kind] - 1) - 1
        return chance.choice([0, -1, most, -most - 1, chance.randint(-most, most)])
    if kind == "double":
        return chance.choice([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1.7e308, 0.1, chance.gauss(0, 1e3)])
    if kind == "float":  # such that a single's shortest digits are a double's, too
        return chance.choice([math.nan, -math.inf, 0.0, 2.0 ** 20, chance.randint(-1000, 1000) / 8])
    if kind == "boolean":
        return chance.random() < 0.5
    if kind == "byte":
        return chance.randint(0, 255)
    if kind == "string":
        return chance.choice(["", "elbow", "°C", 'a "quoted" \\ word', "two\nlines\tand more", "€ 𝄞"])
    return filled(kind)


def filled(name):
    fields = FIELDS[name]
    counts = {dimension: chance.choice([0, 1, 3]) for _, _, dimensions in fields for dimension in re.findall(r"\w+", dimensions)
              if not dimension.isdigit()}
    message = getattr(plumb, name)()

    def array(kind, dimensions):
        if not dimensions:
            return value(kind)
        size = int(dimensions[0]) if dimensions[0].isdigit() else counts[dimensions[0]]
        return [array(kind, dimensions[1:]) for _ in range(size)]

    for kind, field, dimensions in fields:
        setattr(message, field, counts[field] if field in counts else array(kind, re.findall(r"\w+", dimensions)))
    return message


def flat(values):
    for one in values:
        if isinstance(one, (list, tuple)):
            yield from flat(one)
        else:
            yield one


def plain(thing):
    if hasattr(thing, "__slots__"):
        return {name: plain(getattr(thing, name)) for name in thing.__slots__}
    if isinstance(thing, (list, tuple)):
        return [plain(one) for one in flat(thing)]
    if isinstance(thing, bytes):
        return list(thing)
    if isinstance(thing, float) and not math.isfinite(thing):
        return None
    return thing


def main():
    for name in sorted(FIELDS):
        booleans = [field for kind, field, dimensions in FIELDS[name] if kind == "boolean" and dimensions]
        for _ in range(20):
            data = filled(name).encode()
            message = getattr(plumb, name).decode(data)
            for field in booleans:  # which lcm-gen leaves as numbers
                setattr(message, field, [bool(one) for one in getattr(message, field)])
            print(name, data.hex(), json.dumps(plain(message), ensure_ascii=False))


if __name__ == "__main__":
    main()
