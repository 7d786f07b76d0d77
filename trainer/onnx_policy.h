#pragma once

#include <string>
#include <string_view>

#include "controller/policy.h"
#include "trainer/policy_record.h"

namespace plumb {

/// A policy and what is known of it.
struct OnnxPolicy {
  GaussianPolicy policy;
  PolicyRecord record;
};

/// A policy as an ONNX model (operator set 13, IR version 7), for any ONNX runtime:
///   input  `observation` [batch, observations]  float, as the task gives them
///   output `effort`      [batch, actions]       float [Nm or N]: the mean action clipped to
///                                               [-1, 1], times action_scale
///   output `action`      [batch, actions]       float, mean action in policy units, not clipped
///   output `log_std`     [actions]              float, ln sd of the actions in policy units
/// The normaliser is in the graph. Weights are initializers, in the model itself. The record is in
/// metadata_props (docs/policy.md). For what is not finite in, the outputs are not specified.
/// Thread-safe.
/// @throws std::invalid_argument for what could not be read back: numbers that are not finite,
/// scales that are not positive, a record without a name for each observation and action, more than
/// 16 MB.
std::string EncodeOnnxPolicy(const GaussianPolicy& policy, const PolicyRecord& record);

/// The inverse, to the same bits. Only the graph that EncodeOnnxPolicy makes is a policy; what says
/// nothing of the numbers (doc strings, inferred shapes, the producer, further metadata) may
/// differ. For bytes of any origin: takes memory of the order of their length. Thread-safe. @throws
/// std::invalid_argument saying what is wrong.
OnnxPolicy DecodeOnnxPolicy(std::string_view bytes);

/// Whether a file that begins with these bytes may be an ONNX model.
bool IsOnnx(std::string_view bytes);

/// Writes the file atomically. @throws std::invalid_argument like EncodeOnnxPolicy,
/// std::runtime_error if the file cannot be written; both name the file.
void WriteOnnxPolicy(const std::string& file, const OnnxPolicy& policy);

/// @throws std::invalid_argument naming the file and what is wrong with it.
OnnxPolicy ReadOnnxPolicy(const std::string& file);

}  // namespace plumb
