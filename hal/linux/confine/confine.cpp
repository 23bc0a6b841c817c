#include "hal/linux/confine/confine.h"

#include <fcntl.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <span>
#include <utility>

#include "hal/linux/confine/own_descriptor.h"
#include "protocol/base/try.h"

namespace nodal::hal::linux_os {
namespace {

// Landlock's interface by version (include/uapi/linux/landlock.h): the headers of Debian 12 have version 2.
constexpr int kCreateRuleset = 444, kAddRule = 445, kRestrictSelf = 446;
constexpr std::uint32_t kAskVersion = 1;
constexpr int kPathBeneath = 1;

struct Ruleset {
  std::uint64_t files = 0;
  std::uint64_t network = 0;  // from version 4 on
  std::uint64_t scopes = 0;   // from version 6 on
};
struct [[gnu::packed]] PathBeneath {
  std::uint64_t allowed = 0;
  std::int32_t folder = -1;
};

constexpr std::uint64_t kExecute = 1 << 0, kWriteFile = 1 << 1, kReadFile = 1 << 2, kReadFolder = 1 << 3,
                        kRemoveFolder = 1 << 4, kRemoveFile = 1 << 5, kMakeFolder = 1 << 7, kMakeFile = 1 << 8,
                        kMoveAway = 1 << 13, kTruncate = 1 << 14, kDeviceControl = 1 << 15;
constexpr std::uint64_t kFilesOfVersion1 = (1 << 13) - 1;
constexpr std::uint64_t kOfFiles = kExecute | kWriteFile | kReadFile | kTruncate | kDeviceControl;
constexpr std::uint64_t kTcp = 3;                        // bind, connect
constexpr std::uint64_t kAbstractSocketsAndSignals = 3;  // signals to, and abstract sockets of, other processes
constexpr std::uint64_t kToRead = kReadFile | kReadFolder;
constexpr std::uint64_t kToWrite =
    kToRead | kWriteFile | kTruncate | kRemoveFolder | kRemoveFile | kMakeFolder | kMakeFile;

std::uint64_t files_of(int version) {
  std::uint64_t all = kFilesOfVersion1;
  if (version >= 2) all |= kMoveAway;
  if (version >= 3) all |= kTruncate;
  if (version >= 5) all |= kDeviceControl;
  return all;
}

tl::unexpected<Error> refused(const std::string& what) {
  return fail(Errc::kIo, "the process cannot be confined: " + what + ": " + std::strerror(errno));
}

Status allow(int ruleset, const std::string& path, std::uint64_t rights) {
  const OwnDescriptor at(::open(path.c_str(), O_PATH | O_CLOEXEC));
  if (!at && (errno == ENOENT || errno == ENOTDIR)) return {};
  if (!at) return refused("'" + path + "'");
  struct stat about {};
  if (::fstat(at.get(), &about) == 0 && !S_ISDIR(about.st_mode)) rights &= kOfFiles;
  const PathBeneath rule{rights, at.get()};
  if (::syscall(kAddRule, ruleset, kPathBeneath, &rule, 0) != 0) return refused("Landlock for '" + path + "'");
  return {};
}

/// Version of the kernel's Landlock interface; 0: the kernel has none.
int landlock_version() { return static_cast<int>(std::max(0L, ::syscall(kCreateRuleset, nullptr, 0, kAskVersion))); }

bool has_seccomp() { return ::prctl(PR_GET_SECCOMP, 0, 0, 0, 0) >= 0 || errno != EINVAL; }

std::string missing(bool landlock, bool seccomp) {
  std::string text;
  if (!landlock) text = "this kernel has no Landlock (Linux 5.13 or newer, with landlock in its list lsm=)";
  if (!seccomp) text += std::string(text.empty() ? "" : "; ") + "this kernel has no seccomp filters";
  return text.empty() ? text : text + ": foreign data is read with fewer restrictions";
}

/// The version in force; 0: the kernel has none.
Result<int> restrict_files(const Confinement& what) {
  const int known = landlock_version();
  if (known == 0) return 0;
  const std::uint64_t handled = files_of(known);
  const Ruleset all{handled, known >= 4 ? kTcp : 0, known >= 6 ? kAbstractSocketsAndSignals : 0};
  const std::size_t size = known >= 6 ? sizeof all : known >= 4 ? 2 * sizeof(std::uint64_t) : sizeof(std::uint64_t);
  const OwnDescriptor ruleset(::syscall(kCreateRuleset, &all, size, 0));
  if (!ruleset) return refused("Landlock");
  for (const auto& [paths, rights] : {std::pair{&what.read, kToRead}, std::pair{&what.write, kToWrite},
                                      std::pair{&what.execute, kExecute | kReadFile}}) {
    for (const std::string& path : *paths) {
      NODAL_TRY(allow(ruleset.get(), path, rights & handled));
    }
  }
  if (::syscall(kRestrictSelf, ruleset.get(), 0) != 0) return refused("Landlock");
  return known;
}

/// What a process needs that computes in memory and works on files: the C++ library's needs included.
constexpr std::array kFilesAndMemory = {
    "read",
    "pread64",
    "readv",
    "preadv",
    "write",
    "pwrite64",
    "writev",
    "pwritev",
    "openat2",
    "openat",
    "open",
    "close",
    "fstat",
    "newfstatat",
    "fstatat64",
    "statx",
    "stat",
    "lstat",
    "fstatfs",
    "statfs",
    "fstatfs64",
    "fsync",
    "fdatasync",
    "syncfs",
    "fadvise64",
    "fallocate",
    "ftruncate",
    "sync_file_range",
    "rename",
    "renameat",
    "renameat2",
    "unlink",
    "unlinkat",
    "mkdirat",
    "getdents64",
    "lseek",
    "munmap",
    "mremap",
    "brk",
    "madvise",
    "futex",
    "clock_gettime",
    "getrandom",
    "exit",
    "exit_group",
    "rt_sigreturn",
    "getpid",
    "rt_sigaction",
    "rt_sigprocmask",
    "gettid",
    "sched_yield",
    "restart_syscall",
    "clock_nanosleep",
    "nanosleep",
    "getrusage",
    "sched_getaffinity",
    "times",
    "getcpu",
    "gettimeofday",
    "time",
    "uname",
    "sysinfo",
    "membarrier",
    "rseq",
    "set_robust_list",
    "sigaltstack",
    "flock",
};

/// What no program of ours needs when it reads files: ways to other processes, to the kernel's settings and to devices.
constexpr std::array kNeverNeeded = {
    "ptrace",
    "process_vm_readv",
    "process_vm_writev",
    "kcmp",
    "pidfd_getfd",
    "pidfd_send_signal",
    "mount",
    "umount2",
    "pivot_root",
    "chroot",
    "setns",
    "unshare",
    "move_mount",
    "open_tree",
    "fsopen",
    "fsmount",
    "init_module",
    "finit_module",
    "delete_module",
    "kexec_load",
    "kexec_file_load",
    "bpf",
    "perf_event_open",
    "userfaultfd",
    "io_uring_setup",
    "io_uring_enter",
    "io_uring_register",
    "keyctl",
    "add_key",
    "request_key",
    "reboot",
    "swapon",
    "swapoff",
    "settimeofday",
    "clock_settime",
    "adjtimex",
    "clock_adjtime",
    "acct",
    "quotactl",
    "personality",
    "mknod",
    "mknodat",
    "open_by_handle_at",
    "name_to_handle_at",
    "syslog",
    "vhangup",
    "fanotify_init",
    "lookup_dcookie",
    "iopl",
    "ioperm",
    "modify_ldt",
    "sethostname",
    "setdomainname",
};

using Filter = std::unique_ptr<void, void (*)(scmp_filter_ctx)>;

bool rule(const Filter& filter, std::uint32_t action, const char* name, std::initializer_list<scmp_arg_cmp> when = {}) {
  const int call = seccomp_syscall_resolve_name(name);
  if (call == __NR_SCMP_ERROR) return true;  // one of another architecture or of a newer library
  const std::vector<scmp_arg_cmp> conditions(when);
  return seccomp_rule_add_array(filter.get(), action, call, static_cast<unsigned>(conditions.size()),
                                conditions.data()) == 0;
}

bool allow_files_and_memory(const Filter& filter) {
  bool good = true;
  for (const char* name : kFilesAndMemory) good = good && rule(filter, SCMP_ACT_ALLOW, name);
  // Memory that is written is never executed. Descriptors are not duplicated or made asynchronous.
  for (const char* name : {"mmap", "mmap2", "mprotect"})
    good = good && rule(filter, SCMP_ACT_ALLOW, name, {SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)});
  for (const auto operation : {F_GETFL, F_GETFD, F_SETFD})
    good = good && rule(filter, SCMP_ACT_ALLOW, "fcntl", {SCMP_A1(SCMP_CMP_EQ, static_cast<scmp_datum_t>(operation))});
  // abort() sends the signal to itself.
  return good && rule(filter, SCMP_ACT_ALLOW, "tgkill", {SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(::getpid()))});
}

bool deny_dangerous(const Filter& filter, const Confinement& what) {
  constexpr std::uint32_t kDeny = SCMP_ACT_ERRNO(EPERM);
  bool good = true;
  for (const char* name : kNeverNeeded) good = good && rule(filter, kDeny, name);
  // Sockets of every family but AF_UNIX, whose number is 1.
  good = good && (what.unix_sockets ? rule(filter, kDeny, "socket", {SCMP_A0(SCMP_CMP_NE, AF_UNIX)})
                                    : rule(filter, kDeny, "socket"));
  if (what.execute.empty()) {
    for (const char* name : {"execve", "execveat"}) good = good && rule(filter, kDeny, name);
  }
  return good;
}

/// Whether a filter is in force. False: the kernel has none.
Result<bool> restrict_calls(const Confinement& what) {
  if (!has_seccomp()) return false;
  const bool listed = what.calls == Confinement::Calls::kFilesAndMemory;
  const Filter filter(seccomp_init(listed ? SCMP_ACT_ERRNO(EPERM) : SCMP_ACT_ALLOW), seccomp_release);
  const bool made = filter && (listed ? allow_files_and_memory(filter) : deny_dangerous(filter, what));
  if (!made) return fail(Errc::kIo, "the process cannot be confined: the seccomp filter could not be made");
  if (const int error = seccomp_load(filter.get()); error != 0) {
    errno = -error;
    return refused("seccomp");
  }
  return true;
}

Status limit(int resource, std::uint64_t value, const char* name) {
  if (value == 0) return {};
  const rlimit both{value, value};
  if (::setrlimit(static_cast<__rlimit_resource_t>(resource), &both) != 0) return refused(name);
  return {};
}

}  // namespace

Result<Confined> confine(const Confinement& what) {
  NODAL_TRY(limit(RLIMIT_AS, what.memory_bytes, "RLIMIT_AS"));
  NODAL_TRY(limit(RLIMIT_CPU, what.cpu_seconds, "RLIMIT_CPU"));
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return refused("no_new_privs");
  Confined done;
  NODAL_TRY_ASSIGN(const auto landlock, restrict_files(what));
  done.landlock = landlock;
  NODAL_TRY_ASSIGN(const auto seccomp, restrict_calls(what));
  done.seccomp = seccomp;
  done.missing = missing(done.landlock > 0, done.seccomp);
  return done;
}

std::string missing_in_kernel() { return missing(landlock_version() > 0, has_seccomp()); }

}  // namespace nodal::hal::linux_os
