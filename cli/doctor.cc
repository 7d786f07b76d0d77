#include "cli/doctor.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "common/lcm_url.h"
#include "common/messenger.h"
#include "common/signature.h"
#include "drivers/can/can_link.h"
#include "drivers/can/transport.h"
#include "plumb/driver_status_t.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Level = Finding::Level;

constexpr int kCanHardwareType = 280;     // ARPHRD_CAN, linux/if_arp.h
constexpr long kReceiveBuffer = 2097152;  // of the default LCM URL
constexpr int kAwaitStatus = 300;         // [ms]; a driver's status comes ten times a second

/// The fault in "FAULT; cure: CURE" and its cure, or `fallback` where it has none.
Finding Split(Level level, const std::string& text, const std::string& fallback) {
  const size_t cure = text.find("; cure: ");
  return {level, text.substr(0, cure),
          cure == std::string::npos ? fallback : text.substr(cure + 8)};
}

/// Who may command the robot: those who have the key, or whom LCM reaches.
Finding Signatures(const std::string& lcm_url, const std::string& key) {
  if (!key.empty()) {
    try {
      const SigningKey usable(key);
      return {Level::kGood,
              "commands are signed: " + key +
                  " is a key that only its owner may read; give it to driver and controller",
              ""};
    } catch (const std::exception& error) {
      return Split(Level::kBad, error.what(), "");
    }
  }
  if (!StaysOnMachine(lcm_url)) {
    return {Level::kBad,
            "commands are not signed, and LCM at " + lcm_url +
                " leaves this machine: anybody on the network can command the robot",
            "plumb key FILE, and --key FILE for launch, arm, plumb-driver and plumb-controller"};
  }
  return {Level::kGood,
          "commands are not signed, and LCM stays on this machine, whose users are trusted", ""};
}

/// Findings about a driver that is running, from its own status; none if there is no driver.
std::vector<Finding> RunningDriver(Messenger& messenger, const std::string& lcm_url) {
  const Subscriber<driver_status_t> drivers(messenger, "DRIVER_STATUS");
  messenger.Await(kAwaitStatus);
  messenger.Drain();
  if (drivers.received() == 0) return {};
  const driver_status_t& driver = drivers.newest();
  const std::string what =
      driver.commands_signed ? "obeys signed commands only" : "obeys commands that are not signed";
  if (driver.commands_forged == 0)
    return {{Level::kGood, "the driver that is running " + what, ""}};
  return {{Level::kAdvice,
           fmt::format("the driver that is running {}, and has dropped {} that were forged", what,
                       driver.commands_forged),
           "find out who else publishes JOINT_COMMAND or DRIVER_REQUEST at " + lcm_url}};
}

std::vector<Finding> Lcm(const std::string& url, const std::string& key) {
  try {
    Messenger messenger(url);
    std::vector<Finding> findings{{Level::kGood, "LCM opens at " + url, ""}, Signatures(url, key)};
    for (const Finding& finding : RunningDriver(messenger, url)) findings.push_back(finding);
    return findings;
  } catch (const std::exception& error) {
    return {Split(Level::kBad, error.what(), "")};
  }
}

Finding UdpBuffers() {
  long maximum = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> maximum;
  if (maximum >= kReceiveBuffer)
    return {Level::kGood, fmt::format("UDP receive buffers up to {} bytes", maximum), ""};
  return {Level::kAdvice,
          fmt::format("UDP receive buffers only up to {} bytes: policies may get lost", maximum),
          fmt::format("sysctl -w net.core.rmem_max={}", 2 * kReceiveBuffer)};
}

std::vector<Finding> Can() {
  if (!KernelHasCan()) {
    return {{Level::kAdvice, "this kernel has no CAN (the udp: bus needs none)",
             "modprobe can_raw vcan   # on a kernel with CAN modules"}};
  }
  std::vector<Finding> findings;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/sys/class/net", error)) {
    int type = 0;
    std::ifstream(entry.path() / "type") >> type;
    if (type != kCanHardwareType) continue;
    const std::string name = entry.path().filename();
    std::string flags;
    std::ifstream(entry.path() / "flags") >> flags;
    const bool up = (std::strtoul(flags.c_str(), nullptr, 16) & 1) != 0;
    if (up)
      findings.push_back({Level::kGood, "CAN interface " + name + " is up", ""});
    else
      findings.push_back({Level::kAdvice, "CAN interface " + name + " is down",
                          "ip link set " + name + " up type can bitrate 1000000 restart-ms 100"});
  }
  if (findings.empty()) {
    findings.push_back({Level::kAdvice, "the kernel has CAN, but there is no CAN interface",
                        "ip link add dev vcan0 type vcan && ip link set vcan0 up"});
  }
  return findings;
}

std::vector<Finding> Bus(const std::string& url) {
  try {
    const auto bus = OpenTransport(url);
    std::vector<Finding> findings{{Level::kGood, "the bus " + url + " opens", ""}};
    for (const std::string& warning : bus->warnings())
      findings.push_back(Split(Level::kAdvice, warning, "look at it"));
    return findings;
  } catch (const std::exception& error) {
    return {{Level::kBad, error.what(), ""}};
  }
}

std::string CureOfLimit(const std::string& limit) {
  return fmt::format(
      "sudo groupadd -f realtime && sudo usermod -aG realtime $USER && echo '@realtime - {}' | "
      "sudo tee -a /etc/security/limits.d/plumbline.conf, and log in anew",
      limit);
}

std::vector<Finding> RealTime() {
  std::vector<Finding> findings;
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  if (geteuid() == 0 || limit.rlim_cur >= 80)
    findings.push_back({Level::kGood, "real-time priorities are allowed", ""});
  else
    findings.push_back({Level::kAdvice,
                        "real-time priorities are not allowed: --realtime-priority will be refused",
                        CureOfLimit("rtprio 90")});
  getrlimit(RLIMIT_MEMLOCK, &limit);
  if (geteuid() == 0 || limit.rlim_cur >= (64u << 20))
    findings.push_back({Level::kGood, "memory may be locked", ""});
  else
    findings.push_back(
        {Level::kAdvice, "memory may not be locked", CureOfLimit("memlock unlimited")});
  return findings;
}

bool InPath(const std::string& program) {
  const char* path = getenv("PATH");
  std::istringstream folders(std::string(path ? path : "") + ":/usr/sbin:/sbin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (access(fmt::format("{}/{}", folder, program).c_str(), X_OK) == 0) return true;
  }
  return false;
}

std::vector<Finding> Packages() {
  std::vector<Finding> findings;
  const struct {
    const char *program, *package, *purpose;
  } programs[] = {{"lcm-logplayer", "liblcm-bin", "plays what was recorded"},
                  {"candump", "can-utils", "shows SocketCAN frames"},
                  {"can_viewer", "python3-can", "shows the udp: bus"},
                  {"linux.uml", "user-mode-linux", "tests SocketCAN where the kernel has none"}};
  for (const auto& p : programs) {
    if (InPath(p.program))
      findings.push_back({Level::kGood, fmt::format("{} is installed", p.program), ""});
    else
      findings.push_back({Level::kAdvice,
                          fmt::format("{}, which {}, is missing", p.program, p.purpose),
                          fmt::format("apt-get install {}", p.package)});
  }
  return findings;
}

}  // namespace

std::vector<Finding> Examine(const std::string& lcm_url, const std::vector<std::string>& buses,
                             const std::string& key) {
  std::vector<Finding> findings = Lcm(lcm_url, key);
  const auto add = [&](const std::vector<Finding>& group) {
    findings.insert(findings.end(), group.begin(), group.end());
  };
  add({UdpBuffers()});
  add(Can());
  for (const std::string& bus : buses) add(Bus(bus));
  add(RealTime());
  add(Packages());
  return findings;
}

int Doctor(const std::string& lcm_url, const std::vector<std::string>& buses,
           const std::string& key) {
  int status = 0;
  for (const Finding& finding : Examine(lcm_url, buses, key)) {
    const char* mark = finding.level == Level::kGood     ? "good  "
                       : finding.level == Level::kAdvice ? "advice"
                                                         : "BAD   ";
    std::cout << mark << "  " << finding.what << "\n";
    if (!finding.cure.empty()) std::cout << "        cure: " << finding.cure << "\n";
    if (finding.level == Level::kBad) status = 1;
  }
  return status;
}

}  // namespace plumb
