#pragma once

#include <Eigen/Core>
#include <string>

#include "calibrator/diagnostics/holdout.h"
#include "calibrator/results/findings.h"
#include "calibrator/results/summary.h"
#include "robot/description.h"

// The panels of the report that say how far its findings can be trusted, HTML.
namespace plumb {

// The functions here share nothing: thread-safe.

/// Errors of predicting motion that the fit has not seen.
std::string PredictionPanel(const Holdout& holdout);

/// Whether the model can explain the robot, and what it does not.
std::string MisfitPanel(const Findings& findings);

/// What was learnt that the model lacks, and how much of its errors that explains; empty where
/// there is nothing to say of it.
std::string GapPanel(const Gap& gap, const RobotDescription& robot);

/// How far each log's own posterior is from that of the others; empty for a single log.
/// @param most of the parameters that are drawn.
std::string AgreementPanel(const Agreement& agreement, const Summary& summary,
                           const RobotDescription& robot, Eigen::Index most);

}  // namespace plumb
