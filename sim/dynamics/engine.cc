#include "sim/dynamics/engine.h"

#include <cstring>
#include <vector>

#include "sim/dynamics/planar_tree.h"
#include "sim/dynamics/spatial_tree.h"
#include "sim/dynamics/stepper.h"

namespace plumb {
namespace {

#if defined(__AVX512F__)
using Wide = Pack<8>;
#elif defined(__AVX__)
using Wide = Pack<4>;
#else
using Wide = Pack<2>;
#endif

// Arrays of doubles as arrays of Real: copied where packs need an alignment that doubles have not.
template <class Real>
class Aligned {
 public:
  explicit Aligned(size_t count) : copy_(kLanes<Real> > 1 ? count : 0) {}
  const Real* operator()(const double* numbers) {
    if constexpr (kLanes<Real> == 1) {
      return numbers;
    } else {
      if (!numbers) return nullptr;
      std::memcpy(copy_.data(), numbers, copy_.size() * sizeof(Real));
      return copy_.data();
    }
  }

 private:
  std::vector<Real> copy_;
};

template <class Real>
const double* AsDouble(const Real* numbers) {
  return reinterpret_cast<const double*>(numbers);
}

template <class Real, template <class> class Tree>
class EngineOf : public Engine {
 public:
  EngineOf(const Topology& topology, const SimulationSettings& settings, const Terms& terms)
      : stepper_(topology, settings, terms),
        length_(1),
        effort_(static_cast<size_t>(topology.velocities)),
        moment_(effort_) {
    stepper_.physics.links.resize(topology.joints.size());
    stepper_.physics.axes.resize(static_cast<size_t>(topology.velocities));
    stepper_.physics.points.resize(topology.points.size());
    stepper_.physics.solids.resize(topology.solids.size());
    for (const Topology::Joint& joint : topology.joints) {
      if (joint.type != JointDescription::Type::kSpherical) continue;
      stepper_.q[static_cast<size_t>(joint.position)] += 1;  // the unit quaternion
    }
  }

  int lanes() const override { return kLanes<Real>; }
  void SetPhysics(int lane, const Physics<double>& physics) override {
    SetLane(physics, lane, &stepper_.physics);
  }
  void SetPhysics(const Physics<double>& physics) override {
    for (int lane = 0; lane < kLanes<Real>; ++lane) SetLane(physics, lane, &stepper_.physics);
  }
  double* q() override { return reinterpret_cast<double*>(stepper_.q.data()); }
  double* v() override { return reinterpret_cast<double*>(stepper_.v.data()); }

  void Substep(const double* h, const double* effort, const double* moment) override {
    stepper_.Substep(*length_(h), effort_(effort), moment_(moment));
  }
  const double* Acceleration(const double* effort) override {
    return AsDouble(stepper_.Acceleration(effort_(effort)));
  }
  const double* MassMatrix() override { return AsDouble(stepper_.MassMatrix()); }
  const double* Bias() override { return AsDouble(stepper_.Bias()); }
  const double* ContactHeights() override { return AsDouble(stepper_.ContactHeights()); }
  const double* ContactJacobians() override { return AsDouble(stepper_.ContactJacobians()); }
  const double* Response(const double* impulse) override {
    return AsDouble(stepper_.Response(effort_(impulse)));
  }
  void FromReading(const double* effort) override { stepper_.FromReading(effort_(effort)); }
  void ToReading(const double* effort) override { stepper_.ToReading(effort_(effort)); }

 private:
  Stepper<Real, Tree> stepper_;
  Aligned<Real> length_, effort_, moment_;
};

template <class Real>
std::unique_ptr<Engine> Make(const Topology& topology, const SimulationSettings& settings,
                             const Terms& terms) {
  if (topology.planar)
    return std::make_unique<EngineOf<Real, PlanarTree>>(topology, settings, terms);
  return std::make_unique<EngineOf<Real, SpatialTree>>(topology, settings, terms);
}

}  // namespace

__attribute__((visibility("default"))) std::unique_ptr<Engine> MakeEngine(
    const Topology& topology, const SimulationSettings& settings, const Terms& terms) {
  return Make<double>(topology, settings, terms);
}

__attribute__((visibility("default"))) std::unique_ptr<Engine> MakeWideEngine(
    const Topology& topology, const SimulationSettings& settings, const Terms& terms) {
  return Make<Wide>(topology, settings, terms);
}

}  // namespace plumb
