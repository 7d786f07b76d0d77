#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/description.h"
#include "sim/model.h"

namespace plumb {

/// Which steps the parameters are learnt from.
enum class Informed {
  kAll,
  kBesideContacts,  ///< all, but for what contacts may have done (DisturbedByContacts)
  kFree,            ///< those that touch nothing
  kNone
};
inline constexpr Informed kAllInformed[] = {Informed::kAll, Informed::kBesideContacts,
                                            Informed::kFree, Informed::kNone};
/// "all", "beside contacts", "free" or "none".
const char* Name(Informed informed);
/// Why, where it is none.
inline constexpr char kNotInformed[] = "nothing that was recorded is explained well enough to tell";

/// The steps of roll-outs that begin and end away from the ground and from stops. Thread-safe.
std::vector<Rollout> FreeSteps(const RobotDescription& robot, std::span<const Rollout> rollouts);
/// The steps that the parameters are learnt from, or would be if anything informed them.
/// Thread-safe. @param coordinates of the posterior's mean.
std::vector<Rollout> InformingSteps(const std::shared_ptr<const Model>& model,
                                    const Eigen::VectorXd& coordinates,
                                    std::span<const Rollout> rollouts, Informed informed);

}  // namespace plumb
