// Lets a User-Mode Linux of 6.1 run on processors whose registers take more room than it knows (Intel's AMX: 11 KB).
// It keeps the first 2696 bytes of a process's XSAVE area, which is all that programs without AMX use, and the host's
// kernel takes back nothing but whole areas. So its calls of ptrace() come by here, and areas are completed with what
// the process has. Preloaded (LD_PRELOAD): the guest's kernel is an ordinary program.
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

long ptrace(enum __ptrace_request request, ...) {
  va_list list;
  va_start(list, request);
  const long pid = va_arg(list, long);
  void* const address = va_arg(list, void*);
  void* const data = va_arg(list, void*);
  va_end(list);
  const int whole = request == PTRACE_GETREGSET || request == PTRACE_SETREGSET;
  if (!whole || (unsigned long)address != NT_X86_XSTATE) {
    // As the C library: what is peeked is the result.
    long peeked = 0;
    const int peeks = request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER;
    const long result = syscall(SYS_ptrace, request, pid, address, peeks ? &peeked : data);
    return peeks && result == 0 ? peeked : result;
  }
  static unsigned char area[1 << 16];
  struct iovec* const asked = data;
  struct iovec all = {area, sizeof area};
  if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, address, &all) < 0) return -1;
  const size_t common = asked->iov_len < all.iov_len ? asked->iov_len : all.iov_len;
  if (request == PTRACE_GETREGSET) {
    memcpy(asked->iov_base, area, common);
    asked->iov_len = common;
    return 0;
  }
  memcpy(area, asked->iov_base, common);
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, address, &all);
}
