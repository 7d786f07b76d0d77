#include "robot/residual.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>

#include "robot/parameter_distribution.h"
#include "robot/residual_message.h"

namespace plumb {
namespace {

// Two inputs, one centre, one output; numbers that single precision has.
ResidualFunction Function() {
  ResidualFunction f;
  f.mean = Eigen::Vector2d(1, -1), f.scale = Eigen::Vector2d(2, 0.5);
  f.low = Eigen::Vector2d(-1, -2), f.high = Eigen::Vector2d(1, 2);
  f.centres = Eigen::RowVector2d(0.25, -0.5);
  f.weights = {Eigen::RowVector4d(0.5, 1, 2, 0.25), Eigen::RowVector4d(1, 0, 0, 0)};
  f.noise = Eigen::MatrixXd::Zero(1, 1);
  f.bound = Eigen::VectorXd::Constant(1, 8);
  f.unknown = Eigen::VectorXd::Zero(1);
  return f;
}

Residual TwoDraws() {
  Residual residual;
  residual.coordinates = {Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Constant(1, 0.25)};
  residual.touching = Function();
  return residual;
}

RobotDescription OneParameter() {
  RobotDescription robot{};
  robot.name = "one";
  ParameterDescription parameter{};
  parameter.name = "gravity";
  parameter.mean = 9.81, parameter.variance = 0.1;
  robot.parameters = {parameter};
  return robot;
}

}  // namespace

TEST_CASE("a residual is a constant, a plane and bumps about its centres") {
  const Residual residual = TwoDraws();
  ResidualSample sample(residual);
  Random random(1);
  sample.Begin(0, random);
  const Eigen::Vector2d x(2, -0.75);  // z = (0.5, 0.5)
  const double expected = 0.5 + 0.5 / std::numbers::sqrt2 + 2 * 0.5 / std::numbers::sqrt2 +
                          0.25 * std::exp(-(0.25 * 0.25 + 1) / 2);
  CHECK(sample.Step(true, x)[0] == Approx(expected).epsilon(1e-6));
  CHECK(sample.Step(false, x)[0] == 0);  // nothing is known of free steps
  sample.Begin(1, random);
  CHECK(sample.Step(true, x)[0] == 1);
}

TEST_CASE("far from its centres a residual is a plane") {
  Residual residual = TwoDraws();
  residual.touching->low *= 100, residual.touching->high *= 100;
  ResidualSample sample(residual);
  Random random(1);
  sample.Begin(0, random);
  const auto at = [&](double z) {
    return sample.Step(true, Eigen::Vector2d(1 + 2 * z, -1 + 0.5 * z))[0];
  };
  residual.touching->bound[0] = 1e9;
  CHECK(at(90) - at(60) == Approx(at(60) - at(30)).epsilon(1e-5));
}

TEST_CASE("beyond what was recorded a residual does not grow") {
  Residual residual = TwoDraws();
  ResidualSample sample(residual);
  Random random(1);
  sample.Begin(0, random);
  const double edge = sample.Step(true, Eigen::Vector2d(3, 0))[0];  // z = (1, 2)
  CHECK(sample.Step(true, Eigen::Vector2d(1e6, 1e9))[0] == edge);
  residual.touching->bound[0] = 0.125;
  CHECK(sample.Step(true, Eigen::Vector2d(3, 0))[0] == 0.125);
}

TEST_CASE("a residual's noise has the covariance that it says") {
  Residual residual = TwoDraws();
  residual.touching->noise(0, 0) = 0.5;
  ResidualSample sample(residual);
  Random random(1);
  sample.Begin(1, random);
  double sum = 0, squares = 0;
  constexpr int kCount = 20'000;
  for (int i = 0; i < kCount; ++i) {
    const double change = sample.Step(true, Eigen::Vector2d(0, 0))[0] - 1;
    sum += change, squares += change * change;
  }
  CHECK(std::abs(sum / kCount) < 4 * 0.5 / std::sqrt(kCount));
  CHECK(squares / kCount == Approx(0.25).epsilon(4 * std::numbers::sqrt2 / std::sqrt(kCount)));
}

TEST_CASE("where nothing is known an episode has a change of its own") {
  Residual residual = TwoDraws();
  ResidualFunction& f = *residual.touching;
  f.low *= 100, f.high *= 100, f.unknown[0] = 0.5;
  ResidualSample sample(residual);
  Random random(1);
  const auto at = [&](double away) {  // from the centre, in z
    return sample.Step(true, Eigen::Vector2d(1 + 2 * (0.25 + away), -1 + 0.5 * -0.5))[0] - 1;
  };
  sample.Begin(1, random);
  const double far = at(50);
  CHECK(at(60) == Approx(far).epsilon(1e-12));  // the same as long as the episode lasts
  const double bump = std::exp(-0.5);
  CHECK(at(1) == Approx(far * std::sqrt(1 - bump * bump / 1.001)).epsilon(1e-5));
  CHECK(std::abs(at(0)) == Approx(std::abs(far) * std::sqrt(1 - 1 / 1.001)).epsilon(1e-3));
  double squares = 0;
  constexpr int kCount = 20'000;
  for (int i = 0; i < kCount; ++i) sample.Begin(1, random), squares += at(50) * at(50);
  CHECK(squares / kCount == Approx(0.25).epsilon(4 * std::numbers::sqrt2 / std::sqrt(kCount)));
}

TEST_CASE("a residual comes through a message to the bit") {
  const Residual residual = TwoDraws();
  parameter_distribution_t message{};
  message.num_parameters = 1;
  WriteResidual(residual, &message);
  const auto read = ReadResidual(message);
  REQUIRE(read);
  CHECK(read->coordinates == residual.coordinates);
  CHECK_FALSE(read->free);
  REQUIRE(read->touching);
  CHECK(read->touching->weights == residual.touching->weights);
  CHECK(read->touching->centres == residual.touching->centres);
  CHECK(read->touching->unknown == residual.touching->unknown);
  CHECK(read->margin == residual.margin);
}

TEST_CASE("a residual that is none is refused by its field") {
  struct Wrong {
    std::function<void(parameter_distribution_t&)> spoil;
    const char* field;
  };
  const auto field =
      GENERATE(values<Wrong>({{[](auto& m) { m.residual[0].weight.pop_back(); }, "weight"},
                              {[](auto& m) { m.residual[0].weight[3] = NAN; }, "weights"},
                              {[](auto& m) { m.residual[0].centre.push_back(1); }, "centre"},
                              {[](auto& m) { m.residual[0].scale[0] = 0; }, "scale"},
                              {[](auto& m) { m.residual[0].noise[0] = INFINITY; }, "noise"},
                              {[](auto& m) { m.residual[0].bound[0] = -1; }, "bound"},
                              {[](auto& m) { m.residual[0].unknown[0] = -1; }, "unknown"},
                              {[](auto& m) { m.residual[0].unknown.clear(); }, "unknown"},
                              {[](auto& m) { m.residual[0].num_inputs = -1; }, "num_inputs"},
                              {[](auto& m) { m.residual[0].num_centres = 2001; }, "num_centres"},
                              {[](auto& m) { m.residual[0].condition = 4; }, "condition"},
                              {[](auto& m) { m.residual.push_back(m.residual[0]); }, "two of one"},
                              {[](auto& m) { m.draw.clear(); }, "draw"},
                              {[](auto& m) { m.draw[0] = NAN; }, "draw"},
                              {[](auto& m) { m.residual_margin = -1; }, "margin"}}));
  parameter_distribution_t message{};
  message.num_parameters = 1;
  WriteResidual(TwoDraws(), &message);
  field.spoil(message);
  CHECK_THROWS_WITH(ReadResidual(message), Catch::Contains(field.field));
}

TEST_CASE("four of five simulators have the residual, half of the episodes a recorded start") {
  ParameterDistribution distribution = ParameterDistribution::Prior(OneParameter());
  auto residual = std::make_shared<Residual>(TwoDraws());
  residual->coordinates = {Eigen::VectorXd::Constant(1, 9), Eigen::VectorXd::Constant(1, 8)};
  distribution.residual = residual;
  distribution.starts = {Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4)};
  Random random(3);
  int with = 0, started = 0, first = 0;
  constexpr int kCount = 10'000;
  for (int i = 0; i < kCount; ++i) {
    const SimulatorDraw draw = distribution.Draw(random);
    with += draw.residual != nullptr;
    if (draw.residual) CHECK(draw.parameters[0] == 9 - static_cast<double>(draw.draw));
    if (draw.start.size() == 0) continue;
    ++started;
    CHECK(draw.start[1] == draw.start[0] + 1);
    first += draw.start[0] == 1;
  }
  const double sd = std::sqrt(kCount) / 2;
  CHECK(std::abs(with - 0.8 * kCount) < 4 * sd);
  CHECK(std::abs(started - kCount / 2) < 4 * sd);
  CHECK(std::abs(first - started / 2) < 4 * sd);
}

TEST_CASE("without a residual or starts a draw is a sample, to the bit") {
  const ParameterDistribution prior = ParameterDistribution::Prior(OneParameter());
  Random a(5), b(5);
  for (int i = 0; i < 10; ++i) CHECK(prior.Draw(a).parameters == prior.Sample(b));
}

}  // namespace plumb
