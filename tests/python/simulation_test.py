"""Robots, batches of simulations, and episodes as the command plays them."""
import csv
import threading
import unittest

import numpy
import plumbline
from common import ROBOTS, Test, robot


def columns(file, prefix):
    """The numbers of a table's columns of that name, or that begin so, as the file has them."""
    with open(file) as stream:
        rows = list(csv.DictReader(stream))
    names = [name for name in rows[0] if name == prefix or prefix.endswith("/") and name.startswith(prefix)]
    return numpy.array([[float(row[name]) for name in names] for row in rows])


def rolled_out(simulation, actions):
    """All that a simulation does under actions (steps, count, actions), in a row."""
    said = [simulation.reset(seed=7).copy()]
    for action in actions:
        observations, rewards, terminated = simulation.step(action)
        said += [observations.copy(), rewards.copy(), terminated.copy(), simulation.q.copy(), simulation.v.copy()]
    return said


class RobotTest(Test):
    def test_tells_what_the_files_say(self):
        hopper = robot("hopper/gym.toml")
        self.assertEqual((hopper.name, hopper.task, hopper.steps, hopper.num_positions), ("hopper", "hopper", 1000, 6))
        self.assertEqual(hopper.actions, ["thigh", "leg", "foot"])
        self.assertEqual([p.name for p in hopper.parameters], ["mass/torso", "mass/thigh", "mass/leg", "mass/foot"])
        self.assertEqual(hopper.effort_limits.shape, (3,))
        self.assertEqual(len(hopper.observations), 11)

    def test_errors_are_the_command_s(self):
        self.refused("robots/none: there is no such robot", plumbline.load_robot, ROBOTS / "none", error=RuntimeError)
        (self.folder / "robot.toml").write_text("name = 1\n")
        self.refused("robot.toml:1:", plumbline.load_robot, self.folder, error=RuntimeError)


class PlayTest(Test):
    def test_the_same_bits_as_the_command(self):
        for name, flags, named in (("hopper/gym.toml", ["--random"], {"random": True}), ("pendulum", [], {}),
                                   ("quadruped", ["--random"], {"random": True})):
            self.plumb("sim", ROBOTS / name, "--episodes", 3, "--seed", 5, "--csv", "sim.csv", *flags)
            for threads in (1, 3):
                episodes = plumbline.play(robot(name), episodes=3, seed=5, threads=threads, **named)
                for column in ("t", "q", "v", "u", "reward", "terminated", "truncated"):
                    ours = numpy.concatenate([episode[column].reshape(len(episode["t"]), -1) for episode in episodes])
                    prefix = column + "/" if column in "qvu" else column
                    numpy.testing.assert_array_equal(ours, columns(self.folder / "sim.csv", prefix), f"{name} {column}")

    def test_parameters(self):
        pendulum = robot()
        heavy, = plumbline.play(pendulum, parameters=[12, 1, 1.1])
        self.plumb("sim", ROBOTS / "pendulum", "--set", "gravity=12", "mass/pole=1", "length/pole=1.1", "--csv", "sim.csv")
        numpy.testing.assert_array_equal(heavy["q"], columns(self.folder / "sim.csv", "q/"))
        self.refused("parameters: has shape (2,), needs (3,)", plumbline.play, pendulum, parameters=[1, 2])
        self.refused("mass/pole", plumbline.play, pendulum, parameters=[9.81, -1, 1])
        self.refused("episodes: is -1", plumbline.play, pendulum, episodes=-1)
        self.refused("threads: is -1", plumbline.play, pendulum, threads=-1)

    def test_can_be_interrupted(self):
        self.can_be_interrupted(plumbline.play, robot(), episodes=20_000, threads=2)


class SimulationTest(Test):
    def test_the_same_bits_as_an_episode_of_the_command(self):
        hopper = robot("hopper/gym.toml")
        episodes = plumbline.play(hopper, episodes=5, seed=3)
        simulation = plumbline.Simulation(hopper, 5)
        simulation.reset(seed=3)
        for step in range(min(len(episode["t"]) for episode in episodes)):
            numpy.testing.assert_array_equal(simulation.q, [episode["q"][step] for episode in episodes])
            numpy.testing.assert_array_equal(simulation.v, [episode["v"][step] for episode in episodes])
            simulation.step(numpy.zeros((5, 3), numpy.float32))
            numpy.testing.assert_array_equal(simulation.rewards, [episode["reward"][step] for episode in episodes])

    def test_the_same_bits_for_any_number_of_threads_and_companions(self):
        hopper = robot("hopper/gym.toml")
        actions = numpy.random.default_rng(1).uniform(-1, 1, (20, 101, 3)).astype(numpy.float32)
        one = rolled_out(plumbline.Simulation(hopper, 101, threads=1), actions)
        for threads in (2, 5):
            for ours, same in zip(rolled_out(plumbline.Simulation(hopper, 101, threads=threads), actions), one, strict=True):
                numpy.testing.assert_array_equal(ours, same)
        for ours, same in zip(rolled_out(plumbline.Simulation(hopper, 3), actions[:, :3]), one, strict=True):
            numpy.testing.assert_array_equal(ours, same[:3])

    def test_views_are_of_its_own_memory_and_read_only(self):
        simulation = plumbline.Simulation(robot(), 4)
        observations = simulation.reset(seed=1)
        kept = observations.copy()
        again, rewards, terminated = simulation.step(numpy.ones((4, 1), numpy.float32))
        self.assertTrue(numpy.shares_memory(observations, again))
        self.assertFalse(numpy.array_equal(observations, kept))
        self.assertEqual((again.dtype, rewards.dtype, terminated.dtype), (numpy.float32, numpy.float64, numpy.bool_))
        for view in (again, rewards, terminated, simulation.q, simulation.v):
            with self.assertRaises(ValueError):
                view[0] = 0
        del simulation  # what it has lent stays
        self.assertTrue(numpy.isfinite(again).all())

    def test_begins_where_it_is_told(self):
        simulation = plumbline.Simulation(robot(), 3)
        first = simulation.reset(seed=1, numbers=[4, 5, 6]).copy()
        numpy.testing.assert_array_equal(simulation.reset(seed=1, numbers=[6, 5, 4]), first[::-1])
        before = simulation.q.copy()
        simulation.reset(seed=2, where=[False, True, False])
        numpy.testing.assert_array_equal(simulation.q != before, [[False], [True], [False]])
        simulation.set_state([[0.1], [0.2], [0.3]], numpy.zeros((3, 1)))
        numpy.testing.assert_array_equal(simulation.q, [[0.1], [0.2], [0.3]])

    def test_each_has_its_own_parameters(self):
        pendulum = robot()
        simulation = plumbline.Simulation(pendulum, 2)
        simulation.set_parameters([[5, 1, 1], [15, 1, 1]])
        simulation.set_state([[1], [1]], [[0], [0]])
        simulation.step([[0], [0]])
        self.assertGreater(abs(simulation.v[1, 0]), 2.5 * abs(simulation.v[0, 0]))
        simulation.set_parameters([9, 1, 1])
        simulation.set_state([[1], [1]], [[0], [0]])
        simulation.step([[0], [0]])
        self.assertEqual(simulation.v[0, 0], simulation.v[1, 0])

    def test_arguments_that_are_wrong_are_named(self):
        pendulum = robot()
        simulation = plumbline.Simulation(pendulum, 2)
        for actions, words in (
                (numpy.zeros(2), "actions: has shape (2,), needs (2, 1)"),
                (numpy.zeros((2, 2)), "actions: has shape (2, 2), needs (2, 1)"),
                ([[numpy.nan], [0]], "actions: is not finite"),
                ([[numpy.inf], [0]], "actions: is not finite"),
                ([[1e300], [0]], "actions: is not finite"),  # as a float32
                (numpy.zeros((2, 1), complex), "actions: has dtype complex128"),
                ([["a"], ["b"]], "actions: has dtype <U1"),
                ([[None], [0]], "actions: has dtype object"),
                ([[0], [0, 1]], "actions: "),
                (None, "actions: has dtype object")):
            with numpy.errstate(over="ignore"):
                self.refused(words, simulation.step, actions)
        self.refused("parameters: row 1: ", simulation.set_parameters, [[9.81, 1, 1], [9.81, -1, 1]])
        self.refused("parameters: has shape (2,), needs (3,) or (2, 3)", simulation.set_parameters, [1, 2])
        self.refused("q: has shape (1, 1), needs (2, 1)", simulation.set_state, [[0]], [[0], [0]])
        self.refused("v: is not finite", simulation.set_state, [[0], [0]], [[0], [numpy.nan]])
        for numbers in ([0.5, 1], [-1, 1], [2**32, 1]):
            self.refused("numbers: ", simulation.reset, seed=1, numbers=numbers)
        self.refused("where: has shape (3,), needs (2,)", simulation.reset, seed=1, where=[True] * 3)
        self.refused("count: is 0", plumbline.Simulation, pendulum, 0)
        self.refused("threads: is 5000", plumbline.Simulation, pendulum, 1, threads=5000)
        self.refused("incompatible", simulation.reset, seed=-1, error=TypeError)

    def test_other_threads_run_meanwhile_and_may_not_interfere(self):
        hopper = robot("hopper/gym.toml")
        self.others_run_during(plumbline.Simulation, hopper, 4000)
        simulation = plumbline.Simulation(hopper, 20_000, threads=1)
        actions = numpy.zeros((20_000, 3), numpy.float32)
        at_work, counted, refused = threading.Event(), 0, 0

        def work():
            at_work.set()
            simulation.step(actions)
            at_work.clear()

        thread = threading.Thread(target=work)
        thread.start()
        while thread.is_alive():
            if at_work.is_set():
                counted += 1
                try:
                    simulation.reset(seed=1)
                except RuntimeError as error:
                    self.assertIn("another thread is at work", str(error))
                    refused += 1
        thread.join()
        self.assertGreater(counted, 10)
        self.assertGreater(refused, 10)


if __name__ == "__main__":
    unittest.main()
