#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/fit/window_errors.h"
#include "calibrator/results/findings.h"
#include "calibrator/results/summary.h"
#include "robot/description.h"

// The report's drawings: each returns an <svg> element. Classes "prior" and "posterior" have their
// colours.
namespace plumb {

// The functions here share nothing: thread-safe.

/// "mass/pole [kg]"
inline std::string WithUnit(const ParameterDescription& p) {
  return p.unit.empty() ? p.name : p.name + " [" + p.unit + "]";
}

/// Errors against the horizon, both logarithmic. @return empty if there are none.
std::string ErrorPlot(const std::vector<HorizonError>& errors);

/// Eigenvalues of the Fisher information in units of the prior, in decreasing order, on a
/// logarithmic axis. Lines: 1 = as much as the prior knows, dashed; NullInformation, below which
/// nothing is identifiable, dotted.
std::string ScreePlot(const std::vector<double>& eigenvalues);

/// Whitened residuals against the standard normal distribution.
std::string ResidualHistogram(const std::vector<double>& residuals);
/// Quantiles against those of the standard normal distribution. @param sorted ascending.
std::string ResidualQuantiles(const std::vector<double>& sorted);
/// @param correlation of lags 1, 2, ... @param count of residuals, for the band of 95 % of white
/// noise.
std::string ResidualCorrelation(const std::vector<double>& correlation, size_t count);
/// Root mean square of all residuals over the record, in at most 120 bins of transitions, with
/// vertical lines where roll-outs begin. 1 = down to the noise.
std::string ResidualsOverTime(const Eigen::VectorXd& residuals,
                              const std::vector<WindowErrors::Row>& rows);

/// Errors of each joint's velocity with a residual in units of those without, and a mark at what
/// the readings alone would make. @param condition "free" or "touching".
std::string ErrorsLeftPlot(const ResidualQuality& quality, const RobotDescription& robot,
                           const std::string& condition);

/// The posterior of a parameter from each log alone, mean and 95 %, and from all as a band.
std::string AgreementPlot(const std::vector<LogAgreement>& logs, const Summary& summary,
                          const RobotDescription& robot, Eigen::Index parameter);

/// Of the standard normal distribution.
double NormalDensity(double z);

}  // namespace plumb
