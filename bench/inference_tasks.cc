// Tasks of simulation-based inference whose posteriors are known exactly, as Lueckmann, Boelts,
// Greenberg, Goncalves and Macke define them ("Benchmarking simulation-based inference", AISTATS
// 2021, appendix T; gaussian_mixture as corrected in version 1.1 of their package). For ten
// observations drawn from the prior predictive distribution, writes posterior samples of a method
// and of the reference. bench/c2st.py compares them.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>

#include "calibrator/inference/abc_rejection.h"
#include "calibrator/inference/abc_smc.h"
#include "calibrator/inference/conditional_mixture.h"

namespace plumb {
namespace {

/// A simulation draws its noise from `random`; the reference draws one sample of the posterior.
struct Task {
  Prior prior;
  std::function<Eigen::VectorXd(const Eigen::VectorXd& parameters, Random& random)> simulate;
  std::function<Eigen::VectorXd(const Eigen::VectorXd& observed, Random& random)> reference;
};

bool Possible(const Prior& prior, const Eigen::VectorXd& parameters) {
  return std::isfinite(prior.LogDensity(parameters));
}

/// x = p + (-|a + b|, b - a) / sqrt 2, p on a crescent: radius N(0.1, 0.01) about (0.25, 0), angle
/// U(-pi/2, pi/2).
Task TwoMoons() {
  const Prior prior({Prior::Uniform(-1, 1), Prior::Uniform(-1, 1)});
  const auto crescent = [](Random& random) {
    const double angle = random.Uniform(-M_PI_2, M_PI_2), radius = 0.1 + 0.01 * random.Normal();
    return Eigen::Vector2d(radius * std::cos(angle) + 0.25, radius * std::sin(angle));
  };
  const auto simulate = [crescent](const Eigen::VectorXd& t, Random& random) -> Eigen::VectorXd {
    return crescent(random) + M_SQRT1_2 * Eigen::Vector2d(-std::abs(t(0) + t(1)), t(1) - t(0));
  };
  const auto reference = [crescent, prior](const Eigen::VectorXd& x,
                                           Random& random) -> Eigen::VectorXd {
    for (;;) {
      // p is known up to which sign a + b has; the map's Jacobian is constant.
      const Eigen::Vector2d p = crescent(random);
      double sum = M_SQRT2 * (p(0) - x(0));
      const double difference = M_SQRT2 * (x(1) - p(1));
      if (sum < 0) continue;
      if (random.Uniform() < 0.5) sum = -sum;
      const Eigen::Vector2d t((sum - difference) / 2, (sum + difference) / 2);
      if (Possible(prior, t)) return t;
    }
  };
  return {prior, simulate, reference};
}

/// x ~ 0.5 N(t, 1) + 0.5 N(t, 0.01), in two dimensions, t uniform in [-10, 10]^2.
Task TwoScales() {
  const Prior prior({Prior::Uniform(-10, 10), Prior::Uniform(-10, 10)});
  const auto scatter = [](const Eigen::VectorXd& about, Random& random) -> Eigen::VectorXd {
    const double sd = random.Uniform() < 0.5 ? 1 : 0.1;
    return about + sd * StandardNormals(2, 1, random);
  };
  const auto reference = [prior, scatter](const Eigen::VectorXd& x,
                                          Random& random) -> Eigen::VectorXd {
    for (;;) {
      const Eigen::VectorXd t = scatter(x, random);
      if (Possible(prior, t)) return t;
    }
  };
  return {prior, scatter, reference};
}

/// x ~ N(t, 0.1 I), t ~ N(0, 0.1 I), in ten dimensions: the posterior is N(x / 2, 0.05 I).
Task GaussianLinear() {
  constexpr Eigen::Index kSize = 10;
  const Prior prior(std::vector<Prior::Marginal>(kSize, Prior::Normal(0, std::sqrt(0.1))));
  const auto simulate = [](const Eigen::VectorXd& t, Random& random) -> Eigen::VectorXd {
    return t + std::sqrt(0.1) * StandardNormals(kSize, 1, random);
  };
  const auto reference = [](const Eigen::VectorXd& x, Random& random) -> Eigen::VectorXd {
    return x / 2 + std::sqrt(0.05) * StandardNormals(kSize, 1, random);
  };
  return {prior, simulate, reference};
}

Task MakeTask(const std::string& name) {
  if (name == "two_moons") return TwoMoons();
  if (name == "gaussian_mixture") return TwoScales();
  if (name == "gaussian_linear") return GaussianLinear();
  throw std::invalid_argument("no task \"" + name +
                              "\"; there are two_moons, gaussian_mixture and gaussian_linear");
}

// Streams of random numbers, apart from those of the methods by their seed.
constexpr uint64_t kObservationSeed = 0x0b5e7, kReferenceSeed = 0x7ef, kSimulationSeed = 0x51;

Problem MakeProblem(const Task& task, uint32_t observation) {
  Random random(kObservationSeed, {observation});
  const Eigen::VectorXd truth = task.prior.Sample(1, random);
  const auto simulate = [task, observation](const Eigen::MatrixXd& parameters, int64_t first) {
    Eigen::MatrixXd outcomes;
    for (Eigen::Index j = 0; j < parameters.cols(); ++j) {
      Random noise(kSimulationSeed, {observation, static_cast<uint32_t>(first + j)});
      const Eigen::VectorXd x = task.simulate(parameters.col(j), noise);
      if (j == 0) outcomes.resize(x.size(), parameters.cols());
      outcomes.col(j) = x;
    }
    return outcomes;
  };
  return {task.prior, task.simulate(truth, random), simulate};
}

Eigen::MatrixXd Reference(const Task& task, const Eigen::VectorXd& observed, Eigen::Index count,
                          uint32_t observation) {
  Random random(kReferenceSeed, {observation});
  Eigen::MatrixXd samples(task.prior.size(), count);
  for (auto column : samples.colwise()) column = task.reference(observed, random);
  return samples;
}

void Write(const std::filesystem::path& path, const Eigen::MatrixXd& samples) {
  std::ofstream file(path);
  file.precision(9);
  file << samples.transpose() << '\n';
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

Posterior Infer(const std::string& method, const Problem& problem, int64_t simulations, int samples,
                uint64_t seed) {
  if (method == "mixture") {
    ConditionalMixtureOptions options;
    options.simulations = simulations;
    options.samples = samples;
    return InferConditionalMixture(problem, options, seed);
  }
  if (method == "abc-smc") {
    SmcOptions options;
    options.simulations = simulations;
    options.samples = samples;
    return InferBySmc(problem, options, seed);
  }
  if (method == "rejection") {
    RejectionOptions options;
    options.simulations = simulations;
    options.samples = samples;
    return InferByRejection(problem, options, seed);
  }
  throw std::invalid_argument("no method \"" + method +
                              "\"; there are mixture, abc-smc and rejection");
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string task_name = "two_moons", method = "mixture", directory = ".";
  int64_t simulations = 10'000;
  int samples = 10'000, observations = 10;
  CLI::App app(
      "Posterior samples of tasks whose posteriors are known, into "
      "<directory>/<observation>.{method,reference}");
  app.add_option("task", task_name, "two_moons, gaussian_mixture or gaussian_linear");
  app.add_option("method", method, "mixture, abc-smc or rejection");
  app.add_option("simulations", simulations, "budget");
  app.add_option("directory", directory, "where samples go");
  app.add_option("--samples", samples, "posterior samples written");
  app.add_option("--observations", observations, "how many");
  CLI11_PARSE(app, argc, argv);
  try {
    std::filesystem::create_directories(directory);
    const plumb::Task task = plumb::MakeTask(task_name);
    for (int i = 1; i <= observations; ++i) {
      const auto observation = static_cast<uint32_t>(i);
      const plumb::Problem problem = plumb::MakeProblem(task, observation);
      const std::clock_t start = std::clock();
      const plumb::Posterior posterior =
          plumb::Infer(method, problem, simulations, samples, observation);
      const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      const std::string stem = directory + "/" + std::to_string(i);
      plumb::Write(stem + ".method", posterior.samples);
      plumb::Write(stem + ".reference",
                   plumb::Reference(task, problem.observed, samples, observation));
      std::cout << task_name << ' ' << method << ' ' << simulations << " observation " << i << ": "
                << posterior.simulations << " simulations, " << seconds << " s" << std::endl;
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
