#include "calibrator/inference/abc_posterior.h"

#include <algorithm>

#include "calibrator/inference/gaussian_mixture.h"
#include "calibrator/inference/kernel_density.h"

namespace plumb {
namespace {

constexpr int kMaxKernels = 2'000, kMaxFitted = 2'000, kMaxComponents = 16;

}  // namespace

Posterior AbcPosterior(const Prior& prior, const std::optional<AdjustedSamples>& kept, int count,
                       Random& random) {
  Posterior posterior;
  if (kept && kept->samples.cols() >= prior.size() + 2) {
    const GaussianMixture density =
        KernelDensity(kept->samples, kept->weights, kMaxKernels, random);
    posterior.samples = prior.FromStandard(Sample(density, count, random));
  } else {
    posterior.samples = prior.Sample(count, random);
  }
  const Eigen::Index some = std::min<Eigen::Index>(count, kMaxFitted);
  posterior.mixture = SelectMixture(posterior.samples.leftCols(some), Eigen::VectorXd::Ones(some),
                                    kMaxComponents, random)
                          .mixture;
  return posterior;
}

}  // namespace plumb
