#include "calibrator/inference/chi_squared.h"

#include <boost/math/distributions/chi_squared.hpp>

namespace plumb {

double ChiSquaredTail(double degrees, double value) {
  return cdf(complement(boost::math::chi_squared(degrees), value));
}

double ChiSquaredAtTail(double degrees, double probability) {
  return quantile(complement(boost::math::chi_squared(degrees), probability));
}

}  // namespace plumb
