"""Policies that `plumb train` has trained, from Python."""
import csv
import re
import unittest

import numpy
import plumbline
from common import ROBOTS, Test, robot


class PolicyTest(Test):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.pendulum = robot()

    def train(self):
        return self.plumb("train", ROBOTS / "pendulum", "--steps", 20000, "--seed", 3, "--output", "policy.onnx", "--checkpoint",
                          "policy.checkpoint", "--threads", 1)

    def test_the_command_s_bits(self):
        said = self.train()
        policy = plumbline.load_policy(self.folder / "policy.onnx", self.pendulum)
        # as `plumb sim` plays it
        self.plumb("sim", ROBOTS / "pendulum", "--policy", "policy.onnx", "--episodes", 2, "--seed", 5, "--csv", "sim.csv")
        with open(self.folder / "sim.csv") as stream:
            q = [float(row["q/pivot"]) for row in csv.DictReader(stream)]
        episodes = plumbline.play(self.pendulum, policy, episodes=2, seed=5)
        numpy.testing.assert_array_equal(numpy.concatenate([episode["q"][:, 0] for episode in episodes]), q)
        # step by step
        simulation = plumbline.Simulation(self.pendulum, 2)
        simulation.reset(seed=5)
        for step in range(200):
            numpy.testing.assert_array_equal(simulation.q[:, 0], [episode["q"][step, 0] for episode in episodes])
            simulation.step(policy(simulation.observations))
        # as `plumb train` has evaluated it
        returns = policy.evaluate(episodes=100, seed=3)
        mean, tenth, worst = map(float, re.search(r"(\S+) mean, (\S+) 10th percentile, (\S+) worst", said).groups())
        numpy.testing.assert_allclose([returns.mean(), numpy.quantile(returns, 0.1), returns.min()], [mean, tenth, worst],
                                      atol=0.0501)
        for threads in (1, 3):
            numpy.testing.assert_array_equal(policy.evaluate(episodes=40, seed=3, threads=threads), returns[:40])
        # the same simulators as in the vector environment
        env = plumbline.VectorEnv(self.pendulum, 30)
        observations, _ = env.reset(seed=3)
        sums = numpy.zeros(30)
        for _ in range(self.pendulum.steps):
            observations, rewards, _, _, infos = env.step(policy(observations))
            sums += rewards
        numpy.testing.assert_allclose(sums, returns[:30], rtol=1e-3)
        numpy.testing.assert_allclose(infos["episode"]["r"], sums)
        # from a posterior
        narrow = policy.evaluate(plumbline.prior(self.pendulum), episodes=100, seed=3)
        numpy.testing.assert_array_equal(narrow, returns)

        observations = numpy.random.default_rng(1).standard_normal((50, 3)).astype(numpy.float32)
        means = policy(observations)
        self.assertEqual((means.shape, means.dtype), ((50, 1), numpy.float32))
        numpy.testing.assert_array_equal(policy(observations[7]), means[7])
        samples = policy.sample(observations, seed=1)
        numpy.testing.assert_array_equal(policy.sample(observations[:5], seed=1), samples[:5])
        self.assertLess(abs((samples - means) / policy.sd).max(), 5)
        self.refused("observations: has shape (2,), needs (any, 3) or (3,)", policy, [1, 2])
        self.refused("observations: is not finite", policy, [1, 2, numpy.nan])
        self.refused("episodes: is -1", policy.evaluate, episodes=-1)
        self.refused("distribution: is of robot 'hopper'", policy.evaluate, plumbline.prior(robot("hopper")))
        self.refused("policy: is another robot's", plumbline.play, robot("hopper"), policy)
        self.refused("policy, random: exclude each other", plumbline.play, self.pendulum, policy, random=True)
        self.refused("is for another robot", plumbline.load_policy, self.folder / "policy.onnx", robot("hopper"))

    def test_evaluation_can_be_interrupted(self):
        self.train()
        policy = plumbline.load_policy(self.folder / "policy.onnx", self.pendulum)
        self.can_be_interrupted(policy.evaluate, episodes=100_000, threads=2)

    def test_files_that_are_no_policy(self):
        self.refused("none.onnx: there is no such policy", plumbline.load_policy, "none.onnx", self.pendulum)
        (self.folder / "text.onnx").write_text("not a policy")
        self.refused("text.onnx: is neither a trainer's checkpoint nor an ONNX model", plumbline.load_policy,
                     self.folder / "text.onnx", self.pendulum)


if __name__ == "__main__":
    unittest.main()
