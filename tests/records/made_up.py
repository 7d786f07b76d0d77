"""Messages of every type in lcmtypes/, with values that are made up: what its .lcm file says is in them, and what JSON must say of
them, both from that file alone."""
import itertools
import math
import re
import struct

TEXTS = ["", "plain", "it says \"no\"\n\\ \t\u00e4\u20ac", "</script>"]
FLOATS = [0.1, -2.5, math.nan, 1e-300, math.inf, 1 / 3, -0.0, 12345678.9]
RANGES = {"int8_t": 7, "int16_t": 15, "int32_t": 31, "int64_t": 63}


def fields_of(file):
    """[(type, name, [dimensions])] of its struct, constants and comments left out."""
    text = re.sub(r"//[^\n]*", "", file.read_text())
    body = text[text.index("{") + 1:text.rindex("}")]
    found = []
    for line in filter(None, (line.strip() for line in body.split(";"))):
        if line.startswith("const "):
            continue
        kind, name, dimensions = re.fullmatch(r"([\w.]+)\s+(\w+)((?:\s*\[\w+\])*)", line).groups()
        found.append((kind, name, re.findall(r"\w+", dimensions)))
    return found


def single(value):
    return struct.unpack("f", struct.pack("f", value))[0]


class MadeUp:
    """@param types {"robot_state_t": its .lcm file}. @param package lcm-gen's Python."""

    def __init__(self, types, package):
        self.fields = {name: fields_of(file) for name, file in types.items()}
        self.package = package
        self.numbers = itertools.count()

    def scalar(self, kind):
        number = next(self.numbers)
        if kind in RANGES:
            bits = RANGES[kind]
            return [number % (1 << bits), 2**bits - 1, -2**bits, 0, 1][number % 5]
        if kind == "byte":
            return number * 37 % 256
        if kind == "boolean":
            return number % 2 == 1
        if kind == "string":
            return TEXTS[number % len(TEXTS)]
        if kind == "float":
            return single(FLOATS[number % len(FLOATS)])
        return FLOATS[number % len(FLOATS)] * (1 + number % 7)

    def message(self, kind, count):
        """@param count of the elements of its arrays. @return the message, and its JSON."""
        message, json = getattr(self.package, kind)(), {}
        counts = {name for _, _, dimensions in self.fields[kind] for name in dimensions if not name.isdigit()}
        for type_, name, dimensions in self.fields[kind]:
            if name in counts:
                value, said = count, count
            else:
                value, said = self.array(type_, [int(one) if one.isdigit() else count for one in dimensions], count)
                said = flat(said) if dimensions else said
                if type_ == "byte" and dimensions:
                    value = bytes(value)
            setattr(message, name, value)
            json[name] = said
        return message, json

    def array(self, kind, dimensions, count):
        """@return what is in the message, and in JSON."""
        if dimensions:
            all_ = [self.array(kind, dimensions[1:], count) for _ in range(dimensions[0])]
            return [value for value, _ in all_], [said for _, said in all_]
        if kind.split(".")[-1] in self.fields:
            return self.message(kind.split(".")[-1], count)
        value = self.scalar(kind)
        # A float is said by the shortest digits that read back as it.
        said = Single(value) if kind == "float" else value
        return value, None if isinstance(value, float) and not math.isfinite(value) else said


class Single(float):
    """A float of four bytes: equal to a number that is nearest to it among these."""

    def __eq__(self, other):
        return isinstance(other, (int, float)) and struct.pack("f", self) == struct.pack("f", other)

    def __ne__(self, other):
        return not self == other

    __hash__ = float.__hash__


def flat(values):
    return [one for value in values for one in (flat(value) if isinstance(value, list) else [value])]
