#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/live/simopt.h"
#include "calibrator/results/posterior_file.h"
#include "common/checked_file.h"
#include "common/config.h"
#include "common/message_bytes.h"
#include "robot/parameter_distribution.h"
#include "robot/posterior_reader.h"
#include "tests/calibrator/live/known_pendulum.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_file.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

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

  SECTION("the roll-outs are those of this calibration, whatever a longer one has left") {
    std::filesystem::copy_file(folder.path() / "rollout_1.checkpoint",
                               folder.path() / "rollout_2.checkpoint");
    CHECK(LoadRollouts(folder.path(), robot).size() == 2);
    CHECK(LoadRollouts(folder.path() / "none", robot).empty());
  }
  SECTION("another description's checkpoint is refused") {
    RobotDescription edited = robot;
    edited.fingerprint ^= 1;
    CHECK_THROWS_WITH(CalibrationCheckpoint(folder.path(), edited, 9).Load(),
                      Catch::Contains("another robot.toml"));
    CHECK_THROWS_WITH(LoadRollouts(folder.path(), edited),
                      Catch::Contains("calibration.checkpoint: was made with another robot.toml"));
    edited = robot;
    edited.parameters.pop_back();
    CHECK_THROWS_WITH(LoadRollouts(folder.path(), edited),
                      Catch::Contains("calibration.checkpoint: is another robot's"));
  }
  SECTION("another seed's checkpoint is refused") {
    CHECK_THROWS_WITH(CalibrationCheckpoint(folder.path(), robot, 10).Load(),
                      Catch::Contains("another seed"));
  }
  SECTION("another method's checkpoint is refused") {
    SimOpt other(robot, 9, 1, "laplace");
    CHECK_THROWS_WITH(other.Resume(*resumed), Catch::Contains("made by method reps, not laplace"));
  }
  SECTION("a damaged checkpoint is refused, naming the file") {
    std::ofstream(folder / "rollout_1.checkpoint") << "{\"episode\": 3";
    CHECK_THROWS_WITH(checkpoint.Load(), Catch::Contains("rollout_1.checkpoint"));
  }
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
  CHECK(j["loop"]["explained"] == true);
  CHECK(j["loop"]["informed"] == "all");
  CHECK(j["loop"]["alarm"] == "");
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
  state.explained = true;
  const ParameterDistribution told =
      ParameterDistribution::FromMessage(DistributionMessage(robot, state, 1, nullptr), robot);
  REQUIRE(told.mixture.components.size() == 2);
  CHECK(told.mixture.weights[1] == 0.75);
  CHECK(told.mixture.components[1].mean == second.mean);
  CHECK(told.explained);
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 1);
  checkpoint.Save(state);
  const auto loaded = checkpoint.Load();
  REQUIRE(loaded);
  CHECK(SameBits(loaded->distribution, state.distribution));
  CHECK(loaded->explained);
  CHECK(std::isnan(loaded->ess));
  std::string bytes = ReadFile(folder / "calibration.checkpoint");
  bytes[8] = 7;  // the version
  std::ofstream(folder / "calibration.checkpoint") << bytes;
  CHECK_THROWS_WITH(checkpoint.Load(), Catch::Contains("has version 7, not 11"));
}

TEST_CASE("what is said of an iteration stays as it is while the next one is under way") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1);
  const auto rollout = [&](uint32_t number) {
    return SyntheticRollout(robot, kTruth, 20, 1e-4, 0.01, number);
  };
  for (uint32_t iteration = 0; iteration < 2; ++iteration) {
    const SimOpt::State& state = simopt.state();
    const auto before = DistributionMessage(robot, state, 1, nullptr);
    const auto status = StatusMessage(robot, state, {}, nullptr, 0);
    simopt.Begin({rollout(iteration)});
    // As after a resumption that comes before the update.
    const auto during = DistributionMessage(robot, state, 1, nullptr);
    CHECK(during.utime == before.utime);
    CHECK(during.start == before.start);
    CHECK(StatusMessage(robot, state, {}, nullptr, 0).transitions == status.transitions);
    while (simopt.running()) simopt.Update();
    CHECK(DistributionMessage(robot, state, 1, nullptr).start != before.start);
  }
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
    return Encode(message);
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

  const FileKind kind{"PLUMBCAL", 11, "a calibrator's checkpoint"};
  const std::string bytes = ReadFile(folder / "calibration.checkpoint");
  const std::string text(CheckedContent(kind, bytes));
  const size_t at = text.find("\"residual\":\"") + 12;
  for (const std::string& spoilt : {text.substr(0, at) + text.substr(at + 2),
                                    text.substr(0, at) + "zz" + text.substr(at + 2)}) {
    std::ofstream(folder / "calibration.checkpoint") << WithChecksum(kind, spoilt);
    CHECK_THROWS_WITH(checkpoint.Load(),
                      Catch::Contains("calibration.checkpoint: the residual is none"));
  }
}

TEST_CASE("a run of days takes no more memory: the oldest roll-outs are forgotten") {
  RobotDescription robot = Pendulum();
  robot.calibration.updates = 1, robot.calibration.samples = 5;
  constexpr int kSteps = static_cast<int>(SimOpt::kMostTransitions / 4);
  const auto iterate = [&](SimOpt& simopt, CalibrationCheckpoint& checkpoint, uint32_t i) {
    simopt.Begin({SyntheticRollout(robot, kTruth, kSteps, 1e-4, 0.01, i)});
    checkpoint.Save(simopt.state());
    Finish(simopt);
    checkpoint.Save(simopt.state());
  };
  const TemporaryFolder folder;
  CalibrationCheckpoint checkpoint(folder.path(), robot, 9);
  SimOpt straight(robot, 9, 1);
  for (uint32_t i = 0; i < 6; ++i) iterate(straight, checkpoint, i);
  const SimOpt::State& state = straight.state();
  CHECK(state.forgotten == 2);
  CHECK(CountTransitions(state.rollouts) == SimOpt::kMostTransitions);
  const Rollout third = SyntheticRollout(robot, kTruth, kSteps, 1e-4, 0.01, 2);
  CHECK(state.rollouts[0].transitions[7].v == third.transitions[7].v);
  // Nothing of the record is lost, and who takes it up goes on alike.
  CHECK(LoadRollouts(folder.path(), robot).size() == 6);
  SimOpt resumed(robot, 9, 1);
  resumed.Resume(checkpoint.Load().value());
  CHECK(resumed.state().forgotten == 2);
  iterate(straight, checkpoint, 6);
  const TemporaryFolder elsewhere;
  CalibrationCheckpoint other(elsewhere.path(), robot, 9);
  iterate(resumed, other, 6);
  CHECK(SameBits(resumed.state().distribution, straight.state().distribution));
  CHECK(other.Load().value().rollouts.size() == 4);
  // An iteration of more than that is used as a whole.
  SimOpt large(robot, 9, 1);
  large.Begin(std::vector<Rollout>(5, third));
  CHECK(large.state().rollouts.size() == 5);
}

}  // namespace
}  // namespace plumb
