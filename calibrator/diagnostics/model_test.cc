#include "calibrator/diagnostics/model_test.h"

#include <utility>

#include "calibrator/diagnostics/candidates.h"
#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/robot_least_squares.h"
#include "sim/tasks/task.h"

namespace plumb {

OneStepView ViewOneStep(const MethodInput& input, const MethodResult& result) {
  OneStepView view;
  if (result.curriculum) {
    view.fit = result.curriculum->one_step;
    view.rows = result.curriculum->rows;
    view.noise_sd = result.noise_sd;
    view.noise_known = result.curriculum->noise_known;
    view.information = result.curriculum->fit.information;
    return view;
  }
  const RobotDescription& robot = input.model->description();
  const Eigen::VectorXd mean = Moments(result.posterior).mean;
  WindowErrors errors(input.model, input.rollouts, 1, input.options.execution);
  LaplaceOptions curvature_only;
  curvature_only.max_iterations = 0;
  errors.Linearise(robot.ToPhysical(mean));
  view.fit = FitLaplace(ProblemOf(robot, errors), mean, curvature_only);
  view.rows = errors.rows();
  view.noise_sd = errors.EndNoise();
  // there is none of what was never observed
  view.noise_sd.head(view.fit.scale.size()).array() *= view.fit.scale.array();
  view.noise_known = errors.noise_known();
  view.information = view.fit.information;
  view.simulated_steps = errors.simulated_steps();
  return view;
}

Misspecification TestModel(const MethodInput& input, const MethodResult& result,
                           const OneStepView& view, int64_t* steps) {
  const RobotDescription& robot = input.model->description();
  if ((view.noise_sd.array() <= kNegligible * MakeTask(robot)->state_scale().array()).all()) {
    Misspecification none;
    none.summary = "the model reproduces this log to five digits";
    return none;
  }
  const Eigen::VectorXd physical = robot.ToPhysical(Moments(result.posterior).mean);
  const std::vector<Candidate> candidates = FindCandidates(robot);
  auto extended = std::make_shared<Model>(WithCandidates(robot, candidates));
  WindowErrors errors(extended, input.rollouts, 1, input.options.execution);
  errors.set_noise_sd(view.noise_sd);
  Eigen::VectorXd nominal = extended->parameters().means();
  nominal.head(physical.size()) = physical;
  errors.Linearise(nominal);
  FitResiduals residuals{
      input.rollouts,
      view.rows,
      view.fit.errors,
      view.fit.jacobian,
      std::vector<bool>(static_cast<size_t>(view.noise_sd.size()), view.noise_known),
      candidates,
      {}};
  residuals.columns = CandidateColumns([&](const Eigen::MatrixXd& x) { return errors.Whitened(x); },
                                       physical, candidates);
  // Whitened with the noise as estimated, or as known; then by what the errors' scale makes of it,
  // as the errors are.
  if (view.noise_known) {
    for (size_t i = 0; i < view.rows.size(); ++i)
      residuals.columns.row(static_cast<Eigen::Index>(i)) /=
          view.fit.scale(view.rows[i].coordinate);
  }
  *steps += errors.simulated_steps();
  return FindMisspecification(input.model->Describe(physical), residuals);
}

}  // namespace plumb
