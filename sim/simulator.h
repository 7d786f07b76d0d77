#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/effort_track.h"
#include "sim/model.h"

namespace plumb {

/// A robot as a simulator with exchangeable parameters: reset to any state, apply an effort, step.
///
/// Trees of revolute, continuous, prismatic and spherical joints with armature, damping, Coulomb
/// friction, springs, stops, contact with the ground, delays and sensors (see RobotDescription);
/// composite rigid bodies and linearly implicit integration (see Stepper). New parameters need no
/// rebuild, not even new lengths.
///
/// One per worker; not thread-safe. Equal inputs give equal bits, in any thread, on any x86-64
/// processor. Apart from construction nothing allocates, but a first profile longer than all before
/// it.
class Simulator {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;
  using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// Starts at the zero state with the prior means as parameters.
  explicit Simulator(std::shared_ptr<const Model> model);
  /// @throws std::invalid_argument, see Model.
  explicit Simulator(const RobotDescription& description);
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;
  ~Simulator();

  const Model& model() const { return *model_; }
  int num_positions() const { return model_->num_positions(); }
  int num_velocities() const { return model_->num_velocities(); }
  int parameter_count() const { return model_->parameters().size(); }

  /// @param physical in the order of description.parameters, physical units. Takes effect at once;
  /// the state stays. @throws std::invalid_argument, see Parameters::Apply.
  void SetParameters(const Vector& physical);
  /// Forgets what was commanded before. Quaternions need not have length one, but more than zero.
  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Vector& q, const Vector& v);
  /// The same for the readings of the robot's sensors, of which some may be late or biased:
  /// JointDynamics.
  /// @param effort that acts at that time.
  void SetReading(const Vector& q, const Vector& v, const Vector& effort);
  /// The same where it is to be worked out what acts at that time.
  /// @param before as of Recall. @param effort that is commanded then: it acts where nothing is
  /// delayed.
  void SetReading(const Vector& q, const Vector& v, std::span<const EffortSegment> before,
                  const Vector& effort);
  /// The efforts commanded before the present, in order of time: where an effort is delayed, it
  /// is still to come.
  void Recall(std::span<const EffortSegment> before);

  /// Holds `effort` (num_velocities) for `duration` [s] >= 0, in equal substeps of about
  /// settings.substep, at most a tenth longer (SubstepCount):
  ///   semi-implicit  v += h a(q, v), q += h v: of first order, as gym and MuJoCo's Euler do
  ///   leapfrog       q += h/2 v, v += h a(q, v), q += h/2 v: of second order but for stops,
  ///                  contacts and friction
  /// Velocities are clipped to settings.speed_clip after each substep (settings.move_before_clip:
  /// after the move). If the state ceases to be finite it stays so until the next SetState, without
  /// any exception.
  /// @throws std::invalid_argument if the duration is infinite or the size is wrong.
  void Step(const Vector& effort, double duration);
  /// The same for efforts one after the other: the profile that was really applied to a robot.
  void Step(std::span<const EffortSegment> profile);
  /// A step in two halves, for those who run several simulators side by side (SimulatorLanes): what
  /// will act, and the motion. Step is Prepare and Run.
  void Prepare(const Vector& effort, double duration);
  void Prepare(std::span<const EffortSegment> profile);
  void Run();
  /// Moves the state by what a residual says that the step has left out; efforts on their way stay.
  /// @param dq, dv num_velocities entries; see ConfigurationSpace.
  void Correct(const Vector& dq, const Vector& dv);

  const Eigen::VectorXd& q() const { return q_; }  ///< [rad or m]
  const Eigen::VectorXd& v() const { return v_; }  ///< [rad/s or m/s]
  /// The sensors' readings: of the past, extrapolated to second order in their delay by the
  /// accelerations that the efforts arriving now and all stops and contacts would give. Valid until
  /// the next call.
  struct State {
    const Eigen::VectorXd& q;
    const Eigen::VectorXd& v;
  };
  State Reading();
  /// False once the state has blown up, beyond kFarthest or not finite: its entries are NaN then.
  bool finite() const { return finite_; }

  /// At the current state under `effort` [rad/s^2 or m/s^2], without stops, contacts and Coulomb
  /// friction.
  Eigen::VectorXd Acceleration(const Vector& effort);
  /// The same without allocating.
  void Acceleration(const Vector& effort, Eigen::VectorXd* acceleration);
  /// What contact points do at the current state. Without allocating.
  /// @param heights [m] of each point's lowest spot above the ground.
  /// @param jacobians of those spots, contact_directions() rows each: upwards, and along the
  /// ground.
  void ContactPoints(Eigen::VectorXd* heights, RowMajorMatrix* jacobians);
  int num_contact_points() const { return static_cast<int>(model_->topology().points.size()); }
  int contact_directions() const { return model_->topology().contact_directions(); }
  /// The change of velocities that an impulse [Nm s or N s] makes, at the state of the latest
  /// Acceleration: M^-1 impulse. Without allocating.
  void ImpulseResponse(const Vector& impulse, Eigen::Ref<Eigen::VectorXd> change);
  /// With armature [kg m^2 or kg].
  Eigen::MatrixXd MassMatrix();
  /// Efforts that gravity and inertia exert at zero accelerations.
  Eigen::VectorXd Bias();

 private:
  friend class SimulatorLanes;

  // The step that comes next: in so many substeps of such a length [s]; 0 = none.
  struct Prepared {
    double count = 0, length = 0;
    bool held = false;  // mean_ acts all the time; else what the track says
  };

  void RequireSize(Eigen::Index size) const;
  void RequireEnd(double duration) const;
  void Divide(double duration, bool held);
  bool FindEfforts(int64_t substep);
  void Finish();
  void Take();

  std::shared_ptr<const Model> model_;
  std::unique_ptr<Engine> engine_;
  Physics<double> physics_;
  uint64_t robot_ = 0;  // names physics_: another number, other parameters
  EffortTrack track_;
  Prepared prepared_;
  std::vector<double> mean_, moment_;
  std::vector<double> arriving_;  // efforts that act now
  Eigen::VectorXd q_, v_, reading_q_, reading_v_;
  bool finite_ = true;
};

}  // namespace plumb
