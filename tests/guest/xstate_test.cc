// Does on any processor what linux.uml does on one with AMX: it takes only the beginning of another
// process's extended registers, changes it, and hands it back. Linked to the library that is
// preloaded into linux.uml.

#include <elf.h>
#include <errno.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <vector>

namespace plumb {
namespace {

// The legacy area, with x87 and the xmm registers, and the header: what every XSAVE state begins
// with.
constexpr size_t kBeginning = 512 + 64;
constexpr size_t kXmm0 = 160;

[[noreturn]] void Skip(const char* reason) {
  std::cout << "skipped: " << reason << std::endl;
  std::exit(77);
}

using Ymm = std::array<double, 4>;

/// Shared with the traced process.
struct Registers {
  Ymm before[2], after[2];
  long double x87_before, x87_after;
};

/// A traced process that has loaded its registers and stopped, and stores them when it goes on.
class Traced {
 public:
  Traced() {
    void* const page =
        mmap(nullptr, sizeof(Registers), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    REQUIRE(page != MAP_FAILED);
    registers = new (page) Registers{.before = {{1.25, 2.5, 3.75, 5}, {-1, -2, -3, -4}},
                                     .after = {},
                                     .x87_before = 3.25L,
                                     .x87_after = 0};
    pid = fork();
    REQUIRE(pid >= 0);
    if (pid == 0) Run();
    int status = 0;
    REQUIRE(waitpid(pid, &status, 0) == pid);
    char byte[8];
    iovec part{byte, sizeof byte};
    if (!WIFSTOPPED(status) ||
        syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &part) != 0) {
      Skip("no process may trace another here");
    }
    REQUIRE(WSTOPSIG(status) == SIGTRAP);
  }
  ~Traced() {
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
    munmap(registers, sizeof *registers);
  }
  Traced(const Traced&) = delete;
  Traced& operator=(const Traced&) = delete;

  void GoOnToItsEnd() {
    REQUIRE(ptrace(PTRACE_CONT, pid, nullptr, nullptr) == 0);
    int status = 0;
    REQUIRE(waitpid(pid, &status, 0) == pid);
    REQUIRE(WIFEXITED(status));
    REQUIRE(WEXITSTATUS(status) == 0);
  }

  Registers* registers;
  pid_t pid;

 private:
  [[noreturn]] void Run() {
    alarm(20);  // whatever becomes of the tracer
    if (syscall(SYS_ptrace, PTRACE_TRACEME, 0, nullptr, nullptr) != 0) _exit(77);
    Registers& r = *registers;
    asm volatile(
        "fldt %[x87_before]\n\t"
        "vmovupd %[before0], %%ymm0\n\t"
        "vmovupd %[before1], %%ymm15\n\t"
        "int3\n\t"
        "vmovupd %%ymm0, %[after0]\n\t"
        "vmovupd %%ymm15, %[after1]\n\t"
        "vzeroupper\n\t"
        "fstpt %[x87_after]"
        : [after0] "=m"(r.after[0]), [after1] "=m"(r.after[1]), [x87_after] "=m"(r.x87_after)
        : [before0] "m"(r.before[0]), [before1] "m"(r.before[1]), [x87_before] "m"(r.x87_before)
        : "xmm0", "xmm15", "memory");
    _exit(0);
  }
};

std::vector<char> ExtendedRegisters(pid_t pid, size_t size) {
  std::vector<char> bytes(size);
  iovec part{bytes.data(), bytes.size()};
  REQUIRE(ptrace(PTRACE_GETREGSET, pid, NT_X86_XSTATE, &part) == 0);
  bytes.resize(part.iov_len);
  return bytes;
}

void RequireAvx() {
  if (!__builtin_cpu_supports("avx"))
    Skip("this processor has no registers beyond the beginning of the state");
}

TEST_CASE("without the library a part of the extended registers is refused") {
  RequireAvx();
  Traced traced;
  std::vector<char> beginning = ExtendedRegisters(traced.pid, kBeginning);
  iovec part{beginning.data(), beginning.size()};
  if (syscall(SYS_ptrace, PTRACE_SETREGSET, traced.pid, NT_X86_XSTATE, &part) == 0) {
    WARN("this kernel takes a part: the library is not needed here");
  } else {
    CHECK(errno == EFAULT);
  }
}

TEST_CASE("the beginning of the extended registers can be handed back, and the rest stays") {
  RequireAvx();
  Traced traced;
  const std::vector<char> whole = ExtendedRegisters(traced.pid, 1 << 16);
  REQUIRE(whole.size() > kBeginning);
  std::vector<char> beginning = ExtendedRegisters(traced.pid, kBeginning);
  REQUIRE(beginning.size() == kBeginning);
  const std::array<double, 2> changed = {100, 200};
  std::memcpy(beginning.data() + kXmm0, changed.data(), sizeof changed);
  iovec part{beginning.data(), beginning.size()};
  REQUIRE(ptrace(PTRACE_SETREGSET, traced.pid, NT_X86_XSTATE, &part) == 0);

  traced.GoOnToItsEnd();
  CHECK(traced.registers->after[0] == Ymm{100, 200, 3.75, 5});
  CHECK(traced.registers->after[1] == traced.registers->before[1]);
  CHECK(traced.registers->x87_after == traced.registers->x87_before);
}

TEST_CASE("extended registers that are whole are handed back as they are") {
  RequireAvx();
  Traced traced;
  std::vector<char> whole = ExtendedRegisters(traced.pid, 1 << 16);
  const std::array<double, 2> changed = {100, 200};
  std::memcpy(whole.data() + kXmm0, changed.data(), sizeof changed);
  // More than whole, as linux.uml has it on a processor with less: the kernel takes what it knows.
  whole.resize(whole.size() + 8);
  iovec all{whole.data(), whole.size()};
  REQUIRE(ptrace(PTRACE_SETREGSET, traced.pid, NT_X86_XSTATE, &all) == 0);
  traced.GoOnToItsEnd();
  CHECK(traced.registers->after[0] == Ymm{100, 200, 3.75, 5});
  CHECK(traced.registers->after[1] == traced.registers->before[1]);
  CHECK(traced.registers->x87_after == traced.registers->x87_before);
}

TEST_CASE("other requests are as they were") {
  RequireAvx();
  Traced traced;
  errno = EAGAIN;
  CHECK(ptrace(PTRACE_PEEKDATA, traced.pid, &traced.registers->before[1], nullptr) != -1);
  CHECK(errno == 0);
  errno = 0;
  CHECK(ptrace(PTRACE_PEEKDATA, traced.pid, nullptr, nullptr) == -1);
  CHECK(errno == EIO);
  REQUIRE(ptrace(PTRACE_POKEDATA, traced.pid, &traced.registers->before[0], -1L) == 0);
  errno = EAGAIN;
  CHECK(ptrace(PTRACE_PEEKDATA, traced.pid, &traced.registers->before[0], nullptr) == -1);
  CHECK(errno == 0);
  traced.GoOnToItsEnd();
  // There is nobody any more.
  iovec nothing{};
  CHECK(ptrace(PTRACE_SETREGSET, traced.pid, NT_X86_XSTATE, &nothing) == -1);
  CHECK(errno == ESRCH);
}

}  // namespace
}  // namespace plumb
