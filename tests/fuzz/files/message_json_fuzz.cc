// libFuzzer: whatever bytes come as a message of any type, they become JSON, or nothing; what the
// type's own decoder takes becomes JSON.

#include "common/message_json.h"

#include <nlohmann/json.hpp>

#include "common/message_scalars.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "tests/fuzz/files/input_file.h"

namespace plumb {
namespace {

template <class Message>
bool TypeDecodes(const std::vector<uint8_t>& bytes) {
  Message message;
  const int size = static_cast<int>(bytes.size());
  return message.decode(bytes.data(), 0, size) == size;
}

bool OwnDecoderTakes(const std::string& type, const std::vector<uint8_t>& bytes) {
  return (type == "driver_status_t" && TypeDecodes<driver_status_t>(bytes)) ||
         (type == "parameter_distribution_t" && TypeDecodes<parameter_distribution_t>(bytes)) ||
         (type == "robot_state_t" && TypeDecodes<robot_state_t>(bytes));
}

}  // namespace
}  // namespace plumb

// The type's number, and what follows its fingerprint, which nobody would guess.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  if (size == 0) return 0;
  const MessageType& type = MessageTypes()[data[0] % MessageTypes().size()];
  std::vector<uint8_t> bytes(8);
  for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<uint8_t>(type.fingerprint >> (56 - 8 * i));
  bytes.insert(bytes.end(), data + 1, data + size);
  std::string json;
  const bool decodes = AppendJson(type, bytes, json);
  if (!decodes) Refuse("it does not decode");
  Require(decodes || !OwnDecoderTakes(type.name, bytes));
  Require(json.size() <= 4096 + 64 * size);
  Require(!decodes || nlohmann::json::accept(json));
  size_t scalars = 0;
  Require(ForEachScalar(type, bytes, [&](const std::string& path, const Scalar&) {
            Require(!path.empty());
            ++scalars;
          }) == decodes);
  Require(scalars <= size);
  return 0;
}
