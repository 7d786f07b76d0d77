#!/usr/bin/env python3
"""What LCM's socket and that of a udp: bus let in: `plumb record` and a listener to a bus in a network of their own, on
whose wire (a tap interface) anything can be put. Arguments: the programs plumb and hear_bus. Exit status 77 where nobody may make a network, or the machine has no tap interfaces.
"""
import fcntl
import os
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile

GROUP, OTHER_GROUP, PORT = "239.255.76.67", "239.255.76.68", 7667
WIRE, OURS, STRANGER = "tap0", "10.9.0.1", "10.9.0.2"


def message(channel, data=b"x"):
    return struct.pack(">II", 0x4C433032, 1) + channel.encode() + b"\0" + data


def open_wire():
    """@return the wire's other end: what is written to it arrives at the machine, to which multicast is routed."""
    try:
        wire = os.open("/dev/net/tun", os.O_RDWR)
        tap_without_header = 0x0002 | 0x1000
        fcntl.ioctl(wire, 0x400454CA, struct.pack("16sH", WIRE.encode(), tap_without_header))
    except OSError as error:
        print(f"skipped: no tap interface: {error}")
        sys.exit(77)
    for command in ("link set lo up", f"addr add {OURS}/24 dev {WIRE}", f"link set {WIRE} up",
                    f"route add 224.0.0.0/4 dev {WIRE}"):
        subprocess.run(["ip", *command.split()], check=True)
    return wire


def checksum(data):
    total = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def send_from_outside(wire, source, to, payload):
    """An Ethernet frame as a neighbour sends it, with an IP header of its choice."""
    address = socket.inet_aton(to)
    udp = struct.pack(">HHHH", 40000, PORT, 8 + len(payload), 0) + payload
    header = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 1, 17, 0, socket.inet_aton(source), address)
    header = header[:10] + struct.pack(">H", checksum(header)) + header[12:]
    multicast = b"\x01\x00\x5e" + bytes([address[1] & 0x7F]) + address[2:]
    os.write(wire, multicast + b"\x02\x00\x00\x00\x00\x01" + b"\x08\x00" + header + udp)


def send_from_here(to, payload):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.sendto(payload, (to, PORT))


def channels(log):
    """Of an LCM log."""
    found, data = set(), log.read_bytes()
    while len(data) >= 28:
        sync, _, _, name, size = struct.unpack(">IqqII", data[:28])
        assert sync == 0xEDA1DA01
        found.add(data[28:28 + name].decode())
        data = data[28 + name + size:]
    return found


def recorded(plumb, wire, ttl, folder):
    """@return the channels that are recorded of everything that is sent."""
    log = pathlib.Path(folder) / f"ttl{ttl}.lcmlog"
    url = f"udpm://{GROUP}:{PORT}?ttl={ttl}"
    with subprocess.Popen([plumb, "record", str(log), "--lcm-url", url], stderr=subprocess.PIPE, text=True) as recorder:
        line = recorder.stderr.readline()
        assert "recording to" in line, line
        send_from_outside(wire, STRANGER, GROUP, message("OUTSIDE"))
        send_from_outside(wire, "127.0.0.1", GROUP, message("OUTSIDE_AS_LOOPBACK"))
        send_from_outside(wire, STRANGER, OTHER_GROUP, message("OUTSIDE_OTHER_GROUP"))
        send_from_here("127.0.0.1", message("UNICAST_TO_LOOPBACK"))
        send_from_here(OURS, message("UNICAST_TO_ADDRESS"))
        send_from_here(OTHER_GROUP, message("OTHER_GROUP"))
        send_from_here(GROUP, message("INSIDE"))
        while b"END" not in log.read_bytes():
            assert recorder.poll() is None
            send_from_here(GROUP, message("END", bytes(8192)))
        recorder.terminate()
        recorder.communicate()
        assert recorder.returncode == 0, recorder.returncode
    return channels(log) - {"LCM_SELF_TEST", "END"}


def frame(number):
    """A standard CAN frame without data, as python-can's udp_multicast sends it: a msgpack map of 11 pairs."""
    def text(word):
        return bytes([0xA0 | len(word)]) + word.encode()
    values = {"timestamp": b"\xcb" + struct.pack(">d", 0), "arbitration_id": b"\xcd" + struct.pack(">H", number),
              "is_extended_id": b"\xc2", "is_remote_frame": b"\xc2", "is_error_frame": b"\xc2", "channel": b"\xc0", "dlc": b"\x00",
              "data": b"\xc4\x00", "is_fd": b"\xc2", "bitrate_switch": b"\xc2", "error_state_indicator": b"\xc2"}
    return b"\x8b" + b"".join(text(name) + value for name, value in values.items())


def heard_on_the_bus(listener, wire):
    """@return the frames that a udp: bus hands out of everything that is sent."""
    with subprocess.Popen([listener, f"udp:{GROUP}:{PORT}"], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline() == "listening\n"
        send_from_outside(wire, STRANGER, GROUP, frame(1))
        send_from_outside(wire, "127.0.0.1", GROUP, frame(2))
        send_from_outside(wire, OURS, GROUP, frame(3))
        send_from_here(OURS, frame(4))
        send_from_here(OTHER_GROUP, frame(5))
        send_from_here(GROUP, frame(6))
        send_from_here(GROUP, frame(0x7FF))
        return set(program.communicate()[0].split())


def main():
    wire = open_wire()
    # The other group has a member on this machine, too: the kernel takes what is sent to it.
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as member:
        member.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                          socket.inet_aton(OTHER_GROUP) + socket.inet_aton(OURS))
        for ttl, expected in ((0, {"INSIDE"}), (1, {"INSIDE", "OUTSIDE"})):
            found = recorded(sys.argv[1], wire, ttl, folder)
            print(f"TTL {ttl}: {', '.join(sorted(found))}")
            if found != expected:
                sys.exit(f"expected {', '.join(sorted(expected))}")
        found = heard_on_the_bus(sys.argv[2], wire)
        print(f"bus: {', '.join(sorted(found))}")
        if found != {"006#"}:
            sys.exit("expected 006#")


OWN_NETWORK = ["unshare", "-rn"]
if sys.argv[3:] == ["inside"]:
    main()
elif (refused := subprocess.run([*OWN_NETWORK, "true"], capture_output=True, text=True)).returncode != 0:
    print(f"skipped: no network of one's own: {refused.stderr.strip()}")
    sys.exit(77)
else:
    sys.exit(subprocess.run([*OWN_NETWORK, sys.executable, *sys.argv, "inside"]).returncode)
