#include "calibrator/diagnostics/robot_sbc.h"

#include <map>
#include <vector>

#include "calibrator/diagnostics/identifiability.h"
#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/robot_least_squares.h"

namespace plumb {
namespace {

// Where the recorded steps lead these parameters, exactly, from the recorded states on.
std::vector<Rollout> Replay(WindowErrors& errors, std::span<const Rollout> rollouts,
                            const ConfigurationSpace& space, const Eigen::VectorXd& physical) {
  const Eigen::VectorXd raw = errors.Raw(physical);
  std::vector<Rollout> replayed(rollouts.begin(), rollouts.end());
  const Eigen::Index n = errors.num_velocities();
  std::map<Transition*, Eigen::VectorXd> steps;  // by which the ends move
  for (size_t i = 0; i < errors.rows().size(); ++i) {
    const WindowErrors::Row& row = errors.rows()[i];
    Transition& t =
        replayed[static_cast<size_t>(row.rollout)].transitions[static_cast<size_t>(row.transition)];
    if (row.coordinate >= n)
      t.next_v(row.coordinate - n) += raw(static_cast<Eigen::Index>(i));
    else
      steps.try_emplace(&t, Eigen::VectorXd::Zero(n)).first->second(row.coordinate) =
          raw(static_cast<Eigen::Index>(i));
  }
  for (auto& [t, step] : steps) t->next_q = space.Move(t->next_q, step);
  return replayed;
}

// Each step begins at a state that is known, and ends where noise hides the robot.
void Blur(std::vector<Rollout>& rollouts, const ConfigurationSpace& space,
          const Eigen::VectorXd& noise_sd, Random& random) {
  const Eigen::Index n = noise_sd.size() / 2;
  Eigen::VectorXd step(n);
  for (Rollout& rollout : rollouts) {
    for (Transition& t : rollout.transitions) {
      for (Eigen::Index i = 0; i < n; ++i) {
        step(i) = noise_sd(i) * random.Normal();
        t.next_v(i) += noise_sd(n + i) * random.Normal();
      }
      t.next_q = space.Move(t.next_q, step);
      t.q_sd.setZero(), t.v_sd.setZero();
      t.next_q_sd.setConstant(NAN), t.next_v_sd.setConstant(NAN);
    }
  }
}

}  // namespace

SbcResult RunRobotSbc(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
                      const Eigen::VectorXd& noise_sd, const RobotSbcOptions& options) {
  const RobotDescription& robot = model->description();
  const ConfigurationSpace space(robot);
  const Prior prior = PriorOf(robot);
  WindowErrors errors(model, rollouts, 1, options.threads);
  errors.set_noise_sd(noise_sd);
  std::vector<std::string> names;
  for (const ParameterDescription& p : robot.parameters) names.push_back(p.name);
  std::vector<SbcQuantity> quantities = Marginals(names);
  const Eigen::VectorXd mean = prior.FromStandard(Eigen::VectorXd::Zero(prior.size()));
  LaplaceOptions curvature_only;
  curvature_only.max_iterations = 0;
  const LaplaceFit view = FitLaplace(ProblemOf(robot, errors), mean, curvature_only);
  for (const Combination& c :
       FindIdentifiability(robot, view.information, prior.Width(), view.posterior).combinations) {
    // a parameter on its own is among them already
    if ((c.power.array() != 0).count() < 2) continue;
    quantities.push_back(
        {c.name, [power = c.power](const Eigen::VectorXd& x) { return power.dot(x); }});
  }
  CurriculumOptions curriculum;
  curriculum.horizons = {1};
  curriculum.execution = options.threads;
  int run = 0;
  const auto fit = [&](const Eigen::VectorXd& truth,
                       Random& random) -> std::optional<Eigen::MatrixXd> {
    options.progress(++run / static_cast<double>(options.runs));
    std::vector<Rollout> data = Replay(errors, rollouts, space, robot.ToPhysical(truth));
    Blur(data, space, noise_sd, random);
    try {
      return Draw(FitCurriculum(model, data, curriculum).fit, prior, options.draws, random);
    } catch (const std::invalid_argument&) {
      return {};
    }
  };
  return RunSbc(prior, fit, quantities, options.runs, options.seed);
}

}  // namespace plumb
