"""Motions from files and arrays, and calibration with the bits of the command."""
import csv
import json
import re
import unittest

import numpy
import plumbline
from common import ROBOTS, Test, robot

OPTIONS = {"seed": 4, "horizons": [1, 5], "residual": False}
FLAGS = ["--seed", 4, "--horizons", "1,5", "--no-residual"]


def without_run(file):
    """A posterior.json's text, but for its last object, what may differ between runs, and the commits of module and command, which
    may have been built one after the other."""
    return re.sub(r'"plumbline": ".*?"', "", file.read_text().partition('"run":')[0])


class CalibrationTest(Test):
    def setUp(self):
        super().setUp()
        self.pendulum = robot()
        self.plumb("sim", ROBOTS / "pendulum", "--random", "--episodes", 2, "--noise", 0.003, "--csv", "motion.csv", "--set",
                   "gravity=10.4")

    def arrays(self):
        with open(self.folder / "motion.csv") as stream:
            rows = list(csv.DictReader(stream))
        column = lambda name: numpy.array([float(row[name]) for row in rows])
        return {"t": column("t"), "q": column("q/pivot")[:, None], "v": column("v/pivot")[:, None],
                "u": column("u/pivot")[:, None], "terminated": column("terminated") > 0, "truncated": column("truncated") > 0}

    def test_the_same_bytes_as_the_command_from_csv_and_from_arrays(self):
        self.plumb("calibrate", ROBOTS / "pendulum", "--csv", "motion.csv", "--output", "command.json", *FLAGS)
        expected = without_run(self.folder / "command.json")
        motion = plumbline.read_csv(self.folder / "motion.csv", self.pendulum)
        arrays = plumbline.motion(self.pendulum, **self.arrays(), name="motion.csv")
        for threads, given in ((1, motion), (2, arrays)):
            found = plumbline.calibrate(self.pendulum, given, threads=threads, **OPTIONS)
            found.save(self.folder / "ours.json")
            # The command was given the file by its name alone.
            ours = without_run(self.folder / "ours.json").replace(str(self.folder) + "/", "")
            self.assertEqual(ours, expected)
            self.assertEqual(json.loads(found.json())["run"]["command"], "plumbline.calibrate")
        self.assertEqual(found.names, ["gravity", "mass/pole", "length/pole"])
        self.assertTrue(numpy.all(found.lower < found.mean) and numpy.all(found.mean < found.upper))
        self.assertEqual(found.covariance.shape, (3, 3))
        self.assertEqual(found.samples.shape, (1000, 3))
        self.assertFalse(found.alarm)
        self.assertTrue(found.trustworthy, found.findings)

    def test_the_same_bytes_as_the_command_from_an_lcm_log(self):
        self.plumb("launch", ROBOTS / "pendulum", "--seed", 1, "--iterations", 1, "--bus", "loop:", "--output", "run", "--log",
                   "run.lcmlog")
        self.plumb("calibrate", ROBOTS / "pendulum", "--log", "run.lcmlog", "--output", "command.json", *FLAGS)
        motion = plumbline.read_lcm(self.folder / "run.lcmlog", self.pendulum)
        plumbline.calibrate(self.pendulum, [motion], **OPTIONS).save(self.folder / "ours.json")
        self.assertEqual(without_run(self.folder / "ours.json").replace(str(self.folder) + "/", ""),
                         without_run(self.folder / "command.json"))
        states = [message for message in plumbline.read_log(self.folder / "run.lcmlog", channels=["ROBOT_STATE"])]
        self.assertGreater(len(states), 100)
        self.assertEqual(len(states[0].decode().q), 1)

    def test_posteriors_in_and_out(self):
        motion = plumbline.motion(self.pendulum, **self.arrays())
        found = plumbline.calibrate(self.pendulum, motion, **OPTIONS)
        file = self.folder / "posterior.json"
        found.save(file)
        read, ours = plumbline.load_posterior(file, self.pendulum), found.distribution
        for name in ("weights", "means", "covariances", "mean", "sd"):
            numpy.testing.assert_array_equal(getattr(read, name), getattr(ours, name), name)
        samples = read.sample(5000, seed=1)
        numpy.testing.assert_array_equal(samples, ours.sample(5000, seed=1))
        numpy.testing.assert_array_equal(samples[:10], ours.sample(10, seed=1))
        numpy.testing.assert_allclose(samples.mean(axis=0), read.mean, atol=5 * numpy.max(read.sd) / 5000**0.5)
        numpy.testing.assert_allclose(samples.std(axis=0), read.sd, rtol=0.1)
        self.refused("is another robot's", plumbline.load_posterior, file, robot("hopper"), error=RuntimeError)
        self.refused("there is no such file", plumbline.load_posterior, f"{file}x", self.pendulum, error=RuntimeError)
        simulation = plumbline.Simulation(self.pendulum, 100)
        simulation.set_parameters(read.sample(100, seed=2))

    def test_motions_tell_what_they_have(self):
        arrays = self.arrays()
        motion = plumbline.motion(self.pendulum, **arrays)
        self.assertEqual((motion.name, motion.transitions, motion.dropped), ("arrays", 398, 0))
        episode = motion.episodes[1]
        numpy.testing.assert_array_equal(episode["q"], arrays["q"][200:399])
        numpy.testing.assert_array_equal(episode["next_v"], arrays["v"][201:400])
        late = 0.008 / self.pendulum.period  # of a control period the effort before still acts: simulation.latency
        before = numpy.concatenate([[[0]], arrays["u"][200:398]])
        numpy.testing.assert_allclose(episode["effort"], (1 - late) * arrays["u"][200:399] + late * before)
        self.assertEqual(repr(motion), "<Motion arrays: 398 transitions in 2 roll-outs>")

    def test_progress_may_end_it_and_others_run_meanwhile(self):
        motion = plumbline.motion(self.pendulum, **self.arrays())
        self.others_run_during(plumbline.motion, self.pendulum,
                               **{name: numpy.concatenate([column] * 100) for name, column in self.arrays().items()})
        told = []
        plumbline.calibrate(self.pendulum, motion, progress=lambda what, share: told.append(share), **OPTIONS)
        self.assertTrue(told and all(0 <= share <= 1 for share in told))

        def stop(what, share):
            raise KeyError("enough")
        self.refused("enough", plumbline.calibrate, self.pendulum, motion, progress=stop, error=KeyError)

    def test_arguments_that_are_wrong_are_named(self):
        good = self.arrays()

        def refused(words, error=ValueError, **changed):
            self.refused(words, plumbline.motion, self.pendulum, **(good | changed), error=error)

        refused("q: has shape (400,), needs (any, 1)", q=good["q"][:, 0])
        refused("v: is 399 x 1, needs 400 x 1", v=good["v"][1:])
        refused("u: has dtype object", u=None)
        refused("t: is inf in row 0", t=numpy.full(400, numpy.inf))
        refused("t: is 0 in row 1, as in the row before", t=numpy.zeros(400))
        refused("t: is not known in row 0", t=numpy.full(400, numpy.nan))
        refused("q: is 1e+200 in row 0", q=numpy.full((400, 1), 1e200))
        refused("terminated: has shape (3,), needs (400,)", terminated=[True] * 3)
        refused("next_q, next_v: give both or none", next_q=good["q"])
        refused("arrays: no transition can be used: its rows are 1 s apart", RuntimeError, t=numpy.arange(400.0))
        refused("arrays: no transition can be used", RuntimeError, **{name: column[:0] for name, column in good.items()})
        motion = plumbline.motion(self.pendulum, **good)
        for words, named in (("'laplac'", {"method": "laplac"}), ("'square'", {"discrepancy": "square"}),
                             ("horizons: is empty", {"horizons": []}), ("horizons: is 0", {"horizons": [0]}),
                             ("budget: is 1", {"budget": 1}), ("threads: is -1", {"threads": -1})):
            self.refused(words, plumbline.calibrate, self.pendulum, motion, **named)
        self.refused("motions: there is nothing", plumbline.calibrate, self.pendulum, [])
        self.refused("motions: has something else", plumbline.calibrate, self.pendulum, ["motion.csv"])
        self.refused("motions: is neither", plumbline.calibrate, self.pendulum, 1)
        self.refused("motion.csv:1: column 'q/pivot' is of no joint of robot 'hopper'", plumbline.read_csv,
                     self.folder / "motion.csv", robot("hopper"), error=RuntimeError)
        self.refused("motions: arrays is of another robot", plumbline.calibrate, robot("hopper"), motion)
        self.refused("is no LCM log", plumbline.read_lcm, self.folder / "motion.csv", self.pendulum, error=RuntimeError)


if __name__ == "__main__":
    unittest.main()
