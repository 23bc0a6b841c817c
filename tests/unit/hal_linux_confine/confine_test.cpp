// What a confined process cannot do, shown by trying it. Each test confines a process of its own.
#include "hal/linux/confine/confine.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <functional>
#include <thread>
#include <vector>

#include "tests/support/pictures.h"

namespace nodal::hal::linux_os {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitsAddresses = false;  // sanitizers reserve terabytes
#else
constexpr bool kLimitsAddresses = true;
#endif

constexpr int kNotConfined = 100;

/// Exit status of a process that confines itself and does this; 128 and the signal that ended it.
int confined(const Confinement& what, const std::function<int()>& act) {
  const pid_t child = ::fork();
  if (child == 0) {
    const auto done = confine(what);
    ::_exit(done ? act() : kNotConfined);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

bool kernel_has_landlock() {
  return confined({}, [] {
           const auto again = confine({});
           return again && again->landlock > 0 ? 0 : 1;
         }) == 0;
}

/// 0, or the error's number.
int error_of(long result) { return result < 0 ? errno : 0; }

class Confine : public testing::TestWithParam<Confinement::Calls> {
 protected:
  Confine() {
    std::filesystem::create_directories(folder_.path() / "inside" / "below");
    std::filesystem::create_directories(folder_.path() / "outside");
    for (const char* name : {"inside/file", "outside/file"}) std::ofstream(folder_.path() / name) << "text";
    std::filesystem::create_symlink(folder_.path() / "outside" / "file", folder_.path() / "inside" / "link");
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  Confinement with() const {
    Confinement what;
    what.calls = GetParam();
    return what;
  }
  int try_open(const Confinement& what, const std::string& name, int flags) const {
    const std::string file = path(name);
    return confined(what, [&] { return error_of(::open(file.c_str(), flags | O_CLOEXEC, 0600)); });
  }

  const test::TemporaryFolder folder_;
};

TEST_P(Confine, FilesThatItMayRead_AreReadAndNotWritten) {
  if (!kernel_has_landlock()) GTEST_SKIP() << "this kernel has no Landlock";
  Confinement what = with();
  what.read = {path("inside")};
  EXPECT_EQ(try_open(what, "inside/file", O_RDONLY), 0);
  EXPECT_EQ(try_open(what, "inside/file", O_WRONLY), EACCES);
  EXPECT_EQ(try_open(what, "inside/new", O_WRONLY | O_CREAT), EACCES);
  EXPECT_EQ(try_open(what, "outside/file", O_RDONLY), EACCES);
  EXPECT_EQ(try_open(what, "inside/link", O_RDONLY), EACCES);
  EXPECT_EQ(confined(what, [] { return error_of(::open("/etc/passwd", O_RDONLY)); }), EACCES);
}

TEST_P(Confine, FolderThatItMayWrite_TakesFilesAndNothingElseDoes) {
  if (!kernel_has_landlock()) GTEST_SKIP() << "this kernel has no Landlock";
  Confinement what = with();
  what.write = {path("inside")};
  EXPECT_EQ(try_open(what, "inside/below/new", O_WRONLY | O_CREAT | O_EXCL), 0);
  EXPECT_EQ(confined(what,
                     [&] {
                       const int renamed =
                           error_of(::rename(path("inside/file").c_str(), path("inside/other").c_str()));
                       return renamed != 0 ? renamed : error_of(::unlink(path("inside/other").c_str()));
                     }),
            0);
  EXPECT_EQ(try_open(what, "outside/new", O_WRONLY | O_CREAT), EACCES);
  EXPECT_EQ(confined(what, [&] { return error_of(::unlink(path("outside/file").c_str())); }), EACCES);
  EXPECT_NE(
      confined(what, [&] { return error_of(::rename(path("outside/file").c_str(), path("inside/stolen").c_str())); }),
      0);
  EXPECT_NE(confined(what, [&] { return error_of(::symlink("/etc/passwd", path("inside/bait").c_str())); }), 0);
}

TEST_P(Confine, Network_IsDenied) {
  for (const int family : {AF_INET, AF_INET6, AF_NETLINK, AF_PACKET}) {
    EXPECT_EQ(confined(with(), [&] { return error_of(::socket(family, SOCK_STREAM, 0)); }), EPERM) << family;
    EXPECT_EQ(confined(with(), [&] { return error_of(::socket(family, SOCK_DGRAM, 0)); }), EPERM) << family;
  }
}

TEST_P(Confine, OtherPrograms_AreNotStarted) {
  EXPECT_EQ(confined(with(),
                     [] {
                       ::execl("/bin/true", "true", nullptr);
                       return errno;
                     }),
            EPERM);
}

TEST_P(Confine, OtherProcessesAndTheKernel_AreOutOfReach) {
  const pid_t parent = ::getpid();
  EXPECT_EQ(confined(with(), [&] { return error_of(::ptrace(PTRACE_ATTACH, parent, nullptr, nullptr)); }), EPERM);
  EXPECT_EQ(confined(with(), [&] { return error_of(::syscall(SYS_mount, "none", "/", "tmpfs", 0, nullptr)); }), EPERM);
  EXPECT_EQ(confined(with(), [&] { return error_of(::syscall(SYS_unshare, 0x10000000)); }), EPERM);
  EXPECT_EQ(confined(with(), [&] { return error_of(::syscall(SYS_bpf, 0, nullptr, 0)); }), EPERM);
}

TEST_P(Confine, Memory_IsRefusedBeyondItsLimit) {
  if (!kLimitsAddresses) GTEST_SKIP() << "a sanitizer needs all addresses";
  Confinement what = with();
  what.memory_bytes = std::uint64_t{1} << 30;
  const auto allocate = [](std::size_t mib) { return [mib] { return std::malloc(mib << 20) != nullptr ? 0 : 1; }; };
  EXPECT_EQ(confined(what, allocate(100)), 0);
  EXPECT_EQ(confined(what, allocate(2000)), 1);
}

TEST_P(Confine, ProcessorTime_EndsAtItsLimit) {
  Confinement what = with();
  what.cpu_seconds = 1;
  EXPECT_EQ(confined(what,
                     [] {
                       for (std::atomic<unsigned> k{0};; k.fetch_add(1)) {}
                       return 0;
                     }),
            128 + SIGKILL);
}

std::string name_of(const testing::TestParamInfo<Confinement::Calls>& info) {
  return info.param == Confinement::Calls::kFilesAndMemory ? "FilesAndMemory" : "Program";
}
INSTANTIATE_TEST_SUITE_P(Calls, Confine,
                         testing::Values(Confinement::Calls::kFilesAndMemory, Confinement::Calls::kProgram), name_of);

TEST(ConfineFilesAndMemory, ThreadsAndProcesses_AreNotMade) {
  Confinement what;
  what.calls = Confinement::Calls::kFilesAndMemory;
  EXPECT_EQ(confined(what, [] { return error_of(::fork()); }), EPERM);
  EXPECT_EQ(confined(what,
                     [] {
                       int pair[2];
                       return error_of(::socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
                     }),
            EPERM);
  const pid_t parent = ::getpid();
  EXPECT_EQ(confined(what, [&] { return error_of(::kill(parent, 0)); }), EPERM);
}

TEST(ConfineProgram, ThreadsUnixSocketsAndANamedProgram_Remain) {
  Confinement what;
  what.read = {"/"};
  what.execute = {"/usr", "/lib", "/lib64", "/bin"};
  EXPECT_EQ(confined(what,
                     [] {
                       int value = 1;
                       std::thread([&] { value = 0; }).join();
                       return value;
                     }),
            0);
  EXPECT_EQ(confined(what, [] { return error_of(::socket(AF_UNIX, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(confined(what,
                     [] {
                       ::execl("/bin/true", "true", nullptr);
                       return errno;
                     }),
            0);
}

}  // namespace
}  // namespace nodal::hal::linux_os
