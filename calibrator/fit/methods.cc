#include "calibrator/fit/methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "calibrator/fit/abc_methods.h"
#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/robot_problem.h"
#include "calibrator/fit/search_methods.h"
#include "common/config.h"
#include "common/nearest_name.h"

namespace plumb {

const std::vector<Method>& Methods() {
  static const std::vector<Method> methods = [] {
    std::vector<Method> all;
    for (const auto& group : {LikelihoodMethods(), SearchMethods(), AbcMethods()})
      all.insert(all.end(), group.begin(), group.end());
    return all;
  }();
  return methods;
}

const std::vector<std::string>& CalibrationMethods() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Method& method : Methods()) all.push_back(method.name);
    return all;
  }();
  return names;
}

void RequireMethod(const std::string& wanted) {
  const auto& names = CalibrationMethods();
  if (std::find(names.begin(), names.end(), wanted) != names.end()) return;
  throw std::invalid_argument("there is no method '" + wanted + "'; did you mean '" +
                              NearestName(wanted, names) + "'?");
}

void RequireDiscrepancy(const std::string& wanted) {
  const auto& names = RobotDiscrepancies();
  if (std::find(names.begin(), names.end(), wanted) != names.end()) return;
  throw std::invalid_argument(
      fmt::format("there is no discrepancy '{}'; there are {}", wanted, fmt::join(names, ", ")));
}

MethodResult RunMethod(const MethodInput& input) {
  RequireMethod(input.options.method), RequireDiscrepancy(input.options.discrepancy);
  return std::find_if(Methods().begin(), Methods().end(),
                      [&](const Method& method) { return method.name == input.options.method; })
      ->run(input);
}

}  // namespace plumb
