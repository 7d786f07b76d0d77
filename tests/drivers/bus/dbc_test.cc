// A foreign reader of our DBC files: Debian's python3-canmatrix must decode every message as we do.

#include "drivers/bus/dbc.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <sstream>

#include "drivers/bus/bus_plan.h"
#include "drivers/protocols/mit.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Contains;

std::string Source() {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  return source ? source : ".";
}

/// Two MIT motors that answer on one id, an ODrive, an RMD motor, two moteus, an encoder and an
/// IMU.
std::vector<BusDevice> Menagerie() {
  RobotDescription robot{};
  robot.driver.cycle = robot.driver.measurement = 0.002;
  robot.driver.heartbeat_timeout = 0.5;
  const auto joint = [&](const char* name, const char* protocol, int node) {
    JointDescription& j = robot.joints.emplace_back();
    j.name = name;
    j.motor.protocol = protocol;
    j.motor.node = node;
    if (j.motor.protocol == "mit") {
      j.motor.mit = MitDescription{0x10, {.velocity = 10.0 + node, .torque = 3.0 * node}, "a test"};
    }
  };
  joint("left hip", "mit", 0x11);
  joint("left/hip", "mit", 0x12);  // the same identifier
  joint("1st", "cansimple", 2);
  joint("knee", "rmd", 5);
  joint("ankle", "moteus", 6);
  joint("toe", "moteus", 60);
  const auto sensor = [&](const char* name, const char* protocol) {
    SensorDescription& s = robot.sensors.emplace_back();
    s.name = name;
    s.protocol = protocol;
    s.period = 0.002;
    s.node = static_cast<int>(robot.sensors.size());
    s.base = 0x380;
  };
  sensor("yaw", "cia406");
  sensor("pitch", "cia406");
  sensor("imu", "xsens");
  return BusDevices(robot, 0);
}

struct Sent {
  const BusMessage* message;
  Frame frame;
};

/// Random payloads whose numbers are all finite.
std::vector<Sent> RandomFrames(const std::vector<BusDevice>& devices, int each) {
  std::mt19937 random(1);
  std::vector<Sent> sent;
  for (const BusDevice& device : devices) {
    for (const BusMessage& message : device.messages) {
      if (message.layout.count() == 0 || message.remote) continue;
      for (int i = 0; i < each; ++i) {
        Frame frame;
        frame.id = message.id;
        frame.extended = message.extended;
        frame.fd = message.fd;
        frame.length = message.layout.length;
        int tries = 0;
        do {
          REQUIRE(++tries < 1000);
          for (size_t byte = 0; byte < frame.length; ++byte)
            frame.data[byte] = static_cast<uint8_t>(random());
          if (message.selector >= 0) frame.data[0] = static_cast<uint8_t>(message.selector);
        } while (!AllFinite(message.layout, *DecodePayload(message.layout, frame)));
        sent.push_back({&message, frame});
      }
    }
  }
  return sent;
}

void CheckDecodes(const std::vector<BusDevice>& devices) {
  const TemporaryFolder folder;
  const std::string dbc = folder / "bus.dbc", list = folder / "frames";
  std::ofstream(dbc) << ToDbc(devices);
  const std::vector<Sent> sent = RandomFrames(devices, 20);
  {
    std::ofstream file(list);
    for (const Sent& one : sent) {
      const std::string text = ToText(one.frame);
      file << one.frame.id << " " << text.substr(text.rfind('#') + (one.frame.fd ? 2 : 1)) << "\n";
    }
  }
  FILE* pipe = popen(("timeout 60 /usr/bin/python3 " + Source() +
                      "/tests/drivers/bus/decode_dbc.py " + dbc + " " + list + " 2>&1")
                         .c_str(),
                     "r");
  REQUIRE(pipe);
  std::string text;
  std::array<char, 4096> buffer;
  while (const size_t count = fread(buffer.data(), 1, buffer.size(), pipe))
    text.append(buffer.data(), count);
  const int status = pclose(pipe);
  INFO(text.substr(text.size() > 2000 ? text.size() - 2000 : 0));
  REQUIRE(status == 0);

  std::istringstream lines(text);
  std::string line;
  size_t at = 0;
  while (std::getline(lines, line)) {
    // what canmatrix has to say about its formats
    if (line.find('=') == std::string::npos) continue;
    REQUIRE(at < sent.size());
    const auto& [message, frame] = sent[at++];
    std::istringstream words(line);
    uint32_t id = 0;
    words >> id;
    REQUIRE(id == frame.id);
    std::map<std::string, double> foreign;
    for (std::string word; words >> word;) {
      foreign[word.substr(0, word.find('='))] = std::stod(word.substr(word.find('=') + 1));
    }
    const FieldValues ours = *DecodePayload(message->layout, frame);
    INFO(line);
    CHECK(foreign.size() == message->layout.count());
    for (size_t i = 0; i < message->layout.count(); ++i) {
      const std::string name(message->layout.fields[i].name);
      double found = NAN;
      for (const auto& [key, value] : foreign) {
        if (key == name || key.ends_with("_" + name)) found = value;
      }
      INFO(name << " = " << ours[i]);
      CHECK(found == Approx(ours[i]).epsilon(1e-12).margin(1e-12));
    }
  }
  CHECK(at == sent.size());
}

TEST_CASE("canmatrix decodes every message of every protocol as we do") {
  CheckDecodes(Menagerie());
}

TEST_CASE("canmatrix decodes every message of the hopper as we do") {
  CheckDecodes(BusDevices(LoadRobot(Source() + "/robots/hopper"), 0));
}

TEST_CASE("messages of one device and one id are told apart by their first field") {
  BusMessage message;
  message.id = 0x11;
  message.direction = BusMessage::Direction::kToDevice;
  message.layout = {1, "Go", 8, {{{"Code", 0, 8}, {"Speed", 8, 8}}}};
  message.selector = 1;
  BusDevice device{"wheel", "x", {message}, {}};
  message.layout = {2, "Halt", 8, {{{"Code", 0, 8}, {"Speed", 16, 8}}}};
  message.selector = 2;
  device.messages.push_back(message);
  CHECK_THAT(ToDbc({device}),
             Contains("BO_ 17 wheel_Commands: 8 driver\n"
                      " SG_ Code M : 0|8@1+ (1,0) [0|255] \"\" wheel\n"
                      " SG_ Go_Speed m1 : 8|8@1+ (1,0) [0|255] \"\" wheel\n"
                      " SG_ Halt_Speed m2 : 16|8@1+ (1,0) [0|255] \"\" wheel\n\n"));
  CheckDecodes({device});
}

TEST_CASE("a DBC's lines") {
  const std::string dbc = ToDbc(Menagerie());
  CHECK_THAT(dbc, Contains("BU_: _1st ankle driver imu knee left_hip left_hip_2 pitch toe yaw\n"));
  CHECK_THAT(dbc, Contains("BO_ 73 _1st_Get_Encoder_Estimates: 8 _1st\n"
                           " SG_ Pos_Estimate : 0|32@1- (1,0) [0|0] \"rev\" driver\n"
                           " SG_ Vel_Estimate : 32|32@1- (1,0) [0|0] \"rev/s\" driver\n"));
  CHECK_THAT(dbc, Contains("SIG_VALTYPE_ 73 Pos_Estimate : 1;\n"));
  CHECK_THAT(
      dbc,
      Contains(
          "BO_ 16 mit_Reply: 8 left_hip\n SG_ Motor_ID M : 7|8@0+ (1,0) [0|255] \"\" driver\n"));
  CHECK_THAT(dbc, Contains(" SG_ left_hip_Position m17 : 15|16@0+ ("));
  CHECK_THAT(dbc, Contains(" SG_ left_hip_2_Velocity m18 : 31|12@0+ ("));
  CHECK_THAT(dbc, Contains("BO_ 946 imu_RateOfTurn: 6 imu\n SG_ Gyr_X : 7|16@0- (0.001953125,0) "
                           "[-64|63.998046875] \"rad/s\" driver\n"));
  CHECK_THAT(dbc, Contains("BO_ 0 cia406_NMT: 2 driver\n"));
  // Messages of one device and one id.
  CHECK_THAT(dbc,
             Contains("BO_ 325 knee_Commands: 8 driver\n"
                      " SG_ Code M : 0|8@1+ (1,0) [0|255] \"\" knee\n"
                      " SG_ Torque_Current m161 : 32|16@1- (0.01,0) [-327.68|327.67] \"A\" knee\n"
                      " SG_ Watchdog_Time m179 : 32|32@1+ (1,0) [0|4294967295] \"ms\" knee\n"));
  CHECK_THAT(dbc, Contains("BO_ 581 knee_Answers: 8 knee\n SG_ Code M : 0|8@1+"));
  CHECK_THAT(dbc, Contains(" SG_ Angle_Angle m146 : 32|32@1- (0.01,0) "));
  CHECK_THAT(dbc, Contains("BO_ 640 rmd_Shutdown_All: 8 driver\n"));
  // Frames of CAN FD, with ids of 11 bits and of 29.
  CHECK_THAT(dbc, Contains("BO_ 1536 ankle_Answer: 32 ankle\n"
                           " SG_ Mode : 16|8@1- (1,0) [-128|127] \"\" driver\n"
                           " SG_ Position : 40|32@1- (1,0) [0|0] \"rev\" driver\n"));
  CHECK_THAT(dbc, Contains("BO_ 2147516422 ankle_Command: 48 driver\n"));
  CHECK_THAT(dbc, Contains(" SG_ Timeout : 256|16@1- (1,0) [-32768|32767] \"ms\" ankle\n"));
  CHECK_THAT(dbc, Contains("BA_ \"VFrameFormat\" BO_ 1536 14;\n"));
  CHECK_THAT(dbc, Contains("BA_ \"VFrameFormat\" BO_ 2147499008 15;\n"));
  CHECK_THAT(dbc, Contains("BA_ \"VFrameFormat\" BO_ 2147516422 15;\n"));
}

}  // namespace
}  // namespace plumb
