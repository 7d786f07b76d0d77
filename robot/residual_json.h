#pragma once

#include <memory>
#include <nlohmann/json.hpp>

#include "robot/json_field.h"
#include "robot/residual.h"

namespace plumb {

// Thread-safe.

/// The double that prints as a single-precision number does, with as few digits as tell it: read
/// back and rounded to single precision it has the same bits. NaN and infinities stay.
double ShortestSingle(double number);

/// The "residual" of posterior.json (docs/posterior.md has its schema). Numbers are rounded to
/// single precision, which a residual of FitResidual has anyway, but for the draws' coordinates.
nlohmann::ordered_json ResidualJson(const Residual& residual);

/// Such an object. @param parameters of the robot. @param outputs positions and velocities.
/// @throws std::runtime_error naming the field that is missing, of another type or size, not
/// finite, or not positive where it has to be.
std::shared_ptr<const Residual> ReadResidual(const JsonField& field, size_t parameters,
                                             size_t outputs);

}  // namespace plumb
