#!/usr/bin/env python3
"""sign.py KEYFILE ROBOT BUS CHANNEL HEX: the sealed message HEX with its signature, the last 32 bytes, by hashlib."""
import hashlib
import pathlib
import sys

key = bytes.fromhex(pathlib.Path(sys.argv[1]).read_text())
message = bytes.fromhex(sys.argv[5])[:-32]
words = [word.encode() for word in sys.argv[2:5]]
signature = hashlib.blake2b(b"\0".join([*words, message]), key=key, digest_size=32).digest()
sys.stdout.write((message + signature).hex())
