#!/usr/bin/env python3
"""Says ROBOT_STATE on LCM until it is ended, after 40 and 160 ms by turns, and of every fifth not the last byte. Of each message it
prints when it was said [s, monotonic], its size and whether it decodes. First the URL of LCM. Argument: folder of the Python types."""
import json
import sys
import time

import lcm_sender

sys.path.insert(0, sys.argv[1])
import plumb  # noqa: E402

lcm = lcm_sender.Sender()
print(lcm.url, flush=True)
sys.stdin.readline()
message = plumb.robot_state_t()
message.num_positions, message.num_velocities, message.valid = 1, 1, True
message.q, message.v, message.q_sd, message.v_sd, message.effort = [0.25], [0.5], [0.01], [0.1], [0.0]
due = time.monotonic()
while True:
    message.sequence += 1
    message.utime = 1_700_000_000_000_000 + 100_000 * message.sequence
    whole = message.sequence % 5 != 0
    content = message.encode() if whole else message.encode()[:-1]
    lcm.say("ROBOT_STATE", content)
    print(json.dumps([time.monotonic(), len(content), whole]), flush=True)
    due += 0.04 if message.sequence % 2 else 0.16
    time.sleep(max(0, due - time.monotonic()))
