#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "controller/policy.h"
#include "robot/description.h"
#include "trainer/batch_network.h"

namespace plumb {

/// Observations, actions and advantages of a batch: one column or entry per step.
struct PolicySamples {
  std::span<const float> observations;  ///< as the network sees them (normalised), observations x N
  std::span<const float> actions;       ///< as drawn, before any clipping, actions x N
  std::span<const double> advantages;   ///< normalised, N
};

/// Trust region policy optimisation (Schulman et al., 2015) of a GaussianPolicy: one natural
/// gradient step, its length bounded by the Kullback-Leibler divergence between old and new policy.
/// Not thread-safe.
class Trpo {
 public:
  /// @param workers,ranks must outlive this.
  Trpo(const TrainingSettings& settings, const PolicyShape& shape, Workers& workers,
       const Ranks& ranks = Ranks::Alone());

  /// The outcome of one step.
  struct Step {
    bool accepted = false;
    std::string failure;        ///< why not; the policy is then what it was, bit by bit
    int tries = 0;              ///< of the line search
    double kl = 0;              ///< mean KL(old || new) over the samples [nat]
    double surrogate_gain = 0;  ///< mean of (ratio - 1) * advantage
  };

  /// Improves the policy that took the samples' actions.
  Step Improve(GaussianPolicy& policy, const PolicySamples& samples);

  /// Gradient of the surrogate mean(ratio * advantage) at ratio = 1, in all parameters of the
  /// policy.
  /// @param means of the policy at the samples, actions x N, written: those of the samples that
  /// this rank looks at.
  Eigen::VectorXf SurrogateGradient(const GaussianPolicy& policy, const PolicySamples& samples,
                                    std::vector<float>& means);

  /// Takes the samples at which FisherProduct averages: every n-th of these, n = 1 /
  /// fisher_fraction.
  void PrepareFisher(const GaussianPolicy& policy, const PolicySamples& samples);
  /// F v, without damping. F is the Fisher information of the policy, which for a Gaussian is the
  /// Gauss-Newton matrix of its mean, J' diag(1 / sd^2) J, averaged over the samples, and 2 for
  /// each log_std. It is also the Hessian of the mean KL at the old policy.
  Eigen::VectorXf FisherProduct(const Eigen::Ref<const Eigen::VectorXf>& v);

  /// Mean KL(before || after) and mean of (ratio - 1) * advantage.
  struct Comparison {
    double kl, gain;
  };
  /// @param means of `before`, as SurrogateGradient gives them.
  Comparison Compare(const GaussianPolicy& before, std::span<const float> means,
                     const GaussianPolicy& after, const PolicySamples& samples);

  /// Lower bound of log_std: exploration must not die out.
  static constexpr float kMinLogStd = -3;

 private:
  TrainingSettings settings_;
  PolicyShape shape_;
  // at the policy's own and, in the line search, at candidate parameters
  BatchNetwork network_;
  // at the policy's parameters, with the activations of Fisher's samples
  BatchNetwork fisher_network_;
  std::vector<float> fisher_inputs_;
  Eigen::VectorXf fisher_metric_;  // 1 / (sd^2 * number of samples), per action
};

/// Differential entropy of the policy's action distribution [nat]: sum of log_std + ln(2 pi e) / 2.
double Entropy(const GaussianPolicy& policy);

}  // namespace plumb
