#include "calibrator/live/simopt.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/results/posterior_file.h"
#include "robot/parameter_distribution.h"
#include "robot/posterior_reader.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_file.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

const Eigen::Vector3d kTruth(9.3, 0.93, 1.07);
const Eigen::Vector3d kNull(1, -2, 1);  // of (ln g, ln m, ln l), known in closed form
const Eigen::Vector3d kGravityOverLength(1, 0, -1), kMassLengthSquared(0, 1, 2);

double LogTruth(const Eigen::Vector3d& power) { return power.dot(kTruth.array().log().matrix()); }

/// All updates of the iteration that has begun.
CalibrationReport Finish(SimOpt& simopt) {
  for (int update = 0; update < 100; ++update) {
    if (auto report = simopt.Update()) return *report;
  }
  throw std::logic_error("the iteration does not end");
}

void Iterate(SimOpt& simopt, const RobotDescription& robot, int iterations, double v_sd = 0.01) {
  for (int i = 0; i < iterations; ++i) {
    simopt.Begin({SyntheticRollout(robot, kTruth, 100, 1e-4, v_sd, static_cast<uint32_t>(i))});
    Finish(simopt);
  }
}

TEST_CASE("the true parameters explain synthetic transitions down to the noise") {
  const RobotDescription robot = Pendulum();
  Discrepancy discrepancy(robot);
  const std::vector<Rollout> rollouts{SyntheticRollout(robot, kTruth, 2000, 1e-4, 0.01, 1)};
  // 4000 squared standard normals: 1 +- 0.0224
  CHECK(discrepancy.StepError(kTruth, rollouts)(0) == Approx(1).margin(0.07));
  CHECK(discrepancy.StepError(Eigen::Vector3d(10, 1, 1), rollouts)(0) > 1.5);
  const Eigen::VectorXd r = discrepancy.Residuals(kTruth, rollouts);
  CHECK(discrepancy.StepError(kTruth, rollouts)(0) == Approx(r.squaredNorm() / 4000));
  // the density of a two-dimensional Student's t distribution with four degrees of freedom
  double t = 0;
  for (Eigen::Index i = 0; i < r.size(); i += 2)
    t += std::log(std::pow(1 + r.segment(i, 2).squaredNorm() / 4, -3));
  CHECK(discrepancy.LogLikelihood(kTruth, rollouts)(0) == Approx(t));
}

TEST_CASE(
    "without noise every horizon is predicted exactly, and errors grow with the horizon "
    "otherwise") {
  const RobotDescription robot = Pendulum();
  Discrepancy discrepancy(robot);
  std::vector<Rollout> rollouts{SyntheticRollout(robot, kTruth, 60, 0, 0, 1)};
  for (const int n : {1, 5, 20}) CHECK(discrepancy.PredictionError(kTruth, rollouts, n)(0) < 1e-9);
  CHECK(discrepancy.TrajectoryError(kTruth, rollouts)(0) < 1e-9);
  const Eigen::Vector3d wrong(10, 1, 1);
  CHECK(discrepancy.PredictionError(wrong, rollouts, 5)(0) >
        2 * discrepancy.PredictionError(wrong, rollouts, 1)(0));
  CHECK(discrepancy.TrajectoryError(wrong, rollouts)(0) > 0.01);
  CHECK(std::isnan(discrepancy.PredictionError(wrong, rollouts, 61)(0)));
  // 30 + 29 remain, no window of 31
  rollouts[0].transitions.erase(rollouts[0].transitions.begin() + 30);
  CHECK(std::isnan(discrepancy.PredictionError(wrong, rollouts, 31)(0)));
  CHECK(discrepancy.TrajectoryError(kTruth, rollouts)(0) < 1e-9);
}

TEST_CASE(
    "the distribution comes to rest on the posterior: neither collapsed nor forgetting its prior") {
  RobotDescription robot = Pendulum();
  robot.calibration.updates = 12;
  SimOpt simopt(robot, 4, 2);
  Iterate(simopt, robot, 6);
  const Gaussian found = Moments(simopt.state().distribution);

  // Independent truth: the Laplace approximation of the same posterior, by Gauss-Newton from the
  // true parameters.
  const Gaussian laplace = LaplacePosterior(robot, simopt.state().rollouts, kTruth.array().log());
  const Eigen::VectorXd& x = laplace.mean;
  const Eigen::MatrixXd& covariance = laplace.covariance;
  for (const Eigen::Vector3d& power : {kGravityOverLength, kMassLengthSquared}) {
    const double sd = std::sqrt(power.dot(covariance * power));
    CHECK(std::abs(power.dot(found.mean - x)) < 1.2 * sd);
    const double ratio = std::sqrt(power.dot(found.covariance * power)) / sd;
    CHECK(ratio > 0.5);
    CHECK(ratio < 2);
    CHECK(std::abs(power.dot(found.mean) - LogTruth(power)) < 0.01);  // 1 %
  }
  // Where the data say nothing the prior stays.
  const Eigen::Vector3d along = kNull.normalized();
  const double null_ratio = along.dot(found.covariance * along) / along.dot(covariance * along);
  CHECK(null_ratio > 0.3);
  CHECK(null_ratio < 3);
}

TEST_CASE("one wrecked transition in a hundred does not move the distribution") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 4, 2);
  for (uint32_t i = 0; i < 10; ++i) {
    Rollout rollout = SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, i);
    rollout.transitions[40].next_v(0) += 2;  // 140 standard deviations
    simopt.Begin({rollout});
    Finish(simopt);
  }
  for (const Eigen::Vector3d& power : {kGravityOverLength, kMassLengthSquared}) {
    CHECK(std::abs(power.dot(Moments(simopt.state().distribution).mean) - LogTruth(power)) < 0.01);
  }
}

TEST_CASE("what the motion determines is found and said in words") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1);
  simopt.Begin({SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, 1)});
  const Identifiability found = Finish(simopt).identifiability;
  REQUIRE(found.null.size() == 1);
  CHECK((found.null[0] - kNull).norm() < 1e-3);
  REQUIRE(found.combinations.size() == 2);
  CHECK(found.combinations[0].name == "gravity / length");
  CHECK(found.combinations[1].name == "mass length^2");
  CHECK(found.summary ==
        "only gravity / length and mass length^2 can be known from this motion; gravity, mass, "
        "length are not "
        "identifiable separately: (gravity +1 %, mass -2 %, length +1 %) changes nothing");
}

TEST_CASE("every update keeps to the KL bound") {
  const RobotDescription robot = Pendulum();
  for (const Objective objective :
       {Objective::kPosterior, Objective::kStep, Objective::kTrajectory}) {
    SimOpt simopt(robot, 2, 1, objective);
    simopt.Begin({SyntheticRollout(robot, kTruth, 50, 1e-4, 0.01, 1)});
    Gaussian before = Moments(simopt.state().distribution);
    bool last = false;
    for (int update = 0; !last; ++update) {
      REQUIRE(update < 100);
      last = simopt.Update().has_value();
      CHECK(KlDivergence(Moments(simopt.state().distribution), before) <=
            robot.calibration.kl * (1 + 1e-9));
      before = Moments(simopt.state().distribution);
    }
  }
}

bool SameBits(const GaussianMixture& a, const GaussianMixture& b) {
  const auto same = [](const Gaussian& x, const Gaussian& y) {
    return x.mean == y.mean && x.covariance == y.covariance;
  };
  return a.weights == b.weights && std::equal(a.components.begin(), a.components.end(),
                                              b.components.begin(), b.components.end(), same);
}

TEST_CASE("any number of threads and any interruption give the same bits") {
  const RobotDescription robot = Pendulum();
  SimOpt straight(robot, 9, 1);
  Iterate(straight, robot, 2);

  SimOpt threaded(robot, 9, 3);
  Iterate(threaded, robot, 2);
  CHECK(SameBits(straight.state().distribution, threaded.state().distribution));

  const TemporaryFolder folder;
  // A new process, as it were, after every single update.
  for (int i = 0; i < 2; ++i) {
    bool begun = false, done = false;
    for (int update = 0; !done; ++update) {
      REQUIRE(update < 100);
      CalibrationCheckpoint checkpoint(folder.path(), robot, 9);
      SimOpt simopt(robot, 9, 1);
      if (auto state = checkpoint.Load()) simopt.Resume(std::move(*state));
      if (!begun) {
        simopt.Begin({SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, static_cast<uint32_t>(i))});
        begun = true;
      } else {
        done = simopt.Update().has_value();
      }
      checkpoint.Save(simopt.state());
    }
  }
  CalibrationCheckpoint checkpoint(folder.path(), robot, 9);
  const auto resumed = checkpoint.Load();
  REQUIRE(resumed);
  CHECK(resumed->iteration == 2);
  CHECK(SameBits(straight.state().distribution, resumed->distribution));

  SECTION("another description's checkpoint is refused") {
    RobotDescription edited = robot;
    edited.fingerprint ^= 1;
    CHECK_THROWS_WITH(CalibrationCheckpoint(folder.path(), edited, 9).Load(),
                      Catch::Contains("another robot.toml"));
  }
  SECTION("another seed's checkpoint is refused") {
    CHECK_THROWS_WITH(CalibrationCheckpoint(folder.path(), robot, 10).Load(),
                      Catch::Contains("another seed"));
  }
  SECTION("a damaged checkpoint is refused, naming the file") {
    std::ofstream(folder / "rollout_1.json") << "{\"episode\": 3";
    CHECK_THROWS_WITH(checkpoint.Load(), Catch::Contains("rollout_1.json"));
  }
}

TEST_CASE("an iteration without a usable transition goes by and invents nothing") {
  const RobotDescription robot = Pendulum();
  for (const Objective objective :
       {Objective::kPosterior, Objective::kStep, Objective::kTrajectory}) {
    SimOpt simopt(robot, 1, 1, objective);
    CHECK_FALSE(simopt.Report());
    simopt.Begin({Rollout{}});
    CHECK_THROWS_AS(simopt.Begin({Rollout{}}), std::invalid_argument);
    const CalibrationReport report = Finish(simopt);
    CHECK(report.iteration == 1);
    CHECK(std::isnan(report.discrepancy));
    CHECK(report.identifiability.combinations.empty());
    CHECK(KlDivergence(Moments(simopt.state().distribution), PriorGaussian(robot)) ==
          Approx(0).margin(1e-12));
  }
}

Rollout Synthetic(const RobotDescription& robot, uint32_t i) {
  return SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, i);
}

TEST_CASE(
    "an inference makes one update of all roll-outs, the same bits with any threads and after any "
    "interruption") {
  const RobotDescription robot = Pendulum();
  const std::string method = GENERATE("auto", "laplace", "mixture");
  INFO(method);
  SimOpt straight(robot, 9, 1, method), threaded(robot, 9, 3, method);
  for (uint32_t i = 0; i < 3; ++i) {
    for (SimOpt* simopt : {&straight, &threaded}) {
      simopt->Begin({Synthetic(robot, i)});
      const auto report = simopt->Update();
      REQUIRE(report);
      CHECK(report->iteration == static_cast<int>(i) + 1);
      CHECK(report->kl > 0);
      CHECK(report->errors.size() == robot.calibration.horizons.size());
    }
  }
  CHECK(SameBits(straight.state().distribution, threaded.state().distribution));
  const Gaussian found = Moments(straight.state().distribution);
  for (const Eigen::Vector3d& power : {kGravityOverLength, kMassLengthSquared}) {
    const double error = power.dot(found.mean) - LogTruth(power),
                 sd = std::sqrt(power.dot(found.covariance * power));
    INFO(error << " +- " << sd);
    CHECK(std::abs(error) < 3 * sd);
    CHECK(sd < 0.01);
  }

  const TemporaryFolder folder;
  for (uint32_t i = 0; i < 3; ++i) {
    for (const bool begins : {true, false}) {  // a new process each time, as it were
      CalibrationCheckpoint checkpoint(folder.path(), robot, 9);
      SimOpt simopt(robot, 9, 2, method);
      if (auto state = checkpoint.Load()) simopt.Resume(std::move(*state));
      if (begins)
        simopt.Begin({Synthetic(robot, i)});
      else
        CHECK(simopt.Update());
      checkpoint.Save(simopt.state());
    }
  }
  CHECK(SameBits(straight.state().distribution,
                 CalibrationCheckpoint(folder.path(), robot, 9).Load()->distribution));
}

TEST_CASE(
    "an inference lets an iteration without usable transitions go by, and an unknown method is "
    "refused") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1, "auto");
  simopt.Begin({Rollout{}});
  auto report = simopt.Update();
  REQUIRE(report);
  CHECK(KlDivergence(Moments(simopt.state().distribution), PriorGaussian(robot)) ==
        Approx(0).margin(1e-12));
  Rollout unseen = Synthetic(robot, 1);
  for (Transition& t : unseen.transitions) t.next_q(0) = t.next_v(0) = NAN;
  simopt.Begin({unseen});
  report = simopt.Update();
  REQUIRE(report);
  REQUIRE(report->warnings.size() == 1);
  CHECK_THAT(report->warnings[0], Catch::Contains("stays as it is"));
  simopt.Begin({Synthetic(robot, 2)});
  CHECK(simopt.Update());
  CHECK(simopt.state().iteration == 3);
  CHECK(simopt.state().kl > 1);
  CHECK_THROWS_WITH(SimOpt(robot, 1, 1, "laplas"), Catch::Contains("did you mean 'laplace'"));
}

TEST_CASE("what an iteration has found is a posterior, and the same bytes after a resumption") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 3, 1, "auto");
  simopt.Begin({Synthetic(robot, 1)});
  const auto report = simopt.Update();
  REQUIRE(report);
  const std::string text = PosteriorJson(IterationFindings(robot, simopt, *report), robot, {});
  const TemporaryFile file(text, ".json");
  CHECK(ReadPosterior(file.path(), robot).mixture == simopt.state().distribution);
  const auto j = nlohmann::json::parse(text);
  CHECK(j["method"] == nlohmann::json{{"asked", "auto"}, {"used", simopt.state().used}});
  CHECK(j["method"]["used"] != "prior");
  CHECK(j["seed"] == 3);
  CHECK(j["loop"]["iteration"] == 1);
  CHECK(j["loop"]["kl"] == report->kl);
  CHECK(j["discrepancy"] == report->discrepancy);
  CHECK(j["identifiability"]["words"] == report->identifiability.summary);
  CHECK(j["transitions"] == simopt.state().rollouts[0].transitions.size());
  for (const char* unknown : {"alarm", "holdout", "agreement", "simulations", "run"}) {
    INFO(unknown);
    CHECK(j.at(unknown).is_null());
  }
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 3);
  checkpoint.Save(simopt.state());
  SimOpt resumed(robot, 3, 1, "auto");
  resumed.Resume(*checkpoint.Load());
  CHECK(PosteriorJson(IterationFindings(robot, resumed, *resumed.Report()), robot, {}) == text);
}

TEST_CASE("of parameters that nothing informs none is determined, after a resumption, too") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 3, 1, "auto"), resumed(robot, 3, 1, "auto");
  simopt.Begin({Synthetic(robot, 1)});
  CHECK_THAT(Finish(simopt).identifiability.summary, !Catch::Contains("no parameter"));
  SimOpt::State state = simopt.state();
  state.informed = Informed::kNone;
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 3);
  checkpoint.Save(state);
  resumed.Resume(*checkpoint.Load());
  CHECK_THAT(resumed.Report()->identifiability.summary,
             Catch::Contains("no parameter is determined: nothing that was recorded"));
}

TEST_CASE("all modes of a posterior are kept in checkpoints and told to the trainer") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1);
  SimOpt::State state = simopt.state();
  Gaussian second = PriorGaussian(robot);
  second.mean(0) += 0.5;
  state.distribution = {{0.25, 0.75}, {PriorGaussian(robot), second}};
  state.ess = NAN;
  const ParameterDistribution told =
      ParameterDistribution::FromMessage(DistributionMessage(robot, state, 1, nullptr), robot);
  REQUIRE(told.mixture.components.size() == 2);
  CHECK(told.mixture.weights[1] == 0.75);
  CHECK(told.mixture.components[1].mean == second.mean);
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 1);
  checkpoint.Save(state);
  const auto loaded = checkpoint.Load();
  REQUIRE(loaded);
  CHECK(SameBits(loaded->distribution, state.distribution));
  CHECK(std::isnan(loaded->ess));
  std::string text =
      (std::stringstream() << std::ifstream(folder / "calibration.json").rdbuf()).str();
  text.replace(text.find("\"version\": 6"), 12, "\"version\": 1");
  std::ofstream(folder / "calibration.json") << text;
  CHECK_THROWS_WITH(checkpoint.Load(), Catch::Contains("another version"));
}

TEST_CASE("what the simulators lack is told to the trainer again after a resumption") {
  const RobotDescription robot = Pendulum();
  const auto numbers = [](Eigen::Index rows, Eigen::Index columns) {  // of single precision
    return Eigen::MatrixXf(Eigen::MatrixXf::Random(rows, columns)).cast<double>().eval();
  };
  ResidualFunction function;
  function.mean = numbers(6, 1), function.scale = numbers(6, 1).cwiseAbs();
  function.low = numbers(6, 1), function.high = function.low.array() + 1;
  function.centres = numbers(4, 6);
  function.weights = {numbers(1, 11), numbers(1, 11)};
  function.noise = numbers(1, 1).cwiseAbs(), function.bound = numbers(1, 1).cwiseAbs();
  function.unknown = numbers(1, 1).cwiseAbs();
  Residual residual;
  residual.coordinates = {kTruth, kNull};
  residual.touching = function;
  SimOpt simopt(robot, 1, 1);
  SimOpt::State state = simopt.state();
  state.residual = std::make_shared<const Residual>(residual);
  const auto told = [&](const SimOpt::State& of) {
    const parameter_distribution_t message = DistributionMessage(robot, of, 1, nullptr);
    std::vector<char> bytes(static_cast<size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    return bytes;
  };
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 1);
  checkpoint.Save(state);
  const auto loaded = checkpoint.Load();
  REQUIRE(loaded);
  REQUIRE(loaded->residual);
  state.ess = loaded->ess;  // NaN has many bits
  CHECK(told(*loaded) == told(state));
  CHECK(told(*loaded) != told(simopt.state()));

  std::string text =
      (std::stringstream() << std::ifstream(folder / "calibration.json").rdbuf()).str();
  const size_t at = text.find("\"residual\": \"") + 13;
  for (const std::string& spoilt : {text.substr(0, at) + text.substr(at + 2),
                                    text.substr(0, at) + "zz" + text.substr(at + 2)}) {
    std::ofstream(folder / "calibration.json") << spoilt;
    CHECK_THROWS_WITH(checkpoint.Load(), Catch::Contains("calibration.json: the residual is none"));
  }
}

}  // namespace
}  // namespace plumb
