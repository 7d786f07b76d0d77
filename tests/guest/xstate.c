// Lets user-mode-linux run on processors with AMX. Its kernel 6.1 keeps 2696 bytes of a process's
// extended registers (XSAVE). Where the processor has more of them, the machine's kernel hands out
// the first 2696 bytes when asked, but takes back the whole or nothing (EFAULT), and the guest dies
// in put_fp_registers before it has booted.
//
// Preloaded into linux.uml (tests/with-vcan does), this ptrace() completes what is handed back with
// what the traced process has. The rest belongs to nobody then: a guest's process cannot ask for
// AMX, since its kernel knows of none.
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static long SetExtendedRegisters(pid_t pid, const struct iovec* given) {
  // Not on the stack: a guest kernel's is 16 KB. One is enough: that kernel has one processor, and
  // does not change from one task to another within a system call. With AMX 11,008 bytes are used.
  static _Alignas(64) char registers[1 << 16];
  struct iovec whole = {registers, sizeof registers};
  if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &whole) < 0) return -1;
  if (given->iov_len >= whole.iov_len)
    return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, given);
  memcpy(registers, given->iov_base, given->iov_len);
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, &whole);
}

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  const pid_t pid = va_arg(arguments, pid_t);
  void* const address = va_arg(arguments, void*);
  void* const data = va_arg(arguments, void*);
  va_end(arguments);
  if (request == PTRACE_SETREGSET && (unsigned long)address == NT_X86_XSTATE)
    return SetExtendedRegisters(pid, data);
  if (request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER) {
    // As glibc has it: the word itself is returned, and errno tells a word of -1 from a failure.
    long word = -1;
    if (syscall(SYS_ptrace, request, pid, address, &word) < 0) return -1;
    errno = 0;
    return word;
  }
  return syscall(SYS_ptrace, request, pid, address, data);
}
