#include "sim/dynamics/engine.h"

#include "sim/dynamics/planar_tree.h"
#include "sim/dynamics/spatial_tree.h"

namespace plumb {
namespace {

#if defined(__AVX512F__)
using Wide = Pack<8>;
#elif defined(__AVX__)
using Wide = Pack<4>;
#else
using Wide = Pack<2>;
#endif

// A pack is as many doubles in a row.
template <class Real>
const Real* AsReal(const double* numbers) {
  return reinterpret_cast<const Real*>(numbers);
}
template <class Real>
const double* AsDouble(const Real* numbers) {
  return reinterpret_cast<const double*>(numbers);
}

template <class Real, template <class> class Tree>
class EngineOf : public Engine {
 public:
  EngineOf(const Topology& topology, const SimulationSettings& settings, const Terms& terms)
      : stepper_(topology, settings, terms) {
    stepper_.physics.links.resize(topology.joints.size());
    stepper_.physics.axes.resize(static_cast<size_t>(topology.velocities));
    stepper_.physics.points.resize(topology.points.size());
    for (const Topology::Joint& joint : topology.joints) {
      if (joint.type != JointDescription::Type::kSpherical) continue;
      stepper_.q[static_cast<size_t>(joint.position)] += 1;  // the unit quaternion
    }
  }

  int lanes() const override { return kLanes<Real>; }
  void SetPhysics(int lane, const Physics<double>& physics) override { SetLane(physics, lane, &stepper_.physics); }
  double* q() override { return reinterpret_cast<double*>(stepper_.q.data()); }
  double* v() override { return reinterpret_cast<double*>(stepper_.v.data()); }

  void Substep(double h, const double* effort, const double* moment) override {
    stepper_.Substep(h, AsReal<Real>(effort), AsReal<Real>(moment));
  }
  const double* Acceleration(const double* effort) override {
    return AsDouble(stepper_.Acceleration(AsReal<Real>(effort)));
  }
  const double* MassMatrix() override { return AsDouble(stepper_.MassMatrix()); }
  const double* Bias() override { return AsDouble(stepper_.Bias()); }
  void FromReading(const double* effort) override { stepper_.FromReading(AsReal<Real>(effort)); }
  void ToReading(const double* effort) override { stepper_.ToReading(AsReal<Real>(effort)); }

 private:
  Stepper<Real, Tree> stepper_;
};

template <class Real>
std::unique_ptr<Engine> Make(const Topology& topology, const SimulationSettings& settings, const Terms& terms) {
  if (topology.planar) return std::make_unique<EngineOf<Real, PlanarTree>>(topology, settings, terms);
  return std::make_unique<EngineOf<Real, SpatialTree>>(topology, settings, terms);
}

}  // namespace

__attribute__((visibility("default"))) std::unique_ptr<Engine> MakeEngine(const Topology& topology,
                                                                          const SimulationSettings& settings,
                                                                          const Terms& terms) {
  return Make<double>(topology, settings, terms);
}

__attribute__((visibility("default"))) std::unique_ptr<Engine> MakeWideEngine(const Topology& topology,
                                                                              const SimulationSettings& settings,
                                                                              const Terms& terms) {
  return Make<Wide>(topology, settings, terms);
}

}  // namespace plumb
