#!/usr/bin/env python3
"""Prints messages of an LCM log as lines of JSON, decoded by lcm-gen's Python types: what the page must show, by another way
than the gateway's; a posterior with its quantiles and correlations. Arguments: folder of the Python types, log."""
import base64
import json
import math
import pathlib
import statistics
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


def rows(values, count):
    return [values[i * len(values) // count:(i + 1) * len(values) // count] for i in range(count)]


def quantile(parts, probability):
    """Of a mixture of (weight, mean, sd), by halving."""
    low, high = min(m - 10 * s for _, m, s in parts), max(m + 10 * s for _, m, s in parts)
    for _ in range(100):
        middle = (low + high) / 2
        below = sum(w * statistics.NormalDist(m, s).cdf(middle) for w, m, s in parts)
        low, high = (middle, high) if below < probability else (low, middle)
    return middle


def posterior(message):
    """Of each parameter, in physical units, what lies below 2.5, 25, 50, 75, 97.5 %; and the correlations of coordinates."""
    n, weights = message.num_parameters, message.weight
    means = rows(message.mean, message.num_components)
    covariances = [rows(one, n) for one in rows(message.covariance, message.num_components)]
    quantiles = []
    for i in range(n):
        to_physical = {message.LINEAR: float, message.LOG: math.exp}[message.coordinate[i]]
        parts = [(w, mean[i], math.sqrt(covariance[i][i])) for w, mean, covariance in zip(weights, means, covariances)]
        quantiles.append([to_physical(quantile(parts, p)) for p in (.025, .25, .5, .75, .975)])
    middle = [sum(w * mean[i] for w, mean in zip(weights, means)) for i in range(n)]
    whole = [[sum(w * (c[i][j] + (m[i] - middle[i]) * (m[j] - middle[j])) for w, m, c in zip(weights, means, covariances))
              for j in range(n)] for i in range(n)]
    return {"quantiles": quantiles,
            "correlation": [[whole[i][j] / math.sqrt(whole[i][i] * whole[j][j]) for j in range(n)] for i in range(n)]}


def main():
    sys.path.insert(0, sys.argv[1])
    import plumb
    types = {kind._get_packed_fingerprint(): kind for kind in vars(plumb).values() if isinstance(kind, type)}
    for utime, channel, data in events(sys.argv[2]):
        message = types[data[:8]].decode(data)
        line = {"received": utime, "channel": channel, "message": plain(message)}
        if channel == "PARAMETER_DISTRIBUTION":
            line["posterior"] = posterior(message)
        print(json.dumps(line))


main()
