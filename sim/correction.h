#pragma once

#include <Eigen/Core>
#include <memory>

#include "common/random.h"
#include "robot/residual.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"

namespace plumb {

/// A residual at work: corrects a simulator's state after each control step, by what the residual
/// says of each contact and of the whole robot:
///   change of (q, v) = sum over contacts of response * function(contact) + function(inputs)
/// (StepContacts::Contact, ResidualInputs). Not thread-safe; does not allocate after construction.
class Correction {
 public:
  /// @throws std::invalid_argument if the residual is another robot's.
  Correction(const Model& model, std::shared_ptr<const Residual> residual);

  const std::shared_ptr<const Residual>& residual() const { return residual_; }

  /// Begins an episode. @param draw, random see ResidualSample.
  void Begin(size_t draw, Random& random) { sample_.Begin(draw, random); }
  /// Before the simulator makes a step.
  void BeginStep(Simulator& simulator) { inputs_.Begin(simulator); }
  /// After it. @param effort, before, duration see ResidualInputs::End.
  void EndStep(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& effort,
               const Eigen::Ref<const Eigen::VectorXd>& before, double duration);
  /// Whether that step touched the ground or a stop.
  bool touching() const { return inputs_.touching(); }

 private:
  std::shared_ptr<const Residual> residual_;
  ResidualSample sample_;
  ResidualInputs inputs_;
  Eigen::VectorXd dq_, dv_;
};

}  // namespace plumb
