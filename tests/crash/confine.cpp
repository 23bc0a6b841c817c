// confine FILE PROGRAM [ARGUMENT...]: runs a program under the seccomp filter that systemd would make from
// nodald.service, for machines without systemd. FILE contains the names of the permitted system calls, one per line.
#include <asm/unistd.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>

namespace {

constexpr std::uint64_t kNamespaces =
    CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC | CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET;
constexpr std::uint64_t kWriteAndExecute = PROT_WRITE | PROT_EXEC;

/// The unit's restrictions by argument; false for calls without such a restriction.
bool permit_some(scmp_filter_ctx filter, const std::string& name) {
  const auto permit = [&](const scmp_arg_cmp& condition) {
    (void)seccomp_rule_add(filter, SCMP_ACT_ALLOW, seccomp_syscall_resolve_name(name.c_str()), 1, condition);
  };
  if (name == "mmap") {  // MemoryDenyWriteExecute=
    for (const std::uint64_t allowed : {0, PROT_WRITE, PROT_EXEC})
      permit(SCMP_A2(SCMP_CMP_MASKED_EQ, kWriteAndExecute, allowed));
  } else if (name == "mprotect" || name == "pkey_mprotect") {
    permit(SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  } else if (name == "clone") {  // RestrictNamespaces=
    permit(SCMP_A0(SCMP_CMP_MASKED_EQ, kNamespaces, 0));
  } else if (name == "socket") {  // RestrictAddressFamilies=AF_UNIX
    permit(SCMP_A0(SCMP_CMP_EQ, AF_UNIX));
  } else if (name == "clone3" || name == "unshare" || name == "setns") {
    (void)seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), seccomp_syscall_resolve_name(name.c_str()), 0);
  } else {
    return false;
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 125;
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));  // SystemCallErrorNumber=EPERM
  if (filter == nullptr) return 125;
  std::ifstream names(argv[1]);
  for (std::string name; std::getline(names, name);) {
    const int number = seccomp_syscall_resolve_name(name.c_str());
    if (number == __NR_SCMP_ERROR || permit_some(filter, name)) continue;  // a call of another architecture
    (void)seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 0);
  }
  if (seccomp_load(filter) != 0) {
    std::fprintf(stderr, "confine: the filter cannot be loaded\n");
    return 125;
  }
  ::execv(argv[2], argv + 2);
  std::perror(argv[2]);
  return 125;
}
