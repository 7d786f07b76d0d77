#include "estimator/ground_contact.h"

#include <algorithm>
#include <cmath>

#include "estimator/impact.h"
#include "estimator/square.h"

namespace plumb {
namespace {

constexpr double kSurelyBelow = 2;  // standard deviations

}  // namespace

bool ContactTest::Judge(const Motion& motion) {
  const double height_sd = std::hypot(motion.height_sd, kHeightSd),
               rise_sd = std::hypot(motion.rise_sd, kRiseSd);
  const bool pressed_in = motion.height < -kSurelyBelow * height_sd;
  const double height = std::max(0.0, motion.height),
               rise = pressed_in ? std::max(0.0, motion.rise) : motion.rise;
  const double statistic = Square(height / height_sd) + Square(rise / rise_sd) +
                           Square(motion.slide / std::hypot(motion.slide_sd, kSlideSd));
  touching_ = statistic < (touching_ ? kLeaves : kTouches);
  return touching_;
}

GroundContact::GroundContact(const RobotDescription& robot)
    : points_(ContactPoints(robot)),
      tests_(points_.size()),
      motions_(points_.size()),
      kinematics_(robot),
      jacobian_(3, robot.num_velocities()) {}

void GroundContact::Judge(robot_state_t& state) {
  if (points_.empty()) return;
  if (!state.valid) {
    std::fill(state.contact.begin(), state.contact.end(), int8_t{-1});
    for (ContactTest& test : tests_) test.Restart();
    std::fill(motions_.begin(), motions_.end(), ContactTest::Motion{});
    return;
  }
  using Values = Eigen::Map<const Eigen::VectorXd>;
  const auto n = static_cast<Eigen::Index>(state.v.size());
  kinematics_.Update(Values(state.q.data(), static_cast<Eigen::Index>(state.q.size())),
                     Values(state.v.data(), n));
  const Values q_sd(state.q_sd.data(), n), v_sd(state.v_sd.data(), n);
  for (size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& point = points_[i];
    kinematics_.Jacobian(point.link, point.centre, jacobian_);
    const auto vertical = jacobian_.row(2).transpose().array();
    motions_[i] = {.height = kinematics_.Position(point.link, point.centre).z() - point.radius,
                   .height_sd = (vertical * q_sd.array()).matrix().norm(),
                   .rise = kinematics_.Velocity(point.link, point.centre).z(),
                   .rise_sd = (vertical * v_sd.array()).matrix().norm()};
    state.contact[i] = tests_[i].Judge(motions_[i]);
  }
}

double GroundContact::ImpactSpeed(double ahead) const {
  double fastest = 0;
  for (const ContactTest::Motion& motion : motions_) {
    fastest = std::max(fastest, SpeedBelow(0, kGroundMargin, motion.height, motion.rise, ahead));
  }
  return fastest;
}

}  // namespace plumb
