#include "trainer/kernels/network.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "tests/trainer/reference_network.h"

namespace plumb {
namespace {

// Sizes that fill whole registers, sizes that do not, and a network without hidden layers.
const std::vector<std::vector<int>> kShapes = {
    {3, 128, 128, 1}, {11, 33, 17, 3}, {1, 5, 2}, {4, 2}, {2, 7, 64, 9, 1}};

struct Case {
  explicit Case(std::vector<int> shape, int columns) : sizes(std::move(shape)), reference{sizes} {
    Random random(9, {static_cast<uint32_t>(sizes.size()), static_cast<uint32_t>(columns)});
    parameters = RandomMatrix(reference.parameter_count(), 1, .3, random);
    direction = RandomMatrix(reference.parameter_count(), 1, .3, random);
    inputs = RandomMatrix(sizes.front(), columns, 1, random);
    output_gradient = RandomMatrix(sizes.back(), columns, 1, random);
  }
  std::span<const float> Span(const Eigen::VectorXf& v) const {
    return {v.data(), static_cast<size_t>(v.size())};
  }

  std::vector<int> sizes;
  ReferenceNetwork reference;
  Eigen::VectorXf parameters, direction;
  Eigen::MatrixXf inputs, output_gradient;
};

TEST_CASE("Outputs, gradients and tangents are those of the network in double") {
  for (const std::vector<int>& shape : kShapes) {
    for (const int columns : {1, 2, 13, 191, 500}) {
      const Case c(shape, columns);
      CAPTURE(shape, columns);
      kernels::Network network(c.sizes), direction(c.sizes);
      REQUIRE(network.parameter_count() == c.reference.parameter_count());
      network.Set(c.Span(c.parameters));
      direction.Set(c.Span(c.direction));
      kernels::Tape tape(c.sizes, columns);

      Eigen::MatrixXf outputs(shape.back(), columns), tangent(shape.back(), columns);
      Eigen::VectorXf gradient(c.parameters.size());
      tape.Forward(network, c.inputs.data(), columns, outputs.data());
      tape.Tangent(network, direction, tangent.data());
      tape.Backward(network, c.output_gradient.data(), gradient.data());

      const Eigen::VectorXd p = c.parameters.cast<double>(), v = c.direction.cast<double>();
      const Eigen::MatrixXd x = c.inputs.cast<double>();
      CHECK(RelativeError(outputs.cast<double>(), c.reference.Outputs(p, x)) < 3e-6);
      CHECK(RelativeError(gradient.cast<double>(),
                          c.reference.Backward(p, x, c.output_gradient.cast<double>())) < 1e-5);
      const double h = 1e-6;
      const Eigen::MatrixXd difference =
          (c.reference.Outputs(p + h * v, x) - c.reference.Outputs(p - h * v, x)) / (2 * h);
      CHECK(RelativeError(tangent.cast<double>(), difference) < 1e-5);
    }
  }
}

TEST_CASE("The reference's gradient is that of finite differences") {
  const Case c({3, 6, 5, 2}, 4);
  const Eigen::VectorXd p = c.parameters.cast<double>(), v = c.direction.cast<double>();
  const Eigen::MatrixXd x = c.inputs.cast<double>(), g = c.output_gradient.cast<double>();
  const auto loss = [&](double h) {
    return g.cwiseProduct(c.reference.Outputs(p + h * v, x)).sum();
  };
  CHECK(c.reference.Backward(p, x, g).dot(v) ==
        Approx((loss(1e-6) - loss(-1e-6)) / 2e-6).epsilon(1e-7));
}

TEST_CASE("A sample's output has the same bits wherever it stands in the batch") {
  const Case c({3, 128, 128, 1}, 200);
  kernels::Network network(c.sizes);
  network.Set(c.Span(c.parameters));
  kernels::Tape all(c.sizes, 200), part(c.sizes, 60), single(c.sizes, 1);
  Eigen::VectorXf outputs(200), some(60);
  all.Forward(network, c.inputs.data(), 200, outputs.data());
  part.Forward(network, c.inputs.data() + 3 * 77, 60, some.data());
  CHECK(some == outputs.segment(77, 60));
  for (int i = 0; i < 200; ++i) {
    float output = 0;
    single.Forward(network, c.inputs.data() + 3 * i, 1, &output);
    REQUIRE(output == outputs[i]);
  }
}

TEST_CASE("tanh is accurate to 2e-7 everywhere, saturates, and passes NaN on") {
  const std::vector<int> sizes = {1, 1, 1};
  kernels::Network network(sizes);
  network.Set(std::vector<float>{1, 0, 1, 0});  // output = tanh(input)
  kernels::Tape tape(sizes, 1);
  const auto evaluate = [&](float x) {
    float y = 0;
    tape.Forward(network, &x, 1, &y);
    return y;
  };
  double worst = 0;
  for (float x = -12; x <= 12; x += 1.7e-3f)
    worst = std::max(worst, std::abs(evaluate(x) - std::tanh(double{x})));
  CHECK(worst < 2e-7);
  CHECK(evaluate(std::numeric_limits<float>::infinity()) == 1);
  CHECK(evaluate(-1e30f) == -1);
  CHECK(std::isnan(evaluate(std::numeric_limits<float>::quiet_NaN())));
}

TEST_CASE("tanh is as accurate beside others") {
  constexpr int kUnits = 75;  // whole pairs of packets, a packet and a part of one
  const std::vector<int> sizes = {1, kUnits, kUnits, 1};
  kernels::Network network(sizes);
  kernels::Tape tape(sizes, 1);
  double worst = 0;
  for (int unit = 0; unit < kUnits; ++unit) {
    // First layer: c x for some c; the second picks one unit, the third takes it as it is.
    std::vector<float> parameters(static_cast<size_t>(network.parameter_count()));
    for (int i = 0; i < kUnits; ++i)
      parameters[static_cast<size_t>(i)] = 3 * std::sin(1.f + static_cast<float>(i));
    parameters[static_cast<size_t>(2 * kUnits + unit * kUnits)] = 1;
    parameters[static_cast<size_t>(2 * kUnits + kUnits * kUnits + kUnits)] = 1;
    network.Set(parameters);
    for (const float x : {-20.f, -3.f, -.7f, -.01f, 0.f, .2f, 1.f, 4.f, 30.f}) {
      float y = 0;
      tape.Forward(network, &x, 1, &y);
      worst = std::max(
          worst,
          std::abs(y - std::tanh(std::tanh(double{parameters[static_cast<size_t>(unit)]} * x))));
    }
  }
  CHECK(worst < 4e-7);  // of two
}

TEST_CASE("Adam follows its equations") {
  const int count = 37;
  Random random(4);
  Eigen::VectorXf parameters = RandomMatrix(count, 1, 1, random), m = Eigen::VectorXf::Zero(count),
                  v = m;
  Eigen::VectorXd expected = parameters.cast<double>(), first = Eigen::VectorXd::Zero(count),
                  second = first;
  for (int step = 1; step <= 5; ++step) {
    const Eigen::VectorXf gradient = RandomMatrix(count, 1, 1, random);
    const Eigen::VectorXf part = .3f * gradient, rest = gradient - part;
    kernels::AdamStep(count, step, 1e-2f, .1f, {part.data(), rest.data()}, parameters.data(),
                      m.data(), v.data());
    const Eigen::VectorXd g = gradient.cast<double>() + .1 * expected;
    first = .9 * first + .1 * g;
    second = .999 * second + .001 * g.cwiseAbs2();
    const Eigen::ArrayXd unbiased = second.array() / (1 - std::pow(.999, step));
    expected.array() -= 1e-2 * first.array() / (1 - std::pow(.9, step)) / (unbiased.sqrt() + 1e-8);
  }
  CHECK((parameters.cast<double>() - expected).cwiseAbs().maxCoeff() < 3e-6);
}

}  // namespace
}  // namespace plumb
