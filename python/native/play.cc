#include <pybind11/stl.h>

#include <vector>

#include "python/native/arrays.h"
#include "python/native/interruption.h"
#include "python/native/module.h"
#include "python/native/policy.h"
#include "sim/episode.h"
#include "trainer/workers.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(Plays episodes as `plumb sim` does, with the same bits: a dict of arrays for each, a row for
each control step.

policy       whose mean actions are taken; random=True: random actions; default: no effort
seed         of all random numbers; episode i depends on it and on i alone
parameters   shape (parameters,), physical units; default: the prior's means
threads      0 = as many as the machine has cores; the result does not depend on it
Ctrl-C ends it. Other Python threads run meanwhile.

t            [s] since the episode began, shape (N,)
q, v         the state before the step, shapes (N, num_positions) [rad or m], (N, num_velocities)
             [rad/s or m/s]
u            the action as the task counts it, shape (N, actions)
reward, terminated, truncated   of the step, shape (N,)

>>> robot = plumbline.load_robot("robots/pendulum")
>>> episode, = plumbline.play(robot, seed=1)
>>> episode["q"].shape, episode["t"][:3], bool(episode["truncated"][-1])
((200, 1), array([0.  , 0.05, 0.1 ]), True)
)";

constexpr int kMostEpisodes = 10'000'000;

struct Recording {
  std::vector<double> t, q, v, u, reward;
  std::vector<uint8_t> terminated, truncated;

  void Add(const SimulatedStep& step) {
    t.push_back(step.time), reward.push_back(step.reward);
    q.insert(q.end(), step.q.begin(), step.q.end());
    v.insert(v.end(), step.v.begin(), step.v.end());
    u.insert(u.end(), step.action.begin(), step.action.end());
    terminated.push_back(step.terminated), truncated.push_back(step.truncated);
  }

  py::dict ToDict() const {
    const auto rows = std::ssize(t);
    const auto table = [&](const std::vector<double>& numbers) {
      return Array<double>({rows, std::ssize(numbers) / rows}, numbers.data());
    };
    const auto flags = [&](const std::vector<uint8_t>& of) {
      return py::array_t<bool>(rows, reinterpret_cast<const bool*>(of.data()));
    };
    py::dict episode;
    episode["t"] = Array<double>(rows, t.data());
    episode["q"] = table(q), episode["v"] = table(v), episode["u"] = table(u);
    episode["reward"] = Array<double>(rows, reward.data());
    episode["terminated"] = flags(terminated), episode["truncated"] = flags(truncated);
    return episode;
  }
};

Actor ActorOf(const Robot& robot, const Policy* policy, bool random) {
  if (policy && random) throw py::value_error("policy, random: exclude each other");
  if (policy) {
    if (policy->robot->description().fingerprint != robot.description().fingerprint)
      throw py::value_error("policy: is another robot's");
    return [policy](const Eigen::VectorXf& observation, Random&) {
      return policy->gaussian.Mean(observation);
    };
  }
  const int size = static_cast<int>(robot.description().driven().size());
  return random ? RandomActions(size) : NoAction(size);
}

py::list Play(const Robot& robot, const Policy* policy, bool random, int episodes, uint64_t seed,
              const py::object& parameters, int threads) {
  const Actor actor = ActorOf(robot, policy, random);
  std::vector<Recording> recordings(
      static_cast<size_t>(InRange("episodes", episodes, 0, kMostEpisodes)));
  Eigen::VectorXd physical = robot.model->parameters().means();
  if (!parameters.is_none())
    physical = AsMatrix(Numbers<double>("parameters", parameters, {{physical.size()}}));
  Threads(threads);
  Interruption interruption;
  {
    const py::gil_scoped_release released;
    Workers workers(threads);
    std::vector<Environment> environments;
    for (int i = 0; i < workers.size(); ++i) {
      environments.emplace_back(robot.model);
      environments.back().SetParameters(physical);
    }
    workers.Run(episodes, [&](int episode, int worker) {
      if (interruption.came()) return;
      Recording& recording = recordings[static_cast<size_t>(episode)];
      PlayEpisode(
          environments[static_cast<size_t>(worker)], robot.description(), actor, seed,
          static_cast<uint32_t>(episode), [&](const SimulatedStep& step) { recording.Add(step); },
          [] { return false; });
    });
  }
  interruption.Raise();
  py::list all;
  for (const Recording& recording : recordings) all.append(recording.ToDict());
  return all;
}

}  // namespace

void BindPlay(py::module_& module) {
  module.def("play", &Play, py::arg("robot"), py::arg("policy") = py::none(),
             py::arg("random") = false, py::arg("episodes") = 1, py::arg("seed") = 1,
             py::arg("parameters") = py::none(), py::arg("threads") = 0, kHelp);
}

}  // namespace plumb::python
