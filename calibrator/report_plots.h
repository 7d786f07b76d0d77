#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/findings.h"
#include "calibrator/summary.h"
#include "calibrator/window_errors.h"
#include "robot/description.h"

// The report's drawings: each returns an <svg> element. Classes "prior" and "posterior" have their
// colours.
namespace plumb {

/// "mass/pole [kg]"
inline std::string WithUnit(const ParameterDescription& p) {
  return p.unit.empty() ? p.name : p.name + " [" + p.unit + "]";
}

/// Pairs of parameters below the diagonal: 1 and 2 sigma of prior (of the coordinates: exact
/// contours) and of each of the posterior's components, and samples. On the diagonal: the prior's
/// density and a histogram of the samples. Above it: the posterior's correlation of the
/// coordinates.
/// @param shown indices of parameters, at most 8 to be legible.
std::string PairPlot(const Findings& findings, const Summary& summary,
                     const RobotDescription& robot, const std::vector<Eigen::Index>& shown);

/// Errors against the horizon, both logarithmic. @return empty if there are none.
std::string ErrorPlot(const std::vector<HorizonError>& errors);

/// Eigenvalues of the Fisher information in units of the prior, in decreasing order, on a
/// logarithmic axis. Lines: 1 = as much as the prior knows, dashed; `null` times the greatest,
/// below which nothing is identifiable, dotted.
std::string ScreePlot(const std::vector<double>& eigenvalues, double null);

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

/// What each log alone says of a parameter, mean and 95 %, and all of them together as a band.
std::string AgreementPlot(const std::vector<LogAgreement>& logs, const Summary& summary,
                          const RobotDescription& robot, Eigen::Index parameter);

}  // namespace plumb
