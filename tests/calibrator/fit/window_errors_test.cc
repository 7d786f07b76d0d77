#include "calibrator/fit/window_errors.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/special_numbers.h"
#include "tests/calibrator/hopper.h"
#include "tests/calibrator/inference/statistics.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

/// The same motion, read anew with noise at both ends of each transition, every reading on its own.
std::vector<Rollout> WithReadingNoise(std::vector<Rollout> exact, double q_sd, double v_sd,
                                      uint32_t stream) {
  Random random(7, {stream});
  for (Rollout& rollout : exact) {
    for (Transition& t : rollout.transitions) {
      const Eigen::Index n = t.v.size();
      for (double* x : {t.q.data(), t.next_q.data()}) {
        for (Eigen::Index i = 0; i < n; ++i) x[i] += q_sd * random.Normal();
      }
      for (double* x : {t.v.data(), t.next_v.data()}) {
        for (Eigen::Index i = 0; i < n; ++i) x[i] += v_sd * random.Normal();
      }
      t.q_sd = t.next_q_sd = Eigen::VectorXd::Constant(n, q_sd);
      t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(n, v_sd);
    }
  }
  return exact;
}

std::vector<Rollout> Swings(int rollouts, int steps, const Eigen::VectorXd& truth) {
  std::vector<Rollout> all;
  for (int i = 0; i < rollouts; ++i)
    all.push_back(SyntheticRollout(Pendulum(), truth, steps, 0, 0, static_cast<uint32_t>(i)));
  return all;
}

// Whitened errors of the right simulator, a column of 2 n h for each full window.
Eigen::MatrixXd FullWindows(WindowErrors& errors, const Eigen::VectorXd& truth, Eigen::Index rows) {
  const Eigen::VectorXd whitened = errors.Whitened(truth);
  REQUIRE(whitened.allFinite());
  std::vector<Eigen::VectorXd> columns;
  for (Eigen::Index begin = 0; begin < whitened.size();) {
    const int window = errors.rows()[static_cast<size_t>(begin)].window;
    Eigen::Index end = begin;
    while (end < whitened.size() && errors.rows()[static_cast<size_t>(end)].window == window) ++end;
    if (end - begin == rows) columns.push_back(whitened.segment(begin, rows));
    begin = end;
  }
  Eigen::MatrixXd matrix(rows, static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = columns[i];
  return matrix;
}

// All variances one, all correlations zero.
void CheckWhite(const Eigen::MatrixXd& windows) {
  const Eigen::Index k = windows.rows(), count = windows.cols();
  REQUIRE(count >= 40);
  CAPTURE(k, count);
  CHECK(ChiSquared(windows.squaredNorm(), static_cast<double>(k * count)) > 1e-3);
  CHECK(ChiSquared(windows.rowwise().sum().squaredNorm() / static_cast<double>(count),
                   static_cast<double>(k)) > 1e-3);
  const Eigen::MatrixXd products =
      windows * windows.transpose() / std::sqrt(static_cast<double>(count));
  double sum = 0;
  for (Eigen::Index i = 0; i < k; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) sum += products(i, j) * products(i, j);
  }
  CHECK(ChiSquared(sum, static_cast<double>(k * (k - 1) / 2)) > 1e-3);
  // The sum over each window has one variance, too: positive correlations add up in it.
  CHECK(ChiSquared(windows.colwise().sum().squaredNorm() / static_cast<double>(k),
                   static_cast<double>(count)) > 1e-3);
}

TEST_CASE("whitened errors of the right simulator are white, with noise at both ends") {
  const int horizon = GENERATE(1, 5, 10);
  CAPTURE(horizon);
  SECTION("pendulum") {
    const RobotDescription robot = Pendulum();
    const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
    const std::vector<Rollout> rollouts = WithReadingNoise(Swings(20, 100, truth), 1e-3, 5e-3, 1);
    WindowErrors errors(std::make_shared<Model>(robot), rollouts, horizon, 1);
    CHECK(errors.noise_known());
    CHECK_FALSE(errors.starts_known());
    CHECK(errors.Linearise(truth));
    CheckWhite(FullWindows(errors, truth, 2 * horizon));
    // A beginning that is taken for exact makes errors too large.
    WindowErrors naive(std::make_shared<Model>(robot), rollouts, horizon, 1);
    CHECK(FullWindows(naive, truth, 2 * horizon).array().square().mean() > 1.7);
  }
  SECTION("hopper") {
    const RobotDescription robot = Hopper();
    const Eigen::VectorXd truth = RandomMasses(robot, 3);
    const std::vector<Rollout> rollouts =
        WithReadingNoise(RandomRollouts(robot, truth, 1000, 0, 3), 1e-6, 1e-5, 2);
    WindowErrors errors(std::make_shared<Model>(robot), rollouts, horizon, 1);
    CHECK(errors.Linearise(truth));
    CheckWhite(FullWindows(errors, truth, 12 * horizon));
  }
}

TEST_CASE("where the noise is not known it is what was set") {
  const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
  std::vector<Rollout> rollouts = WithReadingNoise(Swings(10, 60, truth), 1e-3, 5e-3, 4);
  for (Rollout& rollout : rollouts) {
    for (Transition& t : rollout.transitions) {
      for (Eigen::VectorXd* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd})
        sd->setConstant(kNaN);
    }
  }
  WindowErrors errors(std::make_shared<Model>(Pendulum()), rollouts, 5, 1);
  CHECK_FALSE(errors.noise_known());
  CHECK_FALSE(errors.starts_known());
  errors.set_noise_sd(Eigen::Vector2d(1e-3, 5e-3));
  errors.Linearise(truth);
  CheckWhite(FullWindows(errors, truth, 10));
  const Eigen::VectorXd right = errors.Whitened(truth);
  errors.set_noise_sd(Eigen::Vector2d(2e-3, 1e-2));
  CHECK((2 * errors.Whitened(truth) - right).cwiseAbs().maxCoeff() < 1e-6);
  CHECK_THROWS_AS(errors.set_noise_sd(Eigen::Vector3d::Ones()), std::invalid_argument);
  CHECK_THROWS_AS(errors.set_noise_sd(Eigen::Vector2d(1, 0)), std::invalid_argument);
  CHECK_THROWS_AS(errors.set_noise_sd(Eigen::Vector2d(1, kNaN)), std::invalid_argument);
}

TEST_CASE("raw errors are what a simulator on its own is off by") {
  const RobotDescription robot = Hopper();
  const Eigen::VectorXd truth = RandomMasses(robot, 5), wrong = RandomMasses(robot, 6);
  const std::vector<Rollout> rollouts = RandomRollouts(robot, truth, 60, 1e-4, 5);
  WindowErrors errors(std::make_shared<Model>(robot), rollouts, 4, 2);
  Eigen::MatrixXd both(4, 2);
  both << wrong, truth;
  const Eigen::MatrixXd raw = errors.Raw(both);
  REQUIRE(raw.rows() == 12 * 60);
  CHECK(errors.simulated_steps() == 2 * 60);
  CHECK(errors.steps() == 60);
  Simulator simulator(robot);
  int window = -1;
  for (size_t i = 0; i < errors.rows().size(); i += 12) {
    const WindowErrors::Row& row = errors.rows()[i];
    const Transition& t =
        rollouts[static_cast<size_t>(row.rollout)].transitions[static_cast<size_t>(row.transition)];
    if (row.window != window) {
      simulator.SetParameters(wrong);
      simulator.SetState(t.q, t.v);
      window = row.window;
    }
    simulator.Step(t.efforts);
    Eigen::VectorXd expected(12);
    expected << simulator.q() - t.next_q, simulator.v() - t.next_v;
    REQUIRE(row.coordinate == 0);
    REQUIRE(
        (raw.col(0).segment(static_cast<Eigen::Index>(i), 12) - expected).cwiseAbs().maxCoeff() <
        1e-12);
  }
  CHECK(window + 1 == errors.windows());
  // The right one is off by the noise, whose size it may know or not.
  CHECK(raw.col(1).squaredNorm() / 1e-4 == Approx(720).epsilon(0.2));
  CHECK(
      errors.Whitened(both).cwiseProduct(errors.noise_sd().replicate(60, 2)).isApprox(raw, 1e-12));
  // The same bits with another number of threads.
  WindowErrors alone(std::make_shared<Model>(robot), rollouts, 4, 1);
  CHECK(alone.Raw(both) == raw);
}

TEST_CASE(
    "windows end at gaps and at the ends of roll-outs, and follow each other without overlap") {
  const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
  std::vector<Rollout> rollouts = Swings(2, 20, truth);
  // 7 transitions, a gap, 5 more: windows of 3, 3, 1 and 3, 2; the other roll-out: 3 x 6 + 2.
  rollouts[0].transitions.erase(rollouts[0].transitions.begin() + 7,
                                rollouts[0].transitions.begin() + 15);
  const auto model = std::make_shared<Model>(Pendulum());
  WindowErrors errors(model, rollouts, 3, 1);
  CHECK(errors.windows() == 5 + 7);
  CHECK(errors.steps() == 12 + 20);
  std::vector<std::pair<int, int>> first;
  for (const WindowErrors::Row& row : errors.rows()) {
    if (row.window == static_cast<int>(first.size()))
      first.emplace_back(row.rollout, row.transition);
  }
  CHECK(first == std::vector<std::pair<int, int>>{{0, 0},
                                                  {0, 3},
                                                  {0, 6},
                                                  {0, 7},
                                                  {0, 10},
                                                  {1, 0},
                                                  {1, 3},
                                                  {1, 6},
                                                  {1, 9},
                                                  {1, 12},
                                                  {1, 15},
                                                  {1, 18}});
  CHECK(errors.Raw(truth).cwiseAbs().maxCoeff() < 1e-12);
  SECTION("every other one only") {
    WindowErrors part(model, rollouts, 3, 1, 2);
    CHECK(part.windows() == 6);
    std::vector<std::pair<int, int>> kept;
    for (const WindowErrors::Row& row : part.rows()) {
      if (row.window == static_cast<int>(kept.size()))
        kept.emplace_back(row.rollout, row.transition);
    }
    CHECK(kept ==
          std::vector<std::pair<int, int>>{{0, 0}, {0, 6}, {0, 10}, {1, 3}, {1, 9}, {1, 15}});
    CHECK(part.steps() == 3 + 1 + 2 + 9);
    // Their errors are those that they have among all.
    const Eigen::VectorXd wrong = Eigen::Vector3d(8, 1, 1), all = errors.Raw(wrong),
                          some = part.Raw(wrong);
    Eigen::Index at = 0;
    for (size_t i = 0; i < errors.rows().size(); ++i) {
      const WindowErrors::Row& row = errors.rows()[i];
      if (row.window % 2) continue;
      REQUIRE(some(at++) == all(static_cast<Eigen::Index>(i)));
    }
    CHECK(at == some.size());
  }
  SECTION("what was not observed has no row") {
    rollouts[0].transitions[1].next_q(0) = kNaN;
    // the third window's all
    rollouts[0].transitions[6].next_q(0) = rollouts[0].transitions[6].next_v(0) = kNaN;
    WindowErrors less(model, rollouts, 3, 1);
    CHECK(less.windows() == 11);
    CHECK(less.rows().size() == errors.rows().size() - 3);
    for (const WindowErrors::Row& row : less.rows()) {
      CHECK_FALSE((row.rollout == 0 &&
                   ((row.transition == 1 && row.coordinate == 0) || row.transition == 6)));
    }
    // The transitions after it are predicted all the same.
    CHECK(less.Raw(truth).cwiseAbs().maxCoeff() < 1e-12);
    for (Rollout& rollout : rollouts) {
      for (Transition& t : rollout.transitions) t.next_q(0) = t.next_v(0) = kNaN;
    }
    CHECK_THROWS_AS(WindowErrors(model, rollouts, 3, 1), std::invalid_argument);
    CHECK_THROWS_AS(WindowErrors(model, {}, 3, 1), std::invalid_argument);
  }
}

TEST_CASE("with entries missing, what is left is white as well") {
  const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
  std::vector<Rollout> rollouts = WithReadingNoise(Swings(20, 100, truth), 1e-3, 5e-3, 6);
  for (Rollout& rollout : rollouts) {
    for (size_t i = 0; i < rollout.transitions.size(); ++i) {
      if (i % 5 == 1) rollout.transitions[i].next_q(0) = kNaN;
      if (i % 5 == 3) rollout.transitions[i].next_v(0) = rollout.transitions[i].next_q(0) = kNaN;
    }
  }
  WindowErrors errors(std::make_shared<Model>(Pendulum()), rollouts, 5, 1);
  CHECK(errors.Linearise(truth));
  CheckWhite(FullWindows(errors, truth, 7));
}

TEST_CASE("simulators that fail are counted and have no errors at all") {
  const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
  std::vector<Rollout> rollouts = Swings(1, 20, truth);
  // beyond what can be simulated, in the fourth window's middle: not looked at
  rollouts[0].transitions[13].v(0) = 1e7;
  WindowErrors errors(std::make_shared<Model>(Pendulum()), rollouts, 4, 1);
  Eigen::MatrixXd both(3, 2);
  both << truth, Eigen::Vector3d(10, -1, 0.9);  // no pendulum
  const Eigen::MatrixXd whitened = errors.Whitened(both);
  CHECK(whitened.col(0).allFinite());
  CHECK(whitened.col(1).array().isNaN().all());
  CHECK(errors.failures() == 5);
  // One window that blows up spoils the simulator, but only its own raw errors.
  rollouts[0].transitions[12].efforts[3].effort(0) = 1e300;
  WindowErrors exploding(std::make_shared<Model>(Pendulum()), rollouts, 4, 1);
  const Eigen::VectorXd raw = exploding.Raw(truth);
  CHECK(exploding.failures() == 1);
  for (Eigen::Index i = 0; i < raw.size(); ++i) {
    CHECK(std::isfinite(raw(i)) == (exploding.rows()[static_cast<size_t>(i)].window != 3));
  }
  CHECK(exploding.Whitened(truth).array().isNaN().all());
}

TEST_CASE("without a simulator to linearise, motion is taken to be free") {
  const Eigen::VectorXd truth = Eigen::Vector3d(10, 1.1, 0.9);
  const std::vector<Rollout> rollouts = WithReadingNoise(Swings(3, 20, truth), 1e-3, 5e-3, 8);
  WindowErrors errors(std::make_shared<Model>(Pendulum()), rollouts, 1, 1);
  CHECK_FALSE(errors.Linearise(Eigen::Vector3d(10, -1, 1)));
  const Eigen::VectorXd raw = errors.Raw(truth), whitened = errors.Whitened(truth);
  // By hand: q' = q + v t, v' = v, with the noise of both ends.
  Eigen::Matrix2d h;
  h << 1, 0.05, 0, 1;
  const Eigen::Matrix2d noise = Eigen::Vector2d(1e-6, 25e-6).asDiagonal();
  const Eigen::Matrix2d root = Eigen::Matrix2d(h * noise * h.transpose() + noise).llt().matrixL();
  for (Eigen::Index i = 0; i < raw.size(); i += 2) {
    REQUIRE((root * whitened.segment<2>(i) - raw.segment<2>(i)).norm() < 1e-12);
  }
  CHECK(errors.LogSpread() == Approx(60 * std::log(root.determinant())));
  // Without any linearisation only the ends' noise counts.
  WindowErrors plain(std::make_shared<Model>(Pendulum()), rollouts, 1, 1);
  CHECK(plain.LogSpread() == Approx(60 * (std::log(1e-3) + std::log(5e-3))));
  CHECK(plain.EndNoise()(0) == Approx(1e-3));
  CHECK(plain.EndNoise()(1) == Approx(5e-3));
}

}  // namespace
TEST_CASE("what has disturbed a transition is part of its errors' covariance") {
  const Eigen::VectorXd truth = Model(Pendulum()).parameters().means();
  for (const double start_sd : {0.0, 1e-3}) {
    std::vector<Rollout> log = Swings(1, 6, truth);
    for (Transition& t : log[0].transitions) {
      t.q_sd = t.v_sd = Eigen::VectorXd::Constant(1, start_sd);
      t.next_q_sd = t.next_v_sd = Eigen::VectorXd::Constant(1, 2e-3);
    }
    const Eigen::MatrixXd direction = (Eigen::MatrixXd(2, 1) << 0.01, 0.3).finished();
    log[0].transitions[2].disturbance = direction;
    const auto model = std::make_shared<Model>(Pendulum());
    const Eigen::VectorXd other = 1.1 * truth;
    WindowErrors disturbed(model, log, 1, 1);
    disturbed.Linearise(truth);
    const Eigen::VectorXd whitened = disturbed.Whitened(other), raw = disturbed.Raw(other);
    log[0].transitions[2].disturbance.resize(2, 0);
    WindowErrors plain(model, log, 1, 1);
    plain.Linearise(truth);
    const Eigen::VectorXd before = plain.Whitened(other);
    CHECK(whitened.head(4) == before.head(4));
    CHECK(whitened.tail(6) == before.tail(6));
    // S = W^-1 W^-T of the undisturbed one, and the direction's square
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(2, 2);
    if (start_sd == 0) {
      const Eigen::MatrixXd covariance = 4e-6 * unit + direction * direction.transpose();
      const Eigen::VectorXd errors = raw.segment(4, 2);
      CHECK(whitened.segment(4, 2).squaredNorm() ==
            Approx(errors.dot(covariance.llt().solve(errors))));
    } else {
      CHECK(whitened.segment(4, 2).squaredNorm() < before.segment(4, 2).squaredNorm());
    }
  }
}

TEST_CASE("no window goes through a disturbed transition") {
  std::vector<Rollout> log = Swings(1, 6, Model(Pendulum()).parameters().means());
  log[0].transitions[2].disturbance = Eigen::MatrixXd::Ones(2, 1);
  const WindowErrors errors(std::make_shared<Model>(Pendulum()), log, 50, 1);
  CHECK(errors.windows() == 3);  // of 2, 1 and 3 steps
}

}  // namespace plumb
