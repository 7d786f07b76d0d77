#include "trainer/onnx_policy.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/util/message_differencer.h>
#include <google/protobuf/wire_format_lite.h>
#include <onnx/checker.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <span>
#include <stdexcept>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/atomic_file.h"
#include "common/config.h"
#include "trainer/onnx_graph.h"

namespace plumb {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;
using google::protobuf::util::MessageDifferencer;
using onnx::GraphProto, onnx::ModelProto, onnx::TensorProto;

constexpr size_t kLongestModel = size_t{16} << 20;  // [bytes] what ReadFile reads
constexpr size_t kMaxStructure = size_t{1} << 20;   // [bytes] of a model besides its weights
constexpr size_t kLongestDifference = 200;          // [characters] of a graph, in an error

[[noreturn]] void Fail(const std::string& what) { throw std::invalid_argument(what); }

/// Adds the lengths of the fields at the end of a path of nested messages. @return false if the
/// bytes are no messages.
bool AddLengths(CodedInputStream& input, std::span<const int> path, size_t& sum) {
  while (const uint32_t tag = input.ReadTag()) {
    if (tag != WireFormatLite::MakeTag(path.front(), WireFormatLite::WIRETYPE_LENGTH_DELIMITED)) {
      if (!WireFormatLite::SkipField(&input, tag)) return false;
      continue;
    }
    int length = 0;
    if (!input.ReadVarintSizeAsInt(&length) || length > input.BytesUntilLimit()) return false;
    if (path.size() == 1) {
      if (!input.Skip(length)) return false;
      sum += static_cast<size_t>(length);
    } else {
      const CodedInputStream::Limit outside = input.PushLimit(length);
      if (!AddLengths(input, path.subspan(1), sum)) return false;
      input.PopLimit(outside);
    }
  }
  return input.ConsumedEntireMessage();
}

ModelProto Parse(std::string_view bytes) {
  if (bytes.size() > kLongestModel) Fail(fmt::format("is longer than {} MB", kLongestModel >> 20));
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  const int size = static_cast<int>(bytes.size());
  CodedInputStream input(data, size);
  const CodedInputStream::Limit none = input.PushLimit(size);
  const int weights[] = {ModelProto::kGraphFieldNumber, GraphProto::kInitializerFieldNumber,
                         TensorProto::kRawDataFieldNumber};
  size_t of_weights = 0;
  if (!AddLengths(input, weights, of_weights)) Fail("is not an ONNX model, or damaged");
  input.PopLimit(none);
  // Two bytes of an empty message become two hundred in memory; weights remain as long as they are.
  if (bytes.size() - of_weights > kMaxStructure)
    Fail("is not a policy: it is too large besides its weights");
  const google::protobuf::LogSilencer silent;
  ModelProto model;
  if (!model.ParseFromArray(data, size)) Fail("is not an ONNX model, or damaged");
  return model;
}

/// The numbers of a graph's tensors by name. Shapes are not looked at: the comparison of the graphs
/// does that.
class Tensors {
 public:
  explicit Tensors(const GraphProto& graph) {
    for (const TensorProto& tensor : graph.initializer()) {
      if (!tensors_.emplace(tensor.name(), &tensor).second) Fail("has two tensors of one name");
    }
  }
  bool contains(const std::string& name) const { return tensors_.contains(name); }
  std::vector<float> Read(const std::string& name) const {
    const auto found = tensors_.find(name);
    if (found == tensors_.end()) Fail("is not a policy: it has no tensor '" + name + "'");
    const TensorProto& tensor = *found->second;
    if (tensor.data_location() != TensorProto::DEFAULT)
      Fail("keeps tensor '" + name + "' in another file");
    const std::string& raw = tensor.raw_data();
    if (tensor.data_type() != TensorProto::FLOAT || raw.size() % sizeof(float) != 0) {
      Fail("has numbers in tensor '" + name + "' that are not raw floats");
    }
    std::vector<float> values(raw.size() / sizeof(float));
    if (!values.empty()) std::memcpy(values.data(), raw.data(), raw.size());
    return values;
  }

 private:
  std::unordered_map<std::string, const TensorProto*> tensors_;
};

GaussianPolicy MakePolicy(const Tensors& tensors) {
  policy_t message{};
  message.purpose = policy_t::CALIBRATE;
  const auto append = [&](const std::vector<float>& values) {
    message.weight.insert(message.weight.end(), values.begin(), values.end());
  };
  message.observation_mean = tensors.Read("observation_mean");
  message.observation_scale = tensors.Read("observation_scale");
  message.action_scale = tensors.Read("action_scale");
  message.num_observations = static_cast<int32_t>(message.observation_mean.size());
  message.num_actions = static_cast<int32_t>(message.action_scale.size());
  message.size = {message.num_observations};
  for (size_t layer = 1; tensors.contains(LayerName(layer) + ".weight"); ++layer) {
    append(tensors.Read(LayerName(layer) + ".weight"));
    const std::vector<float> bias = tensors.Read(LayerName(layer) + ".bias");
    append(bias);
    message.size.push_back(static_cast<int32_t>(bias.size()));
  }
  append(tensors.Read("log_std_value"));
  message.num_layers = static_cast<int32_t>(message.size.size());
  message.num_weights = static_cast<int32_t>(message.weight.size());
  return GaussianPolicy::FromMessage(message);
}

/// Whatever a graph may compute: it is the policy's if it is the one that would be written.
void RequireSameGraph(ModelProto model, const GaussianPolicy& policy) {
  model.clear_producer_name();
  model.clear_producer_version();
  model.clear_doc_string();
  model.clear_domain();
  model.clear_model_version();
  model.clear_metadata_props();
  model.mutable_graph()->clear_doc_string();
  model.mutable_graph()->clear_value_info();
  model.mutable_graph()->set_name("policy");
  std::string differences;
  MessageDifferencer differencer;
  // a default may be written or not
  differencer.set_message_field_comparison(MessageDifferencer::EQUIVALENT);
  differencer.ReportDifferencesToString(&differences);
  if (differencer.Compare(MakeOnnxModel(policy), model)) return;
  const size_t end = std::min(differences.find('\n'), kLongestDifference);
  Fail("is not a policy's graph (expected -> found): " + differences.substr(0, end));
}

PolicyRecord MakeRecord(const ModelProto& model, const PolicyShape& shape) {
  std::map<std::string, std::string> properties;
  for (const onnx::StringStringEntryProto& property : model.metadata_props()) {
    if (!properties.emplace(property.key(), property.value()).second) Fail("has a property twice");
  }
  PolicyRecord record = FromProperties(properties);
  const auto require = [](const char* what, size_t found, int expected) {
    if (found != static_cast<size_t>(expected))
      Fail(fmt::format("has {} {}, not {}", found, what, expected));
  };
  require("names of observations", record.observation_names.size(), shape.observations);
  require("names of actions", record.action_names.size(), shape.actions);
  require("units of actions", record.action_units.size(), shape.actions);
  return record;
}

}  // namespace

std::string EncodeOnnxPolicy(const GaussianPolicy& policy, const PolicyRecord& record) {
  ModelProto model = MakeOnnxModel(policy);
  model.set_producer_name("plumbline");
  for (const auto& [name, value] : ToProperties(record)) {
    onnx::StringStringEntryProto& property = *model.add_metadata_props();
    property.set_key(name);
    property.set_value(value);
  }
  onnx::checker::check_model(model);
  std::string bytes = model.SerializeAsString();
  DecodeOnnxPolicy(bytes);  // what cannot be read is not written
  return bytes;
}

OnnxPolicy DecodeOnnxPolicy(std::string_view bytes) {
  const ModelProto model = Parse(bytes);
  GaussianPolicy policy = MakePolicy(Tensors(model.graph()));
  RequireSameGraph(model, policy);
  PolicyRecord record = MakeRecord(model, policy.shape());
  return {std::move(policy), std::move(record)};
}

// Every writer of protobuf begins with the first field, ModelProto.ir_version.
bool IsOnnx(std::string_view bytes) {
  constexpr uint32_t kTag =
      WireFormatLite::MakeTag(ModelProto::kIrVersionFieldNumber, WireFormatLite::WIRETYPE_VARINT);
  return !bytes.empty() && static_cast<unsigned char>(bytes.front()) == kTag;
}

void WriteOnnxPolicy(const std::string& file, const OnnxPolicy& policy) {
  std::string bytes;
  try {
    bytes = EncodeOnnxPolicy(policy.policy, policy.record);
  } catch (const std::invalid_argument& error) {
    Fail(file + ": such a policy cannot be written: " + error.what());
  }
  WriteAtomically(file, bytes);
}

OnnxPolicy ReadOnnxPolicy(const std::string& file) {
  try {
    return DecodeOnnxPolicy(ReadFile(file));
  } catch (const ConfigError& error) {
    Fail(error.what());  // names it
  } catch (const std::invalid_argument& error) {
    Fail(file + ": " + error.what());
  }
}

}  // namespace plumb
