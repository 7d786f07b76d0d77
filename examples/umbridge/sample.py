#!/usr/bin/python3
"""Samples the likelihood that `plumb serve-model` serves, by random-walk Metropolis, and compares with what Plumbline has found:

    sample.py http://127.0.0.1:4242 table.json

table.json is what `plumb export-model --randomisation` has written of the posterior: the walk begins at its mean, with steps of its
covariance. The prior is flat. Python's standard library is the client here, so that every byte of the protocol can be seen;
umbridge.HTTPModel, and what PyMC and others have for UM-Bridge, does the same."""
import json
import sys
import urllib.request

import numpy


def ask(url, path, **request):
    data = json.dumps(request).encode()
    with urllib.request.urlopen(urllib.request.Request(url + path, data)) as answer:
        return json.load(answer)


def main():
    url, table = sys.argv[1], json.load(open(sys.argv[2]))
    mean, covariance = numpy.array(table["mean"]), numpy.array(table["covariance"])

    def log_likelihood(parameters):
        return ask(url, "/Evaluate", name="log_likelihood", input=[parameters.tolist()], config={})["output"][0][0]

    random = numpy.random.default_rng(1)
    steps = numpy.linalg.cholesky(covariance) * 2.38 / len(mean) ** 0.5  # Roberts, Gelman, Gilks 1997
    here, value, walk, accepted = mean, log_likelihood(mean), [], 0
    for _ in range(2000):
        there = here + steps @ random.standard_normal(len(mean))
        other = log_likelihood(there)
        if numpy.log(random.random()) < other - value:
            here, value, accepted = there, other, accepted + 1
        walk.append(here)
    print(f"{'':16}{'Metropolis':>22}{table['source']:>22}")
    for name, *numbers in zip(table["names"], numpy.mean(walk, 0), numpy.std(walk, 0), mean, table["sd"]):
        print("{:16}{:>12.3f} ± {:.2g}{:>15.3f} ± {:.2g}".format(name, *numbers))
    print(f"{accepted / len(walk):.0%} accepted")


main()
