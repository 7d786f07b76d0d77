#!/usr/bin/env python3
"""Prints messages of an LCM log as lines of JSON, decoded by lcm-gen's Python types: what the page must show, by another way
than the gateway's. Arguments: folder of the Python types, log, channels (none = all)."""
import base64
import json
import math
import pathlib
import struct
import sys

HEADER = struct.Struct(">IqqII")  # sync word, number, time [us], lengths of channel and data


def events(log):
    data = pathlib.Path(log).read_bytes()
    at = 0
    while at + HEADER.size <= len(data):
        sync, _, utime, channel_size, size = HEADER.unpack_from(data, at)
        assert sync == 0xEDA1DA01, f"{log}: no event at byte {at}"
        at += HEADER.size + channel_size + size
        yield utime, data[at - channel_size - size:at - size].decode(), data[at - size:at]


def plain(value):
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, (list, tuple, map)):  # booleans come as a map
        return [plain(one) for one in value]
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    return value


def main():
    sys.path.insert(0, sys.argv[1])
    import plumb
    types = {kind._get_packed_fingerprint(): kind for kind in vars(plumb).values() if isinstance(kind, type)}
    for utime, channel, data in events(sys.argv[2]):
        if not sys.argv[3:] or channel in sys.argv[3:]:
            message = types[data[:8]].decode(data)
            print(json.dumps({"received": utime, "channel": channel, "message": plain(message)}))


main()
