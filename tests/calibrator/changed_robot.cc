#include "tests/calibrator/changed_robot.h"

#include "sim/parameters.h"

namespace plumb {

ChangedRobot Change(const RobotDescription& fitted, const Changes& changes, uint64_t seed) {
  ChangedRobot changed{fitted, HiddenParameters(fitted, seed)};
  for (const auto& [path, value] : changes) {
    std::erase_if(changed.description.frozen,
                  [&, p = path](const FrozenParameter& frozen) { return frozen.name == p; });
    changed.description.parameters.push_back(
        {path, "", ParameterDescription::Coordinate::kLinear, value, 1});
    changed.physical.conservativeResize(changed.physical.size() + 1);
    changed.physical.tail<1>()[0] = value;
  }
  return changed;
}

}  // namespace plumb
