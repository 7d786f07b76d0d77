#include "common/lcm_guard.h"

#include <dirent.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <utility>

namespace plumb {
namespace {

// Assembles classic BPF with forward labels. A conditional jump reaches only 255 instructions, so
// each one steps over an unconditional jump, whose reach is unlimited.
class Assembler {
 public:
  enum Label { kDrop, kAccept, kFragment, kFirstFragment, kChannelName, kNumLabels };

  void Op(int code, uint32_t k = 0) { program_.push_back({static_cast<uint16_t>(code), 0, 0, k}); }
  void JumpWhen(int test, uint32_t k, Label to) { Branch(test, k, 0, 1, to); }
  void JumpUnless(int test, uint32_t k, Label to) { Branch(test, k, 1, 0, to); }
  void Jump(Label to) {
    open_.emplace_back(program_.size(), to);
    Op(BPF_JMP | BPF_JA);
  }
  void Here(Label label) { at_[label] = program_.size(); }

  std::vector<sock_filter> Finish() {
    for (const auto& [where, label] : open_) {
      program_[where].k = static_cast<uint32_t>(at_[label] - where - 1);
    }
    return program_;
  }

 private:
  void Branch(int test, uint32_t k, uint8_t yes, uint8_t no, Label to) {
    program_.push_back({static_cast<uint16_t>(BPF_JMP | test), yes, no, k});
    Jump(to);
  }

  std::vector<sock_filter> program_;
  std::vector<std::pair<size_t, Label>> open_;
  std::array<size_t, kNumLabels> at_{};
};

}  // namespace

std::vector<sock_filter> LcmGuardProgram(uint32_t max_message) {
  constexpr int kLoadWord = BPF_LD | BPF_W | BPF_ABS, kLoadHalf = BPF_LD | BPF_H | BPF_ABS,
                kLoadByte = BPF_LD | BPF_B | BPF_ABS, kLoadX = BPF_LDX | BPF_W | BPF_MEM;
  constexpr int kEqual = BPF_JEQ | BPF_K, kGreater = BPF_JGT | BPF_K, kGreaterX = BPF_JGT | BPF_X;
  constexpr uint32_t kUdp = 8;  // the filter sees the UDP header first
  constexpr uint32_t kWhole = 0x4c433032, kFragment = 0x4c433033;  // "LC02", "LC03"
  constexpr uint32_t kMaxName = 64;
  using A = Assembler;
  A a;
  // a NUL within reach; a load beyond the end drops
  const auto require_name_at = [&](uint32_t at) {
    for (uint32_t i = 0; i < kMaxName; ++i) {
      a.Op(kLoadByte, at + i);
      a.JumpWhen(kEqual, 0, A::kAccept);
    }
    a.Jump(A::kDrop);
  };
  a.Op(kLoadWord, kUdp);
  a.JumpWhen(kEqual, kFragment, A::kFragment);
  a.JumpUnless(kEqual, kWhole, A::kDrop);
  require_name_at(kUdp + 8);

  a.Here(A::kFragment);  // header: magic, sequence, message size, offset, number, count
  a.Op(kLoadHalf, kUdp + 18);
  a.JumpWhen(kEqual, 0, A::kDrop);
  a.Op(kLoadWord, kUdp + 8);
  a.JumpWhen(kGreater, max_message, A::kDrop);
  a.Op(BPF_ST, 0);
  a.Op(kLoadHalf, kUdp + 16);
  a.JumpWhen(kEqual, 0, A::kFirstFragment);
  a.Op(kLoadX, 0);
  a.Op(kLoadWord, kUdp + 12);
  a.JumpWhen(kGreaterX, 0, A::kDrop);  // offset beyond the size; from here on nothing can wrap
  a.Op(BPF_MISC | BPF_TAX);
  a.Op(BPF_LD | BPF_W | BPF_LEN);
  a.Op(BPF_ALU | BPF_SUB | BPF_K, kUdp + 20);
  a.Op(BPF_ALU | BPF_ADD | BPF_X);
  a.Op(kLoadX, 0);
  a.JumpWhen(kGreaterX, 0, A::kDrop);  // offset + length beyond the size
  a.Jump(A::kAccept);

  a.Here(A::kFirstFragment);  // carries the channel name before its share of the message
  a.Op(kLoadWord, kUdp + 12);
  a.JumpUnless(kEqual, 0, A::kDrop);
  a.Op(kLoadX, 0);
  a.Op(BPF_LD | BPF_W | BPF_LEN);
  a.Op(BPF_ALU | BPF_SUB | BPF_K, kUdp + 20 + kMaxName);
  a.JumpWhen(BPF_JGE | BPF_K, 0x80000000, A::kChannelName);  // negative: shorter than a name, fine
  a.JumpWhen(kGreaterX, 0, A::kDrop);
  a.Here(A::kChannelName);
  require_name_at(kUdp + 20);

  a.Here(A::kAccept);
  a.Op(BPF_RET | BPF_K, 0xffffffff);
  a.Here(A::kDrop);
  a.Op(BPF_RET | BPF_K, 0);
  return a.Finish();
}

int AttachLcmGuard(uint16_t port, uint32_t max_message) {
  auto program = LcmGuardProgram(max_message);
  const sock_fprog attachment{static_cast<unsigned short>(program.size()), program.data()};
  DIR* descriptors = opendir("/proc/self/fd");
  if (!descriptors) return -1;
  int guarded = 0;
  while (const dirent* entry = readdir(descriptors)) {
    if (entry->d_name[0] == '.') continue;
    const int fd = std::atoi(entry->d_name);
    int type = 0;
    socklen_t type_length = sizeof type;
    sockaddr_in address{};
    socklen_t address_length = sizeof address;
    if (getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &type_length) != 0 || type != SOCK_DGRAM ||
        getsockname(fd, reinterpret_cast<sockaddr*>(&address), &address_length) != 0 ||
        address.sin_family != AF_INET || address.sin_port != htons(port)) {
      continue;
    }
    if (setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &attachment, sizeof attachment) == 0)
      ++guarded;
  }
  closedir(descriptors);
  return guarded;
}

}  // namespace plumb
