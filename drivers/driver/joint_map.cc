#include "drivers/driver/joint_map.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace plumb {

JointMap::JointMap(const MotorDescription& motor)
    : ratio_(motor.gear * motor.sign), offset_(motor.offset) {
  if (!(motor.gear > 0) || !std::isfinite(motor.gear) || (motor.sign != 1 && motor.sign != -1) ||
      !std::isfinite(motor.offset)) {
    throw std::invalid_argument(
        fmt::format("gear {} must be positive, sign {} must be 1 or -1, offset {} finite",
                    motor.gear, motor.sign, motor.offset));
  }
}

}  // namespace plumb
