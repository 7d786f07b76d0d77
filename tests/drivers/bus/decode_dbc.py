"""Decodes frames with a DBC file, by canmatrix: one line per frame, "ID name=value name=value ...".

usage: decode_dbc.py FILE.dbc FRAMES   (lines "ID HEXDATA"; ids in decimal, as in the DBC)
"""
import sys

import canmatrix.formats

matrix = next(iter(canmatrix.formats.loadp(sys.argv[1]).values()))
frames = {frame.arbitration_id.id: frame for frame in matrix.frames}
for line in open(sys.argv[2]):
    number, data = line.split()
    frame = frames[int(number)]
    data = bytes.fromhex(data)
    assert frame.size == len(data), (number, frame.size)
    decoded = frame.decode(data)
    print(number, *(f"{name}={float(signal.phys_value)!r}" for name, signal in sorted(decoded.items())))
