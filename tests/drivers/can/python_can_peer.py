"""Answers each frame it receives by multicast: same data reversed, id + 1, remote frames by data frames.

usage: python_can_peer.py GROUP PORT   (ends after a frame with id 0x7FF, or 60 s without any)
"""
import sys

import can

bus = can.Bus(interface="udp_multicast", channel=sys.argv[1], port=int(sys.argv[2]), hop_limit=0, fd=True)
bus.send(can.Message(arbitration_id=0x001, is_extended_id=False, data=b"ready"))
while True:
    message = bus.recv(60)
    if message is None or message.arbitration_id == 0x7FF:
        break
    if message.arbitration_id % 2 == 1:
        continue  # our own: python-can hears itself
    bus.send(can.Message(arbitration_id=message.arbitration_id + 1, is_extended_id=message.is_extended_id,
                         is_fd=message.is_fd, bitrate_switch=message.bitrate_switch,
                         data=bytes(message.data)[::-1] if not message.is_remote_frame else b"remote"))
bus.shutdown()
