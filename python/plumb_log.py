"""Reads LCM logs, without LCM and with nothing but Python's standard library.

    import sys
    sys.path += ["python", "build/lcmtypes/python"]  # ninja -C build plumb_lcmtypes_python
    from plumb_log import read_log
    for message in read_log("run.lcmlog", channels=["ROBOT_STATE"]):
        state = message.decode()
        print(message.seconds, state.q, state.v)

`python3 plumb_log.py LOG` prints what is in a log.
"""
import importlib
import pkgutil
import struct
import sys

HEAD = struct.Struct(">IqqII")  # sync word, number, time of reception, length of channel, length of data
SYNC = 0xEDA1DA01
LONGEST_CHANNEL, LONGEST_DATA = 1000, 64 << 20
SEAL = 72  # bytes behind each message of Plumbline's processes: docs/security.md
SEAL_BEGINS = b"PLUMSEAL"


class DamagedLog(ValueError):
    """A file that is no LCM log, or from some byte on none."""


class Message:
    """One message of a log.

    utime    when it was received [us]
    seconds  the same from the log's first message on
    channel  its name
    data     its bytes, without the seal
    sealed   its bytes as they were received
    """

    def __init__(self, utime, seconds, channel, sealed):
        self.utime, self.seconds, self.channel, self.sealed = utime, seconds, channel, sealed
        has_seal = sealed[-SEAL:].startswith(SEAL_BEGINS) and len(sealed) >= SEAL
        self.data = sealed[:-SEAL] if has_seal else sealed

    def decode(self, package="plumb"):
        """An object of the generated type that the message says it is. ValueError if it does not decode: unknown, cut
        short, or with counts that do not fit its length."""
        message_type = types(package).get(self.data[:8])
        if message_type is None:
            raise ValueError(f"{self.channel}: of no type of package {package}")
        try:
            return message_type.decode(self.data)
        except (ValueError, struct.error, IndexError, MemoryError, OverflowError) as error:
            raise ValueError(f"{self.channel}: a {message_type.__name__} that does not decode") from error


_types = {}


def types(package="plumb"):
    """The types of a package that lcm-gen has made, by the eight bytes that their messages begin with."""
    if package not in _types:
        modules = importlib.import_module(package)
        found = {}
        for module in pkgutil.iter_modules(modules.__path__):
            message_type = getattr(importlib.import_module(f"{package}.{module.name}"), module.name)
            found[message_type._get_packed_fingerprint()] = message_type
        _types[package] = found
    return _types[package]


def read_log(file, channels=None):
    """Yields the messages of a log in its order, or those of some channels. One that is cut off at the end, because the
    logger was killed, is not among them. DamagedLog names the file and the byte from which on it is none."""
    begin = None
    with open(file, "rb") as stream:
        position = 0
        while len(head := stream.read(HEAD.size)) == HEAD.size:
            sync, _, utime, channel_length, data_length = HEAD.unpack(head)
            if sync != SYNC or not 0 < channel_length <= LONGEST_CHANNEL or data_length > LONGEST_DATA:
                raise DamagedLog(f"{file}: is no LCM log" if position == 0 else f"{file}: damaged at byte {position}")
            body = stream.read(channel_length + data_length)
            if len(body) < channel_length + data_length:
                return
            position += HEAD.size + len(body)
            begin = utime if begin is None else begin
            channel = body[:channel_length].decode("utf-8", "replace")
            if channels is None or channel in channels:
                yield Message(utime, (utime - begin) * 1e-6, channel, body[channel_length:])


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: plumb_log.py LOG")
    counts, seconds = {}, 0
    try:
        for message in read_log(sys.argv[1]):
            number, size = counts.get(message.channel, (0, 0))
            counts[message.channel] = number + 1, size + len(message.data)
            seconds = max(seconds, message.seconds)
    except (OSError, DamagedLog) as error:
        sys.exit(f"plumb_log.py: {error}")
    for channel, (number, size) in sorted(counts.items()):
        print(f"{channel!r:30} {number:9} messages {size:12} bytes")
    print(f"{seconds:.3f} s")


if __name__ == "__main__":
    main()
