#include "sim/windows.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <set>
#include <string>

#include "common/random.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

RobotDescription LoadHopper() {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  return LoadRobot(std::string(source ? source : ".") + "/robots/hopper/gym.toml");
}

/// Random states near the ground, and some control steps of uneven segments; windows of different
/// lengths.
struct Record {
  std::vector<std::vector<EffortSegment>> steps;
  std::vector<Window> windows;

  explicit Record(size_t count) {
    Random random(3);
    std::vector<size_t> lengths;
    for (size_t i = 0; i < count; ++i) {
      lengths.push_back(1 + i % 3);
      for (size_t k = 0; k <= lengths.back(); ++k) {  // one more, for before
        VectorXd first = VectorXd::Zero(6), second = first;
        for (int j = 3; j < 6; ++j)
          first[j] = random.Uniform(-200, 200), second[j] = random.Uniform(-200, 200);
        const double duration = random.Uniform(0.0075, 0.0085);
        steps.push_back({{0.003, first}, {duration - 0.003, second}});
      }
    }
    size_t next = 0;
    for (size_t i = 0; i < count; ++i) {
      Window window;
      window.q = (VectorXd(6) << 0, random.Uniform(1.1, 1.3), random.Uniform(-.2, .2),
                  random.Uniform(-.5, 0), random.Uniform(-.5, 0), random.Uniform(-.5, .5))
                     .finished();
      window.v = VectorXd::NullaryExpr(6, [&] { return random.Uniform(-2, 2); });
      window.before = {steps[next++]};
      for (size_t k = 0; k < lengths[i]; ++k) window.steps.emplace_back(steps[next++]);
      windows.push_back(window);
    }
  }
};

MatrixXd SomeMasses(int count) {
  Random random(4);
  return MatrixXd::NullaryExpr(4, count, [&] { return random.Uniform(3, 5); });
}

/// Every visit's state in one matrix: a column per sample, window and step.
MatrixXd Predict(const RobotDescription& robot, int threads, const MatrixXd& parameters,
                 const std::vector<Window>& windows, bool last_only,
                 Windows::Failures* failures = nullptr) {
  Windows simulate(std::make_shared<Model>(robot), threads);
  MatrixXd all = MatrixXd::Constant(
      12, parameters.cols() * static_cast<Eigen::Index>(windows.size()) * 3, -77);
  const auto visit = [&](Eigen::Index sample, size_t window, size_t step, const VectorXd& q,
                         const VectorXd& v) {
    const auto column =
        (sample * static_cast<Eigen::Index>(windows.size()) + static_cast<Eigen::Index>(window)) *
            3 +
        static_cast<Eigen::Index>(step);
    all.col(column) << q, v;
  };
  const Windows::Failures counted = simulate.Predict(parameters, windows, visit, last_only);
  if (failures) *failures = counted;
  return all;
}

bool SameBits(const MatrixXd& a, const MatrixXd& b) {
  return ((a.array() == b.array()) || (a.array().isNaN() && b.array().isNaN())).all();
}

}  // namespace

TEST_CASE("windows are what a simulator gives, to the bit, for any number of threads") {
  RobotDescription robot = LoadHopper();
  for (const bool delayed : {false, true}) {
    if (delayed) {
      robot.joints[3].dynamics.delay = 0.0031;
      robot.joints[5].dynamics.sensor_delay = 0.002;
      robot.joints[4].dynamics.sensor_bias = 0.01;
    }
    const Record record(13);
    const MatrixXd masses = SomeMasses(5);
    const MatrixXd all = Predict(robot, 1, masses, record.windows, false);
    CHECK(SameBits(all, Predict(robot, 2, masses, record.windows, false)));
    CHECK(SameBits(all, Predict(robot, 5, masses, record.windows, false)));
    CHECK(SameBits(all.leftCols(13 * 3),
                   Predict(robot, 3, masses.leftCols(1), record.windows, false)));

    Simulator simulator(robot);
    for (Eigen::Index sample = 0; sample < masses.cols(); ++sample) {
      simulator.SetParameters(masses.col(sample));
      for (size_t i = 0; i < record.windows.size(); ++i) {
        const Window& window = record.windows[i];
        VectorXd acting = window.steps[0][0].effort;
        if (delayed) acting[3] = window.before[0].back().effort[3];
        simulator.SetReading(window.q, window.v, acting);
        if (delayed) simulator.Recall(window.before[0]);
        for (size_t step = 0; step < window.steps.size(); ++step) {
          simulator.Step(window.steps[step]);
          const auto column =
              (sample * 13 + static_cast<Eigen::Index>(i)) * 3 + static_cast<Eigen::Index>(step);
          const Simulator::State reading = simulator.Reading();
          CHECK(all.col(column).head(6) == reading.q);
          CHECK(all.col(column).tail(6) == reading.v);
        }
      }
    }
  }
}

TEST_CASE("each sample's efforts are as late as its own delay, whatever the sample before has") {
  RobotDescription robot = LoadHopper();
  robot.parameters.push_back(
      {"delay/thigh", "", ParameterDescription::Coordinate::kLinear, 0.002, 1});
  const Record record(30);
  MatrixXd parameters(5, 5);
  parameters.topRows(4) = SomeMasses(5);
  parameters.row(4) << 0.002, 0.002, 0.0031, 0, 0.002;
  const MatrixXd all = Predict(robot, 1, parameters, record.windows, false);
  for (Eigen::Index sample = 0; sample < 5; ++sample) {
    CHECK(SameBits(all.middleCols(sample * 30 * 3, 30 * 3),
                   Predict(robot, 1, parameters.col(sample), record.windows, false)));
  }
  MatrixXd prompt = parameters;
  prompt.row(4).setZero();
  CHECK_FALSE(SameBits(all, Predict(robot, 1, prompt, record.windows, false)));
}

TEST_CASE("only the ends of windows are visited where no more is asked for") {
  const Record record(7);
  const MatrixXd all = Predict(LoadHopper(), 2, SomeMasses(2), record.windows, false);
  const MatrixXd ends = Predict(LoadHopper(), 2, SomeMasses(2), record.windows, true);
  for (Eigen::Index column = 0; column < all.cols(); ++column) {
    const auto step = static_cast<size_t>(column % 3), window = static_cast<size_t>(column / 3 % 7);
    const size_t length = record.windows[window].steps.size();
    CHECK((all(0, column) != -77) == (step < length));
    CHECK((ends(0, column) != -77) == (step + 1 == length));
    if (step + 1 == length) CHECK(SameBits(all.col(column), ends.col(column)));
  }
}

TEST_CASE("a simulation that fails is counted, told of, and leaves its neighbours alone") {
  Record record(9);
  const MatrixXd good = Predict(LoadHopper(), 2, SomeMasses(3), record.windows, true);
  MatrixXd masses = SomeMasses(3);
  masses(2, 1) = -1;  // no such simulator
  record.windows[4].v[3] = 1e200;
  record.windows[5].q[2] = 1e9;  // beyond all sense, but finite
  Windows::Failures failures;
  const MatrixXd all = Predict(LoadHopper(), 2, masses, record.windows, true, &failures);
  CHECK(failures.impossible == 9);
  CHECK(failures.diverged == 4);
  CHECK(failures.total() == 13);
  for (Eigen::Index column = 0; column < all.cols(); ++column) {
    const Eigen::Index sample = column / 27, window = column / 3 % 9;
    if (good(0, column) == -77) continue;
    if (sample == 1 || window == 4 || window == 5) {
      CHECK(all.col(column).array().isNaN().all());
    } else {
      CHECK(SameBits(all.col(column), good.col(column)));
    }
  }
}

TEST_CASE("windows that are none are refused") {
  const Record record(3);
  const auto refused = [&](auto spoil) {
    std::vector<Window> windows = record.windows;
    spoil(windows[1]);
    CHECK_THROWS_AS(Predict(LoadHopper(), 1, SomeMasses(1), windows, true), std::invalid_argument);
  };
  const std::vector<EffortSegment> nothing = {{0.0, VectorXd::Zero(6)}},
                                   narrow = {{0.008, VectorXd::Zero(5)}};
  refused([](Window& w) { w.q[0] = std::numeric_limits<double>::quiet_NaN(); });
  refused([](Window& w) { w.v.resize(5); });
  refused([](Window& w) { w.steps.clear(); });
  refused([&](Window& w) { w.steps[0] = nothing; });
  refused([&](Window& w) { w.steps[0] = narrow; });
  CHECK(Predict(LoadHopper(), 2, SomeMasses(1), {}, true).cols() == 0);
  Windows::Failures failures;
  Predict(LoadHopper(), 2, MatrixXd(4, 0), record.windows, true, &failures);
  CHECK(failures.total() == 0);
}

TEST_CASE("recorded steps are never quite as long as they should be, and still go side by side") {
  CHECK(SubstepCount(0.008, 0.002) == 4);
  CHECK(SubstepCount(0.0081, 0.002) == 4);
  CHECK(SubstepCount(0.0079, 0.002) == 4);
  CHECK(SubstepCount(0.0083, 0.002) == 5);
  CHECK(SubstepCount(0.05, 0.005) == 10);
  CHECK(SubstepCount(1e-9, 0.005) == 1);
}

TEST_CASE("what a visit throws arrives when all threads have ended") {
  const Record record(40);
  for (const int threads : {1, 2, 5}) {
    Windows windows(std::make_shared<Model>(LoadHopper()), threads);
    const auto visit = [](Eigen::Index, size_t window, size_t, const VectorXd&, const VectorXd&) {
      if (window == 31) throw std::out_of_range("thirty-one");
    };
    CHECK_THROWS_AS(windows.Predict(SomeMasses(3), record.windows, visit), std::out_of_range);
    // none the worse
    CHECK(windows.Predict(SomeMasses(3), record.windows, [](auto&&...) {}).total() == 0);
  }
}

TEST_CASE("parameters of another robot are a mistake, not a simulation that failed") {
  const Record record(2);
  Windows windows(std::make_shared<Model>(LoadHopper()), 1);
  CHECK_THROWS_AS(windows.Predict(MatrixXd::Ones(3, 2), record.windows, [](auto&&...) {}),
                  std::invalid_argument);
  Window endless = record.windows[0];
  const std::vector<EffortSegment> year = {{3e7, VectorXd::Zero(6)}};
  endless.steps = {year};
  CHECK_THROWS_AS(windows.Predict(SomeMasses(1), std::vector{endless}, [](auto&&...) {}),
                  std::invalid_argument);
}

}  // namespace plumb
