"""Plumbline: a simulator that is kept plumb with its robot, in Python.

    import plumbline
    robot = plumbline.load_robot("robots/pendulum")

Simulation   a robot's task, many times side by side           play            episodes, as `plumb sim` plays them
motion, read_csv, read_lcm   a robot's motion                  calibrate       which simulators could have produced it
prior, load_posterior        distributions of simulators       load_policy     a policy, to act and to be evaluated
VectorEnv    the task for reinforcement learning               read_log        any message of an LCM log

Arrays are numpy's. Quantities are in SI units: q [rad or m], v [rad/s or m/s], efforts [Nm or N]. All results are the same
bits for any number of threads, and as those of the command `plumb`. What is wrong with an argument is a ValueError that
names it, and one of another type, or a seed below 0, a TypeError; what is wrong with a file is a RuntimeError with the
message that the command prints. Files are named by a str or a pathlib.Path.
"""
from plumb_log import read_log

try:
    from ._native import (Calibration, Distribution, Motion, Parameter, Policy, Robot, Simulation, __version__, calibrate, load_policy,
                          load_posterior, load_robot, motion, play, prior, read_csv, read_lcm)
except ModuleNotFoundError as error:
    if error.name != "plumbline._native":
        raise
    raise ImportError("plumbline._native is not built, or for another Python: scripts/setup && scripts/build plumbline_native, then "
                      "PYTHONPATH=build/python /usr/bin/python3") from None
from .vector_env import Box, VectorEnv

__all__ = ["Box", "Calibration", "Distribution", "Motion", "Parameter", "Policy", "Robot", "Simulation", "VectorEnv", "calibrate",
           "load_policy", "load_posterior", "load_robot", "motion", "play", "prior", "read_csv", "read_lcm", "read_log"]
