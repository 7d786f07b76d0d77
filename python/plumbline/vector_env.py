"""The task for reinforcement learning, in the shape of gymnasium's vector environments, without needing gymnasium."""
from __future__ import annotations

from typing import Any

import numpy

from ._native import Distribution, Robot, TaskBatch

AUTORESET = ("NextStep", "SameStep")  # values of gymnasium.vector.AutoresetMode


class Box:
    """Arrays between two bounds: the part of gymnasium.spaces.Box that algorithms ask for.

    >>> Box(-1, 1, (3, 2)).sample().shape
    (3, 2)
    """

    def __init__(self, low: float, high: float, shape: tuple[int, ...], seed: int | None = None):
        self.shape, self.dtype = shape, numpy.dtype(numpy.float32)
        self.low, self.high = (numpy.full(shape, bound, self.dtype) for bound in (low, high))
        self._random = numpy.random.default_rng(seed)

    def seed(self, seed: int | None = None) -> None:
        """Of the random numbers of sample."""
        self._random = numpy.random.default_rng(seed)

    def sample(self) -> numpy.ndarray:
        """Uniform between the bounds, standard normal where there are none."""
        if numpy.isfinite(self.low).all() and numpy.isfinite(self.high).all():
            return self._random.uniform(self.low, self.high).astype(self.dtype)
        return self._random.standard_normal(self.shape).astype(self.dtype)

    def contains(self, x: Any) -> bool:
        """Whether it is an array of this shape, within the bounds."""
        x = numpy.asarray(x)
        return x.shape == self.shape and bool(numpy.all(x >= self.low) and numpy.all(x <= self.high))

    def __repr__(self) -> str:
        return f"Box({self.low.flat[0]}, {self.high.flat[0]}, {self.shape}, {self.dtype})"


class VectorEnv:
    """A robot's task in many simulations, with the methods and attributes of gymnasium.vector.VectorEnv.

    robot         Robot
    num_envs      how many
    distribution  Distribution that each episode draws its simulator of; default: the robot's prior
    autoreset     "NextStep": where an episode is over, the next step begins another one, whatever its action, with reward 0;
                  "SameStep": the same step does, and the last observation is in infos["final_obs"]
    threads       0 = as many as the machine has cores; the result does not depend on it
    copy          False: step and reset return views of memory that the next step writes over

    The simulations are those in which `plumb train` trains: efforts come through the driver, latency and noise of readings are
    there. Equal seeds give equal episodes, the first ones those of Policy.evaluate. A simulation that blows up is truncated:
    its reward is 0, its observation the last one that was finite, and infos["failed"] is true.

    >>> env = VectorEnv(plumbline.load_robot("robots/pendulum"), num_envs=16)
    >>> observations, infos = env.reset(seed=1)
    >>> observations, rewards, terminations, truncations, infos = env.step(env.action_space.sample())
    >>> observations.shape, rewards.shape, truncations.any()
    ((16, 3), (16,), False)
    """

    def __init__(self, robot: Robot, num_envs: int, distribution: Distribution | None = None, *, autoreset: str = "NextStep",
                 threads: int = 0, copy: bool = True):
        if autoreset not in AUTORESET:
            raise ValueError(f"autoreset: is {autoreset!r}, needs one of {', '.join(AUTORESET)}")
        self._batch = TaskBatch(robot, num_envs, distribution, threads)
        self._same_step, self._copy, self._began = autoreset == "SameStep", copy, False
        self.num_envs, self.robot = num_envs, robot
        self.metadata = {"render_modes": [], "autoreset_mode": autoreset}
        self.render_mode = self.spec = None
        self.closed = False
        observations, actions = len(robot.observations), len(robot.actions)
        self.single_observation_space = Box(-numpy.inf, numpy.inf, (observations,))
        self.observation_space = Box(-numpy.inf, numpy.inf, (num_envs, observations))
        self.single_action_space = Box(-1, 1, (actions,))
        self.action_space = Box(-1, 1, (num_envs, actions))

    @property
    def unwrapped(self) -> VectorEnv:
        return self

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[numpy.ndarray, dict[str, Any]]:
        """Begins an episode in all.

        seed     of all random numbers to come; None: one that nobody knows
        options  none is known
        Returns (observations, infos): shape (num_envs, observations), float32, and an empty dict.
        """
        if options:
            raise ValueError(f"options: knows no {', '.join(map(repr, options))}")
        if seed is None:
            seed = int(numpy.random.SeedSequence().generate_state(1, numpy.uint64)[0])
        self._batch.reset(seed)
        self._began = True
        return self._own(self._batch.observations), {}

    def step(self, actions: Any) -> tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray, numpy.ndarray, dict[str, Any]]:
        """One control period of all.

        actions  shape (num_envs, actions), 1 is the joint's effort limit; what lies beyond [-1, 1] is clipped
        Returns (observations, rewards, terminations, truncations, infos): shapes (num_envs, observations) float32, (num_envs,)
        float64, (num_envs,) and (num_envs,) of bool. Where an episode has ended infos has its return and length, as gymnasium's
        RecordEpisodeStatistics names them: infos["episode"]["r"] and ["l"], of those in the mask infos["_episode"].
        """
        if not self._began:
            raise RuntimeError("step: reset has not been called")
        self._batch.step(actions, self._same_step)
        batch, own = self._batch, self._own
        return (own(batch.observations), own(batch.rewards), own(batch.terminated), own(batch.truncated), self._infos())

    def close(self) -> None:
        """Nothing needs to be closed."""
        self.closed = True

    def _own(self, view: numpy.ndarray) -> numpy.ndarray:
        return view.copy() if self._copy else view

    def _infos(self) -> dict[str, Any]:
        over = self._batch.terminated | self._batch.truncated
        if not over.any():
            return {}
        infos: dict[str, Any] = {
            "episode": {"r": self._batch.returns.copy(), "l": self._batch.lengths.copy()},
            "_episode": over, "failed": self._batch.failed.copy()}
        if self._same_step:
            infos |= {"final_obs": self._batch.final_observations.copy(), "_final_obs": over.copy()}
        return infos

    def __repr__(self) -> str:
        return f"<VectorEnv of {self.num_envs} {self.robot!r}>"
