#include "sim/simulator.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include "common/special_numbers.h"

namespace plumb {
namespace {

// Beyond which nobody waits for a step.
constexpr double kMaxSubsteps = 1e9;

// Each time another number, in all threads.
uint64_t NextName() {
  static std::atomic<uint64_t> latest{0};
  return ++latest;
}

}  // namespace

Simulator::Simulator(std::shared_ptr<const Model> model)
    : model_(std::move(model)),
      engine_(model_->NewEngine()),
      physics_(model_->parameters().Nominal()),
      track_(model_->num_velocities(), JointDynamics::kLongestDelay),
      mean_(static_cast<size_t>(model_->num_velocities())),
      moment_(mean_.size()),
      arriving_(mean_.size()),
      q_(model_->num_positions()),
      v_(model_->num_velocities()),
      reading_q_(q_),
      reading_v_(v_) {
  Take();
}

Simulator::Simulator(const RobotDescription& description)
    : Simulator(std::make_shared<Model>(description)) {}
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;
Simulator::~Simulator() = default;

void Simulator::SetParameters(const Vector& physical) {
  model_->parameters().Apply(physical, &physics_);
  engine_->SetPhysics(0, physics_);
  robot_ = NextName();
}

void Simulator::SetState(const Vector& q, const Vector& v) {
  if (q.size() != num_positions() || v.size() != num_velocities()) {
    throw std::invalid_argument("a state has " + std::to_string(num_positions()) +
                                " positions and " + std::to_string(num_velocities()) +
                                " velocities");
  }
  if (!q.allFinite() || !v.allFinite())
    throw std::invalid_argument("a simulator's state must be finite");
  std::copy(q.begin(), q.end(), engine_->q());
  std::copy(v.begin(), v.end(), engine_->v());
  track_.Clear();
  std::fill(arriving_.begin(), arriving_.end(), 0.0);
  Take();
}

void Simulator::SetReading(const Vector& q, const Vector& v, const Vector& effort) {
  RequireSize(effort.size());
  SetState(q, v);
  std::copy(effort.begin(), effort.end(), arriving_.begin());
  if (!model_->parameters().sensor_errors()) return;
  engine_->FromReading(effort.data());
  Take();
}

void Simulator::SetReading(const Vector& q, const Vector& v, std::span<const EffortSegment> before,
                           const Vector& effort) {
  RequireSize(effort.size());
  SetState(q, v);
  Recall(before);
  for (size_t k = 0; k < arriving_.size(); ++k) {
    const double delay = physics_.axes[k].delay;
    arriving_[k] = delay > 0 ? track_.At(k, 0, delay) : effort[static_cast<Eigen::Index>(k)];
  }
  if (!model_->parameters().sensor_errors()) return;
  engine_->FromReading(arriving_.data());
  Take();
}

void Simulator::Recall(std::span<const EffortSegment> before) {
  for (const EffortSegment& segment : before) RequireSize(segment.effort.size());
  for (const EffortSegment& segment : before)
    track_.Append(segment.effort.data(), segment.duration);
  track_.Advance();
}

void Simulator::Step(const Vector& effort, double duration) {
  Prepare(effort, duration);
  Run();
}

void Simulator::Step(std::span<const EffortSegment> profile) {
  Prepare(profile);
  Run();
}

void Simulator::Prepare(const Vector& effort, double duration) {
  RequireSize(effort.size());
  RequireEnd(duration);
  prepared_ = {};
  if (!(duration > 0) || !finite_) return;
  const bool held = !model_->parameters().delays();
  if (held) {
    std::copy(effort.begin(), effort.end(), mean_.begin());
    std::fill(moment_.begin(), moment_.end(), 0.0);
  } else {
    track_.Append(effort.data(), duration);
  }
  Divide(duration, held);
}

void Simulator::Prepare(std::span<const EffortSegment> profile) {
  double duration = 0;
  for (const EffortSegment& segment : profile) {
    RequireSize(segment.effort.size());
    duration += std::max(0.0, segment.duration);
  }
  RequireEnd(duration);
  prepared_ = {};
  if (!finite_) return;
  if (!model_->parameters().delays()) track_.Clear();
  for (const EffortSegment& segment : profile)
    track_.Append(segment.effort.data(), segment.duration);
  if (duration > 0) Divide(duration, false);
}

void Simulator::Divide(double duration, bool held) {
  const double count = SubstepCount(duration, model_->description().simulation.substep);
  prepared_ = {count, duration / count, held};
}

void Simulator::Run() {
  if (prepared_.count == 0) return;
  for (int64_t i = 0; static_cast<double>(i) < prepared_.count; ++i) {
    const bool steady = FindEfforts(i);
    engine_->Substep(&prepared_.length, mean_.data(), steady ? nullptr : moment_.data());
  }
  Finish();
}

void Simulator::Correct(const Vector& dq, const Vector& dv) {
  if (!finite_) return;
  model_->space().MoveInPlace(dq, Eigen::Map<Eigen::VectorXd>(engine_->q(), q_.size()));
  for (Eigen::Index i = 0; i < v_.size(); ++i) engine_->v()[i] += dv[i];
  Take();
}

void Simulator::RequireEnd(double duration) const {
  if (duration > kMaxSubsteps * model_->description().simulation.substep) {
    throw std::invalid_argument("a step of " + std::to_string(duration) +
                                " s would never come to an end");
  }
}

void Simulator::RequireSize(Eigen::Index size) const {
  if (size != num_velocities()) {
    throw std::invalid_argument("an effort has " + std::to_string(num_velocities()) +
                                " entries, not " + std::to_string(size));
  }
}

// Of the prepared step's i-th substep, whether no effort changes within it. Time 0 is the present;
// the track goes on to the step's end.
bool Simulator::FindEfforts(int64_t i) {
  if (prepared_.held) return true;
  const double h = prepared_.length, begin = static_cast<double>(i) * h,
               end = static_cast<double>(i + 1) * h;
  bool steady = true;
  for (size_t k = 0; k < mean_.size(); ++k) {
    const EffortTrack::Moments moments = track_.Over(k, begin, end, physics_.axes[k].delay);
    mean_[k] = moments.mean;
    moment_[k] = moments.first;
    steady = steady && moments.first == 0;
  }
  return steady;
}

// The prepared step has been run.
void Simulator::Finish() {
  if (prepared_.held) {
    arriving_ = mean_;
  } else {
    track_.Advance();
    for (size_t k = 0; k < arriving_.size(); ++k)
      arriving_[k] = track_.At(k, 0, physics_.axes[k].delay);
  }
  prepared_ = {};
  Take();
}

void Simulator::Take() {
  std::copy_n(engine_->q(), q_.size(), q_.begin());
  std::copy_n(engine_->v(), v_.size(), v_.begin());
  const auto near = [](const Eigen::VectorXd& x) { return (x.array().abs() < kFarthest).all(); };
  finite_ = near(q_) && near(v_);  // NaN is not
  if (finite_) return;
  q_.setConstant(kNaN);
  v_.setConstant(kNaN);
}

Simulator::State Simulator::Reading() {
  if (!model_->parameters().sensor_errors()) return {q_, v_};
  engine_->ToReading(arriving_.data());
  std::copy_n(engine_->q(), q_.size(), reading_q_.begin());
  std::copy_n(engine_->v(), v_.size(), reading_v_.begin());
  std::copy(q_.begin(), q_.end(), engine_->q());
  std::copy(v_.begin(), v_.end(), engine_->v());
  return {reading_q_, reading_v_};
}

Eigen::VectorXd Simulator::Acceleration(const Vector& effort) {
  RequireSize(effort.size());
  return Eigen::VectorXd::Map(engine_->Acceleration(effort.data()), num_velocities());
}

void Simulator::Acceleration(const Vector& effort, Eigen::VectorXd* acceleration) {
  RequireSize(effort.size());
  *acceleration = Eigen::VectorXd::Map(engine_->Acceleration(effort.data()), num_velocities());
}

void Simulator::ContactPoints(Eigen::VectorXd* heights, RowMajorMatrix* jacobians) {
  const Eigen::Index points = num_contact_points(), rows = points * contact_directions();
  *heights = Eigen::VectorXd::Map(engine_->ContactHeights(), points);
  *jacobians = RowMajorMatrix::Map(engine_->ContactJacobians(), rows, num_velocities());
}

void Simulator::ImpulseResponse(const Vector& impulse, Eigen::Ref<Eigen::VectorXd> change) {
  RequireSize(impulse.size());
  change = Eigen::VectorXd::Map(engine_->Response(impulse.data()), num_velocities());
}

Eigen::MatrixXd Simulator::MassMatrix() {
  const Eigen::MatrixXd lower =
      RowMajorMatrix::Map(engine_->MassMatrix(), num_velocities(), num_velocities());
  return lower.selfadjointView<Eigen::Lower>();
}

Eigen::VectorXd Simulator::Bias() {
  return Eigen::VectorXd::Map(engine_->Bias(), num_velocities());
}

}  // namespace plumb
