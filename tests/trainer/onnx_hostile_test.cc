// Models in ONNX that somebody has changed, damaged or made up.
#include <google/protobuf/stubs/logging.h>
#include <onnx/onnx_pb.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>

#include "tests/trainer/sample_policy.h"
#include "trainer/onnx_policy.h"

namespace plumb {
namespace {

using Catch::Contains;
using onnx::ModelProto, onnx::TensorProto;

/// Decodes the small policy's model after a change.
void DecodeChanged(const std::function<void(ModelProto&)>& change) {
  ModelProto model;
  REQUIRE(model.ParseFromString(SmallModel()));
  change(model);
  DecodeOnnxPolicy(model.SerializePartialAsString());
}

/// The error on reading the small policy's model after a change; "" if it is still a policy.
std::string Complaint(const std::function<void(ModelProto&)>& change) {
  try {
    DecodeChanged(change);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TensorProto& Tensor(ModelProto& model, const std::string& name) {
  for (TensorProto& tensor : *model.mutable_graph()->mutable_initializer()) {
    if (tensor.name() == name) return tensor;
  }
  FAIL("no tensor " << name);
  throw;
}

void SetFloat(TensorProto& tensor, size_t index, float value) {
  tensor.mutable_raw_data()->replace(index * sizeof value, sizeof value,
                                     reinterpret_cast<const char*>(&value), sizeof value);
}

void SetProperty(ModelProto& model, const std::string& key, const std::string& value) {
  for (auto& property : *model.mutable_metadata_props()) {
    if (property.key() == key) property.set_value(value);
  }
}

TEST_CASE("notes that other programs make in a model do not matter") {
  CHECK(Complaint([](ModelProto& model) {
          model.set_producer_name("another");
          model.set_doc_string("a note");
          model.mutable_opset_import(0)->clear_domain();
          auto& inferred = *model.mutable_graph()->add_value_info();
          inferred.set_name("clipped");
          auto& property = *model.add_metadata_props();
          property.set_key("colour");
          property.set_value("red");
        }) == "");
}

TEST_CASE("what is not a policy is refused, in words") {
  const google::protobuf::LogSilencer silent;
  const auto check = [](const char* words, const std::function<void(ModelProto&)>& change) {
    INFO(words);
    CHECK_THAT(Complaint(change), Contains(words));
  };
  check("op_type: \"Tanh\" -> \"Relu\"",
        [](ModelProto& m) { m.mutable_graph()->mutable_node(4)->set_op_type("Relu"); });
  check("op_type",
        [](ModelProto& m) { m.mutable_graph()->mutable_node(4)->set_op_type("Nonsense"); });
  check("domain",
        [](ModelProto& m) { m.mutable_graph()->mutable_node(4)->set_domain("com.example"); });
  check("input[0]",
        [](ModelProto& m) { m.mutable_graph()->mutable_node(3)->set_input(0, "scaled"); });
  check("attribute", [](ModelProto& m) {
    m.mutable_graph()->mutable_node(3)->add_attribute()->set_name("alpha");
  });
  check("graph.node", [](ModelProto& m) { *m.mutable_graph()->add_node() = m.graph().node(0); });
  check("graph.node", [](ModelProto& m) { m.mutable_graph()->mutable_node()->RemoveLast(); });
  check("functions", [](ModelProto& m) { m.add_functions()->set_name("Tanh"); });
  check("version: 13 -> 7", [](ModelProto& m) { m.mutable_opset_import(0)->set_version(7); });
  check("no tensor 'observation_mean'", [](ModelProto& m) { m.clear_graph(); });
  check("no tensor 'layer2.bias'", [](ModelProto& m) { Tensor(m, "layer2.bias").set_name("x"); });
  check("weights", [](ModelProto& m) { Tensor(m, "layer3.weight").set_name("x"); });
  check("two tensors of one name",
        [](ModelProto& m) { Tensor(m, "layer2.bias").set_name("layer1.bias"); });
  check("dims[0]: 3 -> -3", [](ModelProto& m) { Tensor(m, "layer1.weight").set_dims(0, -3); });
  check("dims[1]", [](ModelProto& m) {
    Tensor(m, "layer1.weight").set_dims(1, std::numeric_limits<int64_t>::max());
  });
  check("dims",
        [](ModelProto& m) { Tensor(m, "layer1.weight").mutable_dims()->SwapElements(0, 1); });
  check("dim_value", [](ModelProto& m) {
    onnx::TypeProto& type = *m.mutable_graph()->mutable_output(0)->mutable_type();
    type.mutable_tensor_type()->mutable_shape()->mutable_dim(1)->set_dim_value(9);
  });
  check("weights, expected",
        [](ModelProto& m) { Tensor(m, "layer1.weight").mutable_raw_data()->resize(4); });
  check("a layer of 0", [](ModelProto& m) { Tensor(m, "layer1.bias").clear_raw_data(); });
  check("a layer of 5000",
        [](ModelProto& m) { Tensor(m, "layer1.bias").mutable_raw_data()->resize(20'000); });
  check("raw_data", [](ModelProto& m) {  // as many in all, but others
    Tensor(m, "layer1.weight").mutable_raw_data()->append(4, '\0');
    Tensor(m, "layer2.weight")
        .mutable_raw_data()
        ->resize(Tensor(m, "layer2.weight").raw_data().size() - 4);
  });
  check("not raw floats",
        [](ModelProto& m) { Tensor(m, "layer1.bias").mutable_raw_data()->resize(15); });
  check("not raw floats",
        [](ModelProto& m) { Tensor(m, "layer1.bias").set_data_type(TensorProto::DOUBLE); });
  check("float_data", [](ModelProto& m) { Tensor(m, "layer1.bias").add_float_data(1); });
  check("'layer1.bias' in another file", [](ModelProto& m) {
    TensorProto& tensor = Tensor(m, "layer1.bias");
    tensor.clear_raw_data();
    tensor.set_data_location(TensorProto::EXTERNAL);
    auto& location = *tensor.add_external_data();
    location.set_key("location");
    location.set_value("/etc/passwd");
  });
  check("external_data", [](ModelProto& m) { Tensor(m, "layer1.bias").add_external_data(); });
  check("weights are not finite",
        [](ModelProto& m) { SetFloat(Tensor(m, "layer1.bias"), 1, NAN); });
  check("weights are not finite",
        [](ModelProto& m) { SetFloat(Tensor(m, "log_std_value"), 1, INFINITY); });
  check("means are not finite",
        [](ModelProto& m) { SetFloat(Tensor(m, "observation_mean"), 1, NAN); });
  check("scales are not positive",
        [](ModelProto& m) { SetFloat(Tensor(m, "observation_scale"), 1, 1e-40f); });
  check("scales are not positive",
        [](ModelProto& m) { SetFloat(Tensor(m, "action_scale"), 1, -1); });
  check("raw_data", [](ModelProto& m) { SetFloat(Tensor(m, "action_max"), 0, 2); });

  check("'robot' is missing", [](ModelProto& m) { m.clear_metadata_props(); });
  check("a property twice", [](ModelProto& m) { *m.add_metadata_props() = m.metadata_props(0); });
  check("'seed' is no number", [](ModelProto& m) { SetProperty(m, "seed", "-1"); });
  check("'steps' is negative", [](ModelProto& m) { SetProperty(m, "steps", "-1"); });
  check("'steps' is no number", [](ModelProto& m) { SetProperty(m, "steps", "1e9"); });
  check("'period' is not finite", [](ModelProto& m) { SetProperty(m, "period", "nan"); });
  check("'period' is no number", [](ModelProto& m) { SetProperty(m, "period", ""); });
  check("'observations' is no JSON",
        [](ModelProto& m) { SetProperty(m, "observations", "[\"a\""); });
  check("'observations' is no list", [](ModelProto& m) { SetProperty(m, "observations", "3"); });
  check("'actions' is no list of texts", [](ModelProto& m) {
    SetProperty(m, "actions", std::string(100'000, '[') + std::string(100'000, ']'));
  });
  check("1 units of actions, not 2", [](ModelProto& m) { SetProperty(m, "units", "[\"N\"]"); });
  check("'evaluation' is no JSON object",
        [](ModelProto& m) { SetProperty(m, "evaluation", "[]"); });
  check("'evaluation' has", [](ModelProto& m) { SetProperty(m, "evaluation", "{\"a\": \"b\"}"); });
}

TEST_CASE("bytes that are no model are refused, however many they seem to stand for") {
  for (const std::string& bytes :
       {std::string(), std::string("x"), std::string(1000, '\0'), std::string(1000, '\xff'),
        std::string("\x08\x07"), std::string("[robot]\nname = \"pendulum\"\n")}) {
    CHECK_THROWS_AS(DecodeOnnxPolicy(bytes), std::invalid_argument);
  }
  // A graph of which each two bytes are a node.
  const int nodes = 6'000'000;
  std::string bomb;
  for (int i = 0; i < nodes; ++i) bomb += std::string("\x0a\0", 2);
  std::string length;
  for (size_t rest = bomb.size(); rest > 0; rest >>= 7)
    length += static_cast<char>((rest & 127) | (rest > 127 ? 128 : 0));
  CHECK_THROWS_WITH(DecodeOnnxPolicy("\x08\x07\x3a" + length + bomb),
                    Contains("too large besides its weights"));
  // A tensor that says it is much longer than the file.
  CHECK_THROWS_WITH(
      DecodeOnnxPolicy(std::string("\x08\x07\x3a\x0a\x2a\x08\x4a\xf0\xff\xff\xff\x07", 12)),
      Contains("damaged"));
  CHECK_THROWS_WITH(DecodeOnnxPolicy(std::string(20 << 20, '\0')), Contains("longer than 16 MB"));
}

TEST_CASE("a damaged file is refused or is another policy") {
  const std::string good = SmallModel();
  size_t refused = 0, read = 0;
  const auto decode = [&](const std::string& bytes) {
    try {
      const OnnxPolicy policy = DecodeOnnxPolicy(bytes);
      ++read;
      const bool finite = policy.policy.parameters.allFinite() &&
                          policy.policy.observation_mean.allFinite() &&
                          (policy.policy.observation_scale.array() > 0).all() &&
                          (policy.policy.action_scale.array() > 0).all();
      if (!finite || policy.record.observation_names.size() != 3) FAIL_CHECK("not a policy");
    } catch (const std::invalid_argument& error) {
      ++refused;
      if (std::string(error.what()).size() > 2000) FAIL_CHECK("too long");
    }
  };
  for (size_t i = 0; i < good.size(); ++i) {
    decode(good.substr(0, i));
    for (const int flip : {1 << (i % 8), 1 << ((i + 3) % 8), 0xff}) {
      std::string bytes = good;
      bytes[i] = static_cast<char>(bytes[i] ^ flip);
      decode(bytes);
    }
    decode(good.substr(0, i) + good.substr(i + 1));
  }
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = good;
    const auto at = [&] {
      return static_cast<size_t>(random.Uniform(0, static_cast<double>(bytes.size())));
    };
    for (int n = 0; n < 4; ++n) bytes[at()] = static_cast<char>(random.Uniform(0, 256));
    bytes.insert(at(), bytes.substr(at(), 20));
    decode(bytes);
  }
  CHECK(refused > good.size());  // each truncation
  CHECK(read > 100);             // flips within a weight
}

}  // namespace
}  // namespace plumb
