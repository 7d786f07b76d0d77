#include "sim/correction.h"

#include <catch2/catch.hpp>

#include "tests/sim/robots.h"

namespace plumb {
namespace {

// Says the same of every contact.
ResidualFunction Constant(Eigen::Index inputs, const Eigen::VectorXd& change) {
  ResidualFunction f;
  f.mean = Eigen::VectorXd::Zero(inputs), f.scale = Eigen::VectorXd::Ones(inputs);
  f.low = Eigen::VectorXd::Constant(inputs, -1), f.high = -f.low;
  f.centres = Eigen::MatrixXd::Ones(3, inputs);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(change.size(), f.features());
  weights.col(0) = change;
  f.weights = {weights};
  f.noise = Eigen::MatrixXd::Zero(change.size(), change.size());
  f.bound = Eigen::VectorXd::Constant(change.size(), 10);
  f.unknown = Eigen::VectorXd::Zero(change.size());
  return f;
}

}  // namespace

TEST_CASE("a contact's function moves its point, and the robot as an impulse there would") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const Model model(robot);
  auto residual = std::make_shared<Residual>();
  residual->coordinates = {
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.parameters.size()))};
  Eigen::VectorXd said(4);
  said << 0.0009765625, 0.001953125, 0.25, -0.125;
  residual->ground = Constant(StepContacts::GroundInputs(model.topology()), said);
  Correction correction(model, residual);
  Random random(1);
  correction.Begin(0, random);
  Simulator simulator(robot);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), none = q;
  q[3] = -0.5, q[4] = -1;  // away from stops
  Eigen::VectorXd heights;
  Simulator::RowMajorMatrix jacobians;
  simulator.SetState(q, none);
  simulator.ContactPoints(&heights, &jacobians);
  const double standing = -heights.minCoeff();
  const auto step = [&](double height) {
    q[1] = standing + height;
    simulator.SetState(q, none);
    correction.BeginStep(simulator);
    simulator.Step(none, 0.008);
    const Eigen::VectorXd dq = -simulator.q(), dv = -simulator.v();
    const Eigen::MatrixXd mass = simulator.MassMatrix();
    simulator.ContactPoints(&heights, &jacobians);
    Eigen::Index lowest;
    heights.minCoeff(&lowest);
    const Eigen::MatrixXd jacobian = jacobians.middleRows(2 * lowest, 2);
    correction.EndStep(simulator, none, none, 0.008);
    const Eigen::VectorXd moved = dq + simulator.q(), changed = dv + simulator.v();
    const Eigen::VectorXd point = jacobian * moved, velocity = jacobian * changed;
    // no impulse elsewhere: what it makes of the momenta lies along the Jacobian
    const Eigen::VectorXd impulse = mass * changed;
    const Eigen::VectorXd along =
        jacobian.transpose() * jacobian.transpose().colPivHouseholderQr().solve(impulse);
    CHECK((impulse - along).norm() < 1e-9);
    return Eigen::Vector4d(point[0], point[1], velocity[0], velocity[1]);
  };
  CHECK((step(0.001) - said).norm() < 1e-4 * said.norm());
  CHECK(correction.touching());
  CHECK(step(2).isZero());
  CHECK_FALSE(correction.touching());
}

}  // namespace plumb
