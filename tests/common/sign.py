#!/usr/bin/env python3
"""sign.py KEYFILE CHANNEL HEX: the encoded message HEX with its signature, the last 32 bytes, by hashlib."""
import hashlib
import pathlib
import sys

key = bytes.fromhex(pathlib.Path(sys.argv[1]).read_text())
message = bytes.fromhex(sys.argv[3])[:-32]
signature = hashlib.blake2b(sys.argv[2].encode() + b"\0" + message, key=key, digest_size=32).digest()
sys.stdout.write((message + signature).hex())
