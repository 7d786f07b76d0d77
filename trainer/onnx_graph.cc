#include "trainer/onnx_graph.h"

#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <bit>
#include <initializer_list>
#include <vector>

namespace plumb {
namespace {

using onnx::GraphProto, onnx::ModelProto, onnx::TensorProto, onnx::ValueInfoProto;

static_assert(std::endian::native == std::endian::little, "ONNX keeps numbers so");

constexpr int kIrVersion = 7;
constexpr int kOperatorSet = 13;

void AddTensor(GraphProto& graph, const std::string& name, std::initializer_list<int64_t> shape,
               const float* values) {
  TensorProto& tensor = *graph.add_initializer();
  tensor.set_name(name);
  tensor.set_data_type(TensorProto::FLOAT);
  size_t count = 1;
  for (const int64_t size : shape) {
    tensor.add_dims(size);
    count *= static_cast<size_t>(size);
  }
  tensor.set_raw_data(values, count * sizeof *values);
}

/// Returns the output's name, which is the node's, too.
std::string AddNode(GraphProto& graph, const char* operation,
                    std::initializer_list<std::string> inputs, const std::string& output) {
  onnx::NodeProto& node = *graph.add_node();
  node.set_op_type(operation);
  node.set_name(output);
  for (const std::string& input : inputs) node.add_input(input);
  node.add_output(output);
  return output;
}

onnx::TensorShapeProto& Declare(ValueInfoProto& value, const char* name) {
  value.set_name(name);
  onnx::TypeProto::Tensor& type = *value.mutable_type()->mutable_tensor_type();
  type.set_elem_type(TensorProto::FLOAT);
  return *type.mutable_shape();
}

void DeclareBatch(ValueInfoProto& value, const char* name, int size) {
  onnx::TensorShapeProto& shape = Declare(value, name);
  shape.add_dim()->set_dim_param("batch");
  shape.add_dim()->set_dim_value(size);
}

}  // namespace

std::string LayerName(size_t layer) { return fmt::format("layer{}", layer); }

ModelProto MakeOnnxModel(const GaussianPolicy& policy) {
  ModelProto model;
  model.set_ir_version(kIrVersion);
  model.add_opset_import()->set_version(kOperatorSet);
  model.mutable_opset_import(0)->set_domain("");
  GraphProto& graph = *model.mutable_graph();
  graph.set_name("policy");
  const int observations = policy.shape().observations, actions = policy.shape().actions;
  DeclareBatch(*graph.add_input(), "observation", observations);
  DeclareBatch(*graph.add_output(), "effort", actions);
  DeclareBatch(*graph.add_output(), "action", actions);
  Declare(*graph.add_output(), "log_std").add_dim()->set_dim_value(actions);

  constexpr float kClip = GaussianPolicy::kObservationClip;
  constexpr float kBounds[] = {-kClip, kClip, -1, 1};
  AddTensor(graph, "observation_mean", {observations}, policy.observation_mean.data());
  AddTensor(graph, "observation_scale", {observations}, policy.observation_scale.data());
  AddTensor(graph, "normalised_min", {}, &kBounds[0]);
  AddTensor(graph, "normalised_max", {}, &kBounds[1]);
  AddNode(graph, "Sub", {"observation", "observation_mean"}, "centred");
  AddNode(graph, "Div", {"centred", "observation_scale"}, "scaled");
  std::string activation =
      AddNode(graph, "Clip", {"scaled", "normalised_min", "normalised_max"}, "normalised");

  const std::vector<int> sizes = policy.shape().sizes();
  const float* next = policy.parameters.data();
  for (size_t layer = 1; layer < sizes.size(); ++layer) {
    const int in = sizes[layer - 1], out = sizes[layer];
    const bool last = layer + 1 == sizes.size();
    const std::string name = LayerName(layer), weight = name + ".weight", bias = name + ".bias",
                      sum = last ? "action" : name + ".sum";
    const ptrdiff_t size = ptrdiff_t{in} * out;
    // The parameters' columns of W (out x in) are rows of its transpose, and Gemm multiplies from
    // the right.
    AddTensor(graph, weight, {in, out}, next);
    AddTensor(graph, bias, {out}, next + size);
    next += size + out;
    activation = AddNode(graph, "Gemm", {activation, weight, bias}, sum);
    if (!last) activation = AddNode(graph, "Tanh", {activation}, name);
  }

  AddTensor(graph, "action_min", {}, &kBounds[2]);
  AddTensor(graph, "action_max", {}, &kBounds[3]);
  AddTensor(graph, "action_scale", {actions}, policy.action_scale.data());
  AddTensor(graph, "log_std_value", {actions}, next);
  AddNode(graph, "Clip", {"action", "action_min", "action_max"}, "clipped");
  AddNode(graph, "Mul", {"clipped", "action_scale"}, "effort");
  AddNode(graph, "Identity", {"log_std_value"}, "log_std");
  return model;
}

}  // namespace plumb
