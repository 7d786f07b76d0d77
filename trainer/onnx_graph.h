#pragma once

#include <cstddef>
#include <string>

#include "controller/policy.h"

namespace onnx {
class ModelProto;
}

namespace plumb {

/// The one ONNX model that computes a policy, without a record; trainer/onnx_policy.h says what it
/// takes and gives.
///
///   observation -> Sub mean -> Div scale -> Clip -> Gemm -> Tanh -> ... -> Gemm -> action -> Clip
///   -> Mul action_scale -> effort
///
/// Initializers, all of them raw floats: observation_mean, observation_scale, normalised_min,
/// normalised_max; for each layer <layer>.weight [in, out] and <layer>.bias [out]; action_min,
/// action_max, action_scale, log_std_value.
onnx::ModelProto MakeOnnxModel(const GaussianPolicy& policy);

/// The prefix of a layer's tensors: "layer1" is the first. @param layer counts from 0.
/// All functions of this header are thread-safe.
std::string LayerName(size_t layer);

}  // namespace plumb
