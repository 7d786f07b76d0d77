#include "drivers/bus/dbc.h"

#include <fmt/format.h>

#include <cctype>
#include <map>
#include <set>

namespace plumb {
namespace {

using Direction = BusMessage::Direction;

constexpr char kDriver[] = "driver";
constexpr uint32_t kExtendedFlag = 0x80000000;
// The attribute by which others tell frames of CAN FD; the last two of its values are those.
constexpr char kFormats[] =
    "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\","
    "\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\","
    "\"reserved\",\"reserved\",\"reserved\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n"
    "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n";
constexpr int kStandardFd = 14, kExtendedFd = 15;

// C identifiers are all that a DBC allows.
std::string Identifier(const std::string& text) {
  std::string identifier;
  for (const char c : text) identifier += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  if (identifier.empty() || std::isdigit(static_cast<unsigned char>(identifier[0])))
    identifier.insert(0, "_");
  return identifier;
}

// A name that nothing else has.
std::string Unique(const std::string& wish, std::set<std::string>& taken) {
  std::string name = Identifier(wish);
  for (int i = 2; !taken.insert(name).second; ++i) name = fmt::format("{}_{}", Identifier(wish), i);
  return name;
}

// DBC counts big-endian fields from their most significant bit, and bits within a byte from the
// least significant.
int StartBit(const Field& field) {
  return field.order == Field::Order::kBigEndian ? field.bit / 8 * 8 + 7 - field.bit % 8
                                                 : field.bit;
}

std::string Signal(const Field& field, const std::string& name, const std::string& multiplex,
                   const std::string& receiver) {
  const bool integer = field.kind != Field::Kind::kFloat;
  return fmt::format(" SG_ {} {}: {}|{}@{}{} ({},{}) [{}|{}] \"{}\" {}\n", name,
                     multiplex.empty() ? "" : multiplex + " ", StartBit(field), field.bits,
                     field.order == Field::Order::kBigEndian ? 0 : 1,
                     field.kind == Field::Kind::kUnsigned ? '+' : '-', field.scale, field.offset,
                     integer ? field.lowest() : 0, integer ? field.highest() : 0, field.unit,
                     receiver);
}

struct Sender {
  const BusDevice* device;
  const BusMessage* message;
  std::string node;  ///< the device's name in the file
};

}  // namespace

std::string ToDbc(const std::vector<BusDevice>& devices) {
  std::set<std::string> nodes = {kDriver}, messages;
  std::map<uint32_t, std::vector<Sender>> by_id;
  for (const BusDevice& device : devices) {
    const std::string node = Unique(device.name, nodes);
    for (const BusMessage& message : device.messages) {
      if (message.layout.count() == 0 || message.remote) continue;
      std::vector<Sender>& senders = by_id[message.id | (message.extended ? kExtendedFlag : 0)];
      // What is for all the driver says once.
      if (senders.empty() || !message.shared || message.direction == Direction::kFromDevice)
        senders.push_back({&device, &message, node});
    }
  }
  std::string body, floats, formats;
  for (const auto& [id, senders] : by_id) {
    const BusMessage& first = *senders[0].message;
    const bool from_device = first.direction == Direction::kFromDevice;
    const bool multiplexed = first.selector >= 0;
    const bool several = multiplexed && !first.shared;  // messages of one device
    const std::string label = first.shared ? senders[0].device->protocol : senders[0].device->name,
                      what = !several      ? std::string(first.layout.name)
                             : from_device ? "Answers"
                                           : "Commands";
    body +=
        fmt::format("BO_ {} {}: {} {}\n", id, Unique(fmt::format("{}_{}", label, what), messages),
                    first.layout.length, from_device ? senders[0].node : kDriver);
    const std::string receiver = from_device    ? kDriver
                                 : first.shared ? "Vector__XXX"
                                                : senders[0].node;
    if (first.fd) {
      formats += fmt::format("BA_ \"VFrameFormat\" BO_ {} {};\n", id,
                             first.extended ? kExtendedFd : kStandardFd);
    }
    std::set<std::string> signals;
    for (const Sender& sender : senders) {
      const Layout& layout = sender.message->layout;
      for (size_t i = 0; i < layout.count(); ++i) {
        const Field& field = layout.fields[i];
        std::string multiplex, name(field.name);
        if (multiplexed && i == 0) {
          if (&sender != &senders[0]) continue;
          multiplex = "M";
        } else if (multiplexed) {
          multiplex = fmt::format("m{}", sender.message->selector);
          name = fmt::format("{}_{}", several ? layout.name : sender.node, field.name);
        }
        name = Unique(name, signals);
        body += Signal(field, name, multiplex, receiver);
        if (field.kind == Field::Kind::kFloat)
          floats += fmt::format("SIG_VALTYPE_ {} {} : 1;\n", id, name);
      }
    }
    body += "\n";
  }
  std::string text = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_:";
  for (const std::string& node : nodes) text += " " + node;
  if (!formats.empty()) formats.insert(0, kFormats);
  return text + "\n\n" + body + formats + floats;
}

}  // namespace plumb
