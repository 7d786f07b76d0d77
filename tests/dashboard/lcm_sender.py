"""Says messages on LCM as LCM says them, by nothing but Python's standard library: each in one datagram."""
import os
import socket
import struct


class Sender:
    """A group and a port of its own, so that tests may run side by side."""

    def __init__(self):
        self.group, self.port = "239.255.76.62", 20000 + os.getpid() % 12000
        self.url = f"udpm://{self.group}:{self.port}?ttl=0&recv_buf_size=2097152"
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self.number = 0

    def say(self, channel, message):
        """@param message of lcm-gen's Python, or bytes."""
        self.number += 1
        content = message if isinstance(message, bytes) else message.encode()
        self.socket.sendto(struct.pack(">II", 0x4C433032, self.number) + channel.encode() + b"\0" + content, (self.group, self.port))
