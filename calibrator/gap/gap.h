#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "calibrator/diagnostics/misspecification.h"
#include "calibrator/diagnostics/model_test.h"
#include "calibrator/fit/method.h"
#include "calibrator/fit/residual_fit.h"
#include "calibrator/gap/informing_steps.h"
#include "robot/residual.h"

namespace plumb {

/// What a model lacks, as far as it was learnt.
struct Gap {
  Informed informed = Informed::kAll;
  /// learnt from all transitions; null where there is no alarm, or too little to learn from
  std::shared_ptr<const Residual> residual;
  ResidualQuality free, touching;  ///< of the residual's functions
  /// in words, for people: what the model does not explain, and what informs its parameters; then
  /// what is learnt of the rest, or why nothing is. Empty = no alarm
  std::string unexplained, summary;
};

/// A posterior, and what its simulators lack.
struct GapFit {
  MethodResult result;     ///< informed by the transitions that the model explains
  Misspecification alarm;  ///< of the model alone, with the posterior of all transitions
  /// the model was asked (alarm.judged), and explains the transitions: no alarm, or one of what is
  /// too little to be learnt, with errors that are hardly larger than the readings' noise
  bool explained = false;
  OneStepView view;             ///< that the alarm is of
  Eigen::MatrixXd information;  ///< that the result rests on, as OneStepView's
  Gap gap;
  int64_t simulated_steps = 0;  ///< beyond the result's own
};

/// Learns what a model lacks where the alarm speaks: the discrepancy of Kennedy and O'Hagan (J. R.
/// Statist. Soc. B 63, 2001) with a likelihood that is cut (Plummer, Stat. Comput. 25, 2015), so
/// that parameters are not bent to explain what they are not the cause of.
///
///   1. No alarm: the result stays as it is, to the bit, and there is no residual. If nobody can
///      tell whether there should be one, the posterior is ModelTest's considered one.
///   2. If a residual would not be worth it (kLeastExplained, kLeastEffect), there is none, and the
///      posterior is ModelTest's considered one: as wide as what may be wrong makes it.
///   3. Else steps that touch the ground or a stop are left out, if there are any, and the method
///      runs again on the others. If these do not raise the alarm, or a residual of theirs would
///      not be worth it, the model is wrong in contact alone, as far as is seen, and the parameters
///      are theirs, the considered ones again.
///   4. Then, and where free steps are too few to tell, touching steps inform the parameters, too,
///      by what contacts cannot have done (DisturbedByContacts), if the model explains that.
///   5. If free steps raise the alarm, or neither tells, nothing informs the parameters: the prior
///      stays.
///   6. A residual for what was left out is learnt for draws of that posterior, from all steps.
///
/// Only of methods that know the likelihood of steps (LikelihoodMethods), and where
/// input.options.residual says so: else the result stays as it is. Uses the threads that
/// input.options says, and shares nothing. The same bits for any number of them.
/// @param all the method's result for input.rollouts.
/// @param not_judged why errors cannot judge the model, if that is known beforehand: it is the
/// alarm's summary. Empty = they can.
/// @throws std::invalid_argument as FitResidual.
GapFit CloseGap(const MethodInput& input, MethodResult all, const std::string& not_judged = {});

/// Takes the residual, of which there is one, out of what is known of a gap, and says why.
/// Thread-safe.
void LeaveOut(const std::string& why, Gap* gap);

/// Share of each velocity's squared errors that a residual explains, left-out transitions judging:
/// 0 to 1; empty where none was learnt. Thread-safe.
Eigen::VectorXd Explained(const ResidualQuality& quality);

/// Mean share of the velocities' squared errors that a residual must explain to be used.
inline constexpr double kLeastExplained = 0.2;
/// Part of the velocities' errors in a step that it must explain in one of them at least, in units
/// of the state (Task::state_scale).
inline constexpr double kLeastEffect = 2e-3;
/// Factor of the standard deviations where contacts are set aside: what they leave of the errors is
/// not independent from step to step. By twelve logs of hoppers of three engines, whose means'
/// errors were 1.6 times what was claimed, and 5.1 times at most (docs/gap.md).
inline constexpr double kContactsLeave = 2;
/// Draws of the posterior that a residual is learnt for, the mean first.
inline constexpr int kResidualDraws = 8;
/// Free transitions below which they do not inform the parameters.
inline constexpr int kFewestFree = 50;

}  // namespace plumb
