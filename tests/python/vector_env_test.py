"""The vector environment has gymnasium's interface: https://gymnasium.farama.org/api/vector/"""
import unittest

import numpy
import plumbline
from common import Test, robot
from plumbline._native import TaskBatch


def played(env, steps, seed=1):
    observations, _ = env.reset(seed=seed)
    random, said = numpy.random.default_rng(1), [observations]
    for _ in range(steps):
        said += env.step(random.uniform(-1, 1, env.action_space.shape))[:4]
    return said


class VectorEnvTest(Test):
    def test_spaces_and_shapes(self):
        env = plumbline.VectorEnv(robot("hopper/gym.toml"), 7)
        self.assertEqual((env.num_envs, env.single_action_space.shape, env.action_space.shape), (7, (3,), (7, 3)))
        self.assertEqual((env.single_observation_space.shape, env.observation_space.shape), ((11,), (7, 11)))
        self.assertEqual((env.metadata["autoreset_mode"], env.render_mode, env.unwrapped), ("NextStep", None, env))
        observations, infos = env.reset(seed=1)
        self.assertTrue(env.observation_space.contains(observations))
        self.assertEqual(infos, {})
        action = env.action_space.sample()
        self.assertTrue(env.action_space.contains(action))
        self.assertFalse(env.action_space.contains(action * 5))
        observations, rewards, terminations, truncations, infos = env.step(action)
        self.assertEqual([a.dtype for a in (observations, rewards, terminations, truncations)],
                         [numpy.float32, numpy.float64, numpy.bool_, numpy.bool_])
        self.assertEqual([a.shape for a in (observations, rewards, terminations, truncations)], [(7, 11), (7,), (7,), (7,)])
        env.close()

    def test_next_step_resets_with_the_step_after(self):
        env = plumbline.VectorEnv(robot("hopper/gym.toml"), 20)
        env.reset(seed=1)
        over = numpy.zeros(20, bool)
        ended = 0
        for _ in range(400):
            observations, rewards, terminations, truncations, infos = env.step(numpy.ones((20, 3)))
            numpy.testing.assert_array_equal(rewards[over], 0)
            self.assertFalse((terminations | truncations)[over].any())
            over = terminations | truncations
            if over.any():
                numpy.testing.assert_array_equal(infos["_episode"], over)
                self.assertTrue((infos["episode"]["l"][over] > 1).all())
                ended += over.sum()
            else:
                self.assertEqual(infos, {})
        self.assertGreater(ended, 40)

    def test_same_step_resets_at_once_and_has_the_same_episodes(self):
        ends = {}
        for mode in ("NextStep", "SameStep"):
            env = plumbline.VectorEnv(robot("hopper/gym.toml"), 5, autoreset=mode)
            env.reset(seed=2)
            ends[mode] = [[] for _ in range(5)]
            for _ in range(300):
                observations, _, terminations, truncations, infos = env.step(numpy.full((5, 3), 0.5))
                for i in numpy.flatnonzero(terminations | truncations):
                    final = infos["final_obs"][i] if mode == "SameStep" else observations[i]
                    ends[mode][i].append((infos["episode"]["l"][i], infos["episode"]["r"][i], *final))
        for first, second in zip(ends["NextStep"], ends["SameStep"]):
            self.assertGreater(len(first), 3)
            self.assertEqual(first, second[:len(first)])

    def test_time_limit_truncates(self):
        env = plumbline.VectorEnv(robot(), 2)
        env.reset(seed=1)
        for step in range(200):
            _, _, terminations, truncations, infos = env.step(numpy.zeros((2, 1)))
            self.assertEqual((terminations.any(), truncations.all()), (False, step == 199))
        numpy.testing.assert_array_equal(infos["episode"]["l"], 200)

    def test_the_same_bits_for_any_number_of_threads(self):
        hopper = robot("hopper/gym.toml")
        one = played(plumbline.VectorEnv(hopper, 33, threads=1), 60)
        for env in (plumbline.VectorEnv(hopper, 33, threads=4), plumbline.VectorEnv(hopper, 33, plumbline.prior(hopper))):
            for ours, same in zip(played(env, 60), one, strict=True):
                numpy.testing.assert_array_equal(ours, same)
        self.assertFalse(numpy.array_equal(played(plumbline.VectorEnv(hopper, 33), 1, seed=2)[0], one[0]))

    def test_other_threads_run_while_it_is_made(self):
        self.others_run_during(TaskBatch, robot("hopper/gym.toml"), 8000)

    def test_copies_unless_told_otherwise(self):
        env = plumbline.VectorEnv(robot(), 3)
        first, _ = env.reset(seed=1)
        self.assertFalse(numpy.shares_memory(first, env.step(numpy.zeros((3, 1)))[0]))
        env = plumbline.VectorEnv(robot(), 3, copy=False)
        first, _ = env.reset(seed=1)
        self.assertTrue(numpy.shares_memory(first, env.step(numpy.zeros((3, 1)))[0]))

    def test_arguments_that_are_wrong_are_named(self):
        pendulum = robot()
        env = plumbline.VectorEnv(pendulum, 2)
        self.refused("reset has not been called", env.step, numpy.zeros((2, 1)), error=RuntimeError)
        env.reset()
        self.refused("actions: has shape (2,), needs (2, 1)", env.step, numpy.zeros(2))
        self.refused("actions: is not finite", env.step, [[numpy.nan], [0]])
        self.refused("options: knows no 'low'", env.reset, options={"low": 1})
        self.refused("num_envs: is 0", plumbline.VectorEnv, pendulum, 0)
        self.refused("autoreset: is 'Never'", plumbline.VectorEnv, pendulum, 2, autoreset="Never")
        self.refused("distribution: is of robot 'hopper'", plumbline.VectorEnv, pendulum, 2, plumbline.prior(robot("hopper")))


if __name__ == "__main__":
    unittest.main()
