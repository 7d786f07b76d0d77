#include "calibrator/fit/contact_residual.h"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

#include "common/decompositions.h"
#include "tests/calibrator/hopper.h"

namespace plumb {
namespace {

using Contact = StepContacts::Contact;

// A point of a robot of n joints that can be pushed in k directions, anywhere.
Contact RandomContact(bool ground, Eigen::Index k, const Eigen::MatrixXd& inverse_mass,
                      Random& random) {
  const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd matrix(rows, columns);
    for (double& number : matrix.reshaped()) number = random.Normal();
    return matrix;
  };
  Contact contact;
  contact.ground = ground;
  contact.x = normal(4, 1);
  contact.jacobian = normal(k, inverse_mass.rows());
  contact.mobility = contact.jacobian * inverse_mass * contact.jacobian.transpose();
  contact.response = inverse_mass * contact.jacobian.transpose() * Inverse(contact.mobility);
  return contact;
}

Eigen::MatrixXd InverseMass(Random& random) {
  Eigen::MatrixXd root(6, 6);
  for (double& number : root.reshaped()) number = random.Normal();
  return root * root.transpose() + Eigen::MatrixXd::Identity(6, 6);
}

}  // namespace

TEST_CASE("errors that contacts have made are found again, each contact's own") {
  Random random(3);
  const Eigen::MatrixXd inverse_mass = InverseMass(random);
  const std::vector<Contact> contacts{RandomContact(true, 2, inverse_mass, random),
                                      RandomContact(false, 1, inverse_mass, random)};
  const Eigen::Vector2d ground(0.3, -0.2);
  const Eigen::VectorXd stop = Eigen::VectorXd::Constant(1, 0.5),
                        errors = contacts[0].response * ground + contacts[1].response * stop;
  const std::vector<Eigen::VectorXd> own = OwnErrors(contacts, errors);
  REQUIRE(own.size() == 2);
  // but for the ridge
  CHECK((own[0] - ground).norm() < 0.02);
  CHECK((own[1] - stop).norm() < 0.02);
  CHECK((contacts[0].response * own[0] + contacts[1].response * own[1] - errors).norm() <
        0.01 * errors.norm());
}

TEST_CASE("two contacts that move as one share what they have made") {
  Random random(4);
  const Eigen::MatrixXd inverse_mass = InverseMass(random);
  const Contact one = RandomContact(true, 2, inverse_mass, random);
  const Eigen::Vector2d both(0.3, -0.2);
  const std::vector<Eigen::VectorXd> own = OwnErrors({one, one}, one.response * both);
  CHECK((own[0] - both / 2).norm() < 1e-3);
  CHECK((own[1] - both / 2).norm() < 1e-3);
}

TEST_CASE("what a contact has wrong is learnt, and taken from the errors") {
  Random random(5);
  const Eigen::MatrixXd inverse_mass = InverseMass(random);
  StepErrors steps;
  constexpr double kNoise = 1e-3;
  for (int i = 0; i < 300; ++i) {
    const Contact contact = RandomContact(true, 2, inverse_mass, random);
    const Eigen::Vector2d displacement(0.01 * contact.x[0], 0.02),
        velocity(contact.x[1] - 0.5, 0.3 * contact.x[2]);
    Eigen::VectorXd errors(12);
    errors << contact.response * displacement, contact.response * velocity;
    for (double& error : errors) error += kNoise * random.Normal();
    steps.inputs.push_back(Eigen::VectorXd::Zero(3));
    steps.errors.push_back(errors);
    steps.variances.push_back(Eigen::VectorXd::Zero(12));
    steps.contacts.push_back({contact});
  }
  std::vector<StepErrors> draws{steps};
  const ContactFunctions functions = FitContacts({50, 0, 0.1}, 1, &draws);
  REQUIRE(functions.ground);
  CHECK_FALSE(functions.stop);
  CHECK(functions.ground->noise.isZero(0));
  CHECK(functions.ground->outputs() == 4);
  const auto rms = [](const StepErrors& of) {
    return Columns(of.errors).norm() / std::sqrt(12.0 * of.size());
  };
  CHECK(rms(steps) > 0.1);
  CHECK(rms(draws[0]) < 2 * kNoise);
}

TEST_CASE("of too few contacts nothing is learnt, and the errors stay") {
  Random random(6);
  const Eigen::MatrixXd inverse_mass = InverseMass(random);
  StepErrors steps;
  for (int i = 0; i < kFewestForResidual - 1; ++i) {
    steps.errors.push_back(Eigen::VectorXd::Ones(12));
    steps.contacts.push_back({RandomContact(true, 2, inverse_mass, random)});
  }
  std::vector<StepErrors> draws{steps};
  const ContactFunctions functions = FitContacts({50, 0, 0.1}, 1, &draws);
  CHECK_FALSE(functions.ground);
  CHECK(draws[0].errors == steps.errors);
}

}  // namespace plumb
