#include "trainer/onnx_policy.h"

#include <google/protobuf/stubs/logging.h>
#include <onnx/onnx_pb.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"
#include "trainer/checkpoint.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

using Catch::Contains;
using nlohmann::json;
using onnx::ModelProto, onnx::TensorProto;

/// Sums of weights of the order of 1, as in a network that has been trained, and a normaliser that
/// is not the identity.
GaussianPolicy RandomPolicy(const PolicyShape& shape, uint64_t seed = 1) {
  GaussianPolicy policy(shape);
  Random random(seed);
  const auto fill = [&](Eigen::Ref<Eigen::VectorXf> values, double mean, double spread) {
    for (float& value : values) value = static_cast<float>(mean + random.Uniform(-spread, spread));
  };
  const std::vector<int> sizes = shape.sizes();
  Eigen::Index next = 0;
  for (size_t layer = 1; layer < sizes.size(); ++layer) {
    const int count = (sizes[layer - 1] + 1) * sizes[layer];
    fill(policy.parameters.segment(next, count), 0, std::sqrt(3.0 / sizes[layer - 1]));
    next += count;
  }
  fill(policy.parameters.tail(shape.actions), -1, 1);
  fill(policy.observation_mean, 0, 3);
  fill(policy.observation_scale, 2, 1.9);
  fill(policy.action_scale, 100, 99);
  return policy;
}

PolicyRecord Record(const PolicyShape& shape) {
  PolicyRecord record;
  record.robot = "quoted \"robot\"\n";
  record.task = "";
  for (int i = 0; i < shape.observations; ++i)
    record.observation_names.push_back("o" + std::to_string(i) + " [m²]");
  for (int i = 0; i < shape.actions; ++i)
    record.action_names.push_back("joint, " + std::to_string(i));
  record.action_units.assign(static_cast<size_t>(shape.actions), "Nm");
  record.period = 1.0 / 3;
  record.posterior = "posterior.json 0123456789abcdef";
  record.version = "plumb 0";
  record.seed = std::numeric_limits<uint64_t>::max();
  record.steps = std::numeric_limits<int64_t>::max();
  record.training_return = -0.1 - 0.2;
  record.evaluation = {{"mean_return", -1.0 / 7}, {"episodes", 100}};
  return record;
}

std::vector<float> Bits(const GaussianPolicy& policy) {
  std::vector<float> all;
  for (const Eigen::VectorXf* v : {&policy.parameters, &policy.observation_mean,
                                   &policy.observation_scale, &policy.action_scale}) {
    all.insert(all.end(), v->begin(), v->end());
  }
  return all;
}

bool SameBits(const GaussianPolicy& a, const GaussianPolicy& b) {
  const std::vector<float> one = Bits(a), other = Bits(b);
  return a.shape() == b.shape() &&
         std::memcmp(one.data(), other.data(), one.size() * sizeof(float)) == 0;
}

const PolicyShape kSmall{3, {4, 5}, 2};

std::string Small() { return EncodeOnnxPolicy(RandomPolicy(kSmall), Record(kSmall)); }

/// Decodes the small policy's model after a change.
void DecodeChanged(const std::function<void(ModelProto&)>& change) {
  ModelProto model;
  REQUIRE(model.ParseFromString(Small()));
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

std::string Source() { return std::getenv("PLUMBLINE_SOURCE"); }

TEST_CASE("a policy and its record survive ONNX to the bit") {
  for (const PolicyShape& shape :
       {kSmall, PolicyShape{1, {}, 1}, PolicyShape{11, {64, 64}, 3},
        PolicyShape{2, {1, 2, 3, 4, 5, 6, 7, 8}, 4}, PolicyShape{500, {1000, 700}, 7}}) {
    GaussianPolicy policy = RandomPolicy(shape);
    policy.parameters[0] = -0.0f;
    policy.parameters[policy.parameters.size() - 1] = std::numeric_limits<float>::denorm_min();
    const PolicyRecord record = Record(shape);
    const OnnxPolicy read = DecodeOnnxPolicy(EncodeOnnxPolicy(policy, record));
    CHECK(SameBits(read.policy, policy));
    CHECK(read.record == record);
  }
  // Entries that may be missing.
  PolicyRecord record = Record(kSmall);
  record.training_return.reset();
  record.evaluation.clear();
  CHECK(DecodeOnnxPolicy(EncodeOnnxPolicy(RandomPolicy(kSmall), record)).record == record);
}

TEST_CASE("a file of a policy is written whole, and named where it cannot be") {
  const TemporaryFolder folder;
  const OnnxPolicy policy{RandomPolicy(kSmall), Record(kSmall)};
  WriteOnnxPolicy(folder / "p.onnx", policy);
  CHECK(SameBits(ReadOnnxPolicy(folder / "p.onnx").policy, policy.policy));
  CHECK(Read(folder / "p.onnx") == Small());
  CHECK_FALSE(std::filesystem::exists(folder / "p.onnx.part"));
  CHECK_THROWS_WITH(WriteOnnxPolicy("/nonexistent/p.onnx", policy),
                    Contains("/nonexistent/p.onnx"));
  CHECK_THROWS_WITH(ReadOnnxPolicy(folder / "none"),
                    Contains(folder / "none") && Contains("cannot be opened"));
  CHECK_THROWS_AS(ReadOnnxPolicy(folder / "none"), std::invalid_argument);

  const auto refused = [&](const OnnxPolicy& wrong, const std::string& why) {
    CHECK_THROWS_WITH(WriteOnnxPolicy(folder / "w.onnx", wrong),
                      Contains(folder / "w.onnx") && Contains(why));
    CHECK_FALSE(std::filesystem::exists(folder / "w.onnx"));
  };
  OnnxPolicy wrong = policy;
  wrong.policy.parameters[3] = NAN;
  refused(wrong, "not finite");
  wrong = policy;
  wrong.policy.action_scale[1] = 0;
  refused(wrong, "not positive");
  wrong = policy;
  wrong.record.observation_names.pop_back();
  refused(wrong, "2 names of observations, not 3");
  wrong = policy;
  wrong.record.training_return = NAN;
  refused(wrong, "'training_return' is not finite");
  wrong = policy;
  wrong.record.evaluation["mean_return"] = INFINITY;
  refused(wrong, "'evaluation'");
  wrong = policy;
  wrong.record.period = 0;
  refused(wrong, "'period' is not positive");
  const PolicyShape large{10, {2000, 2100}, 1};
  refused({RandomPolicy(large), Record(large)}, "longer than 16 MB");
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
  const std::string good = Small();
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

TEST_CASE("a program that knows no policies computes what the policy does") {
  const TemporaryFolder folder;
  Random random(7);
  for (const PolicyShape& shape : {kSmall, PolicyShape{1, {}, 1}, PolicyShape{11, {64, 64}, 3},
                                   PolicyShape{3, {128, 128}, 1}}) {
    const GaussianPolicy policy = RandomPolicy(shape, 5);
    WriteOnnxPolicy(folder / "p.onnx", {policy, Record(shape)});
    json observations = json::array(), actions = json::array(), efforts = json::array();
    int beyond = 0;
    for (int row = 0; row < 200; ++row) {
      Eigen::VectorXf observation(shape.observations);
      // from row 100 on some are clipped
      const double spread = row < 100 ? 3 : row < 190 ? 30 : 1e6;
      for (float& entry : observation) entry = static_cast<float>(random.Uniform(-spread, spread));
      const Eigen::VectorXf action = policy.Mean(observation);
      const Eigen::VectorXf effort =
          action.cwiseMax(-1).cwiseMin(1).cwiseProduct(policy.action_scale);
      beyond += (action.array().abs() > 1).any();
      observations.push_back(std::vector<float>(observation.begin(), observation.end()));
      actions.push_back(std::vector<float>(action.begin(), action.end()));
      efforts.push_back(std::vector<float>(effort.begin(), effort.end()));
    }
    CHECK(beyond > 0);
    CHECK(beyond < 200);
    const std::vector<float> log_std(policy.log_std().begin(), policy.log_std().end());
    const std::vector<float> scale(policy.action_scale.begin(), policy.action_scale.end());
    const std::vector<float> ones(static_cast<size_t>(shape.actions), 1);
    std::ofstream(folder / "cases.json")
        << json{{"inputs", {{"observation", observations}}},
                {"outputs", {{"effort", efforts}, {"action", actions}, {"log_std", log_std}}},
                {"units", {{"effort", scale}, {"action", ones}, {"log_std", ones}}}};
    const Outcome outcome =
        Shell("/usr/bin/python3 " + Source() + "/tests/trainer/onnx_reader.py " +
              folder / "p.onnx" + " " + folder / "cases.json" + " 1e-6");
    INFO(outcome.text);
    CHECK(outcome.status == 0);
  }
}

TEST_CASE("a policy is loaded from either file, and only for its own robot and task") {
  const TemporaryFolder folder;
  const RobotDescription robot = LoadRobot(Source() + "/robots/pendulum");
  const auto task = MakeTask(robot);
  GaussianPolicy policy = RandomPolicy({3, {4}, 1});
  policy.action_scale = robot.effort_limits().cast<float>();
  const PolicyRecord record = MakePolicyRecord(robot, *task);
  CHECK(record.robot == "pendulum");
  CHECK(record.action_names == std::vector<std::string>{"pivot"});
  CHECK(record.action_units == std::vector<std::string>{"Nm"});
  CHECK_THAT(record.version, Contains("plumb "));
  const std::string file = folder / "of any name";
  WriteOnnxPolicy(file, {policy, record});
  CHECK(SameBits(LoadPolicy(file, robot, *task), policy));
  Checkpoint checkpoint{};
  checkpoint.policy = policy.ToMessage();
  SaveCheckpoint(file, checkpoint);
  CHECK(SameBits(LoadPolicy(file, robot, *task), policy));

  const auto refused = [&](const std::string& words,
                           const std::function<void(PolicyRecord&)>& change) {
    PolicyRecord other = record;
    change(other);
    WriteOnnxPolicy(file, {policy, other});
    CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains(file) && Contains(words));
    CHECK_THROWS_AS(LoadPolicy(file, robot, *task), std::invalid_argument);
  };
  refused("another robot: \"hopper\", not \"pendulum\"",
          [](PolicyRecord& r) { r.robot = "hopper"; });
  refused("another task: \"reach\"", [](PolicyRecord& r) { r.task = "reach"; });
  refused("another control period [s]: 0.02, not 0.05", [](PolicyRecord& r) { r.period = 0.02; });
  refused("list of observations",
          [](PolicyRecord& r) { std::swap(r.observation_names[0], r.observation_names[1]); });
  refused("driven joints", [](PolicyRecord& r) { r.action_names = {"knee"}; });
  refused("units of effort", [](PolicyRecord& r) { r.action_units = {"N"}; });
  refused("...", [](PolicyRecord& r) { r.robot = std::string(10'000, 'x'); });

  policy.action_scale *= 2;
  WriteOnnxPolicy(file, {policy, record});
  CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains("effort limits"));
  std::ofstream(file) << "neither";
  CHECK_THROWS_WITH(LoadPolicy(file, robot, *task), Contains(file + ": is neither"));
}

}  // namespace
}  // namespace plumb
