#include "hal/linux/link/socket_link.h"
#include "hal/linux/link/wait.h"

#include <fcntl.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace nodal::hal {
namespace {

class Folder {
 public:
  Folder() {
    std::string name = std::filesystem::temp_directory_path() / "nodal-socket-XXXXXX";
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// Leaves a socket file behind, as a killed program does.
void leave_stale_socket(const std::string& path) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un where{};
  where.sun_family = AF_UNIX;
  std::strncpy(where.sun_path, path.c_str(), sizeof(where.sun_path) - 1);
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&where), sizeof(where)), 0);
  ASSERT_EQ(::listen(fd, 1), 0);
  ::close(fd);
}

/// Reads until the link ends or `n` bytes have arrived.
std::string read_text(LinkPort& link, std::size_t n, std::string* error = nullptr) {
  std::string text;
  while (text.size() < n) {
    std::uint8_t part[256];
    const auto got = link.read(part);
    if (!got) {
      if (error != nullptr) *error = got.error().message;
      break;
    }
    text.append(reinterpret_cast<const char*>(part), *got);
    if (*got > 0) continue;
    WakeUps wake_ups;
    link.add_wake_ups(wake_ups, true, false);
    if (!wait_for(wake_ups, Instant(), Duration::seconds(5))) break;
  }
  return text;
}

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

TEST(UnixListener, StaleSocketFile_IsReplaced) {
  Folder folder;
  leave_stale_socket(folder / "s");
  const auto listener = listen_link("unix:" + (folder / "s"));
  ASSERT_TRUE(listener) << listener.error().text();
  EXPECT_TRUE(connect_link("unix:" + (folder / "s")));
}

// Everyone who can read the folder can take this lock, for any time.
TEST(UnixListener, SomebodyHoldsALockOnTheFolder_ItListensAllTheSame) {
  Folder folder;
  leave_stale_socket(folder / "s");
  const int held = ::open((folder / ".").c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(::flock(held, LOCK_EX), 0);
  EXPECT_TRUE(listen_link("unix:" + (folder / "s")));
  ::close(held);
}

TEST(UnixListener, ItsLockFileIsHeld_SaysSoWithinSecondsAndNamesTheFile) {
  Folder folder;
  const int held = ::open((folder / "s.lock").c_str(), O_RDWR | O_CREAT, 0600);
  ASSERT_EQ(::flock(held, LOCK_EX), 0);
  const auto refused = listen_link("unix:" + (folder / "s"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kExists);
  EXPECT_NE(refused.error().message.find(folder / "s.lock"), std::string::npos) << refused.error().message;
  ::close(held);
  EXPECT_TRUE(listen_link("unix:" + (folder / "s")));
}

TEST(UnixListener, ItsLockFile_IsForItsUserOnly) {
  Folder folder;
  ASSERT_TRUE(listen_link("unix:" + (folder / "s")));
  struct stat file {};
  ASSERT_EQ(::stat((folder / "s.lock").c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777, 0600U);
}

TEST(UnixListener, SomethingElseIsInPlaceOfItsLockFile_IsNotOpened) {
  Folder folder;
  ASSERT_EQ(::mkfifo((folder / "s.lock").c_str(), 0600), 0);
  const auto refused = listen_link("unix:" + (folder / "s"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kExists);
}

TEST(UnixListener, SomebodyListens_ExistsAndHisSocketStays) {
  Folder folder;
  const auto first = listen_link("unix:" + (folder / "s"));
  ASSERT_TRUE(first);
  const auto second = listen_link("unix:" + (folder / "s"));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kExists);
  ASSERT_TRUE(connect_link("unix:" + (folder / "s")));
}

TEST(UnixListener, SomethingElseAtThePath_ExistsAndItStays) {
  Folder folder;
  std::ofstream(folder / "s") << "precious";
  const auto listener = listen_link("unix:" + (folder / "s"));
  ASSERT_FALSE(listener);
  EXPECT_EQ(listener.error().code, Errc::kExists);
  EXPECT_EQ(std::filesystem::file_size(folder / "s"), 8u);
}

unsigned mode_of(const std::string& path) {
  struct stat file {};
  return ::stat(path.c_str(), &file) == 0 ? file.st_mode & 0777U : 0;
}

TEST(UnixListener, TheUmask_TakesPermissionsAwayUnlessAModeIsConfigured) {
  Folder folder;
  struct Case {
    mode_t mask;
    std::optional<std::uint32_t> configured;
    unsigned expected;
  };
  for (const Case& one : {Case{0000, {}, 0660}, Case{0022, {}, 0640}, Case{0077, {}, 0600}, Case{0077, 0666, 0666},
                          Case{0000, 0600, 0600}}) {
    const mode_t before = ::umask(one.mask);
    auto listener = listen_link("unix:" + (folder / "s"), {one.configured, ""});
    ::umask(before);
    ASSERT_TRUE(listener) << listener.error().text();
    EXPECT_EQ(mode_of(folder / "s"), one.expected) << std::oct << one.mask;
    listener->reset();
    EXPECT_FALSE(std::filesystem::exists(folder / "s"));
  }
}

TEST(UnixListener, AGroupThatIsNotThere_IsNamedAndNoSocketStays) {
  Folder folder;
  const auto listener = listen_link("unix:" + (folder / "s"), {std::nullopt, "no-such-group"});
  ASSERT_FALSE(listener);
  EXPECT_EQ(listener.error().code, Errc::kNotFound);
  EXPECT_NE(listener.error().message.find("no-such-group"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "s"));
}

TEST(UnixListener, AnotherSocketInItsPlace_IsNotRemoved) {
  Folder folder;
  auto mine = listen_link("unix:" + (folder / "s"));
  ASSERT_TRUE(mine);
  std::filesystem::rename(folder / "s", folder / "mine");  // keeps the inode's number in use
  leave_stale_socket(folder / "s");
  mine->reset();
  EXPECT_TRUE(std::filesystem::exists(folder / "s"));
}

TEST(Connect, NobodyThere_UnreachableSaysWhatToLookAt) {
  Folder folder;
  const auto none = connect_link("unix:" + (folder / "nothing"));
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kUnreachable);
  EXPECT_NE(none.error().message.find("is nodald running"), std::string::npos);
  leave_stale_socket(folder / "s");
  EXPECT_EQ(connect_link("unix:" + (folder / "s")).error().code, Errc::kUnreachable);
}

TEST(Address, Tcp_IsRefusedAndPointsToSsh) {
  for (const char* address : {"tcp:127.0.0.1:7700", "tcp:localhost:7700", "tcp:[::1]:7700", "tcp:192.168.1.2:7700"}) {
    for (const Error& error : {connect_link(address).error(), listen_link(address).error()}) {
      EXPECT_EQ(error.code, Errc::kBadValue) << address;
      EXPECT_NE(error.message.find("ssh://"), std::string::npos) << error.message;
    }
  }
}

TEST(Address, Unreadable_SaysWhatToWrite) {
  for (const char* address : {"", "unix:", "tcp:", "tcp:127.0.0.1", "tcp:127.0.0.1:", "tcp:127.0.0.1:70000",
                              "tcp:127.0.0.1:7x", "/run/nodal.sock", "http://x"}) {
    const auto link = connect_link(address);
    ASSERT_FALSE(link) << address;
    EXPECT_EQ(link.error().code, Errc::kBadValue) << address;
  }
  const auto longer = listen_link("unix:/" + std::string(200, 'x'));
  EXPECT_EQ(longer.error().code, Errc::kBadValue);
  EXPECT_NE(longer.error().message.find("107"), std::string::npos);
}

TEST(SpawnLink, Program_TalksOnItsInputAndOutput) {
  auto link = spawn_link({"cat"});
  ASSERT_TRUE(link) << link.error().text();
  EXPECT_EQ((*link)->peer(), "cat");
  ASSERT_EQ((*link)->write(bytes_of("hello")).value(), 5u);
  EXPECT_EQ(read_text(**link, 5), "hello");
}

TEST(SpawnLink, NoSuchProgram_NotFound) {
  const auto link = spawn_link({"nodal-no-such-program"});
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().code, Errc::kNotFound);
  EXPECT_EQ(spawn_link({}).error().code, Errc::kBadValue);
}

TEST(SpawnLink, ProgramEnds_ItsWordsComeFirstThenItsExitCode) {
  auto link = spawn_link({"sh", "-c", "printf last; exit 3"});
  ASSERT_TRUE(link) << link.error().text();
  std::string error;
  EXPECT_EQ(read_text(**link, 100, &error), "last");
  EXPECT_NE(error.find("exit code 3"), std::string::npos) << error;
}

TEST(SpawnLink, LinkDropped_ProgramSeesTheEndOfItsInputAndEnds) {
  Folder folder;
  {
    auto link = spawn_link({"sh", "-c", "cat; echo ended > " + (folder / "mark")});
    ASSERT_TRUE(link) << link.error().text();
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "mark"));
}

TEST(SpawnLink, ProgramThatDoesNotListen_IsTerminatedWithinSeconds) {
  std::string pid;
  {
    auto link = spawn_link({"sh", "-c", "echo $$; exec sleep 1000"});
    ASSERT_TRUE(link) << link.error().text();
    while (pid.empty() || pid.back() != '\n') pid += read_text(**link, 1);
  }
  EXPECT_EQ(::kill(std::stoi(pid), 0), -1);
}

TEST(DescriptorLink, NotADescriptor_BadValue) {
  const auto link = descriptor_link(1000, 1001, "nothing");
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().code, Errc::kBadValue);
}

/// What connect_link() says to user and group 65534, who own nothing.
std::string refused_as_nobody(const std::string& socket) {
  int ends[2];
  if (::pipe(ends) != 0) return "";
  const pid_t pid = ::fork();
  if (pid == 0) {
    const bool changed = ::setgroups(0, nullptr) == 0 && ::setgid(65534) == 0 && ::setuid(65534) == 0;
    const auto link = connect_link("unix:" + socket);
    const std::string said = !changed ? "still root" : link ? "connected" : link.error().message;
    if (::write(ends[1], said.data(), said.size()) < 0) ::_exit(1);
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string said(4096, '\0');
  said.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::read(ends[0], said.data(), said.size()))));
  ::close(ends[0]);
  ::waitpid(pid, nullptr, 0);
  return said;
}

TEST(SocketLink, AUserWhoMayNot_IsToldWhichGroupMayAndTheCommand) {
  if (::getuid() != 0) GTEST_SKIP() << "only root can become another user";
  const Folder folder;
  ::chmod((folder / "").c_str(), 0755);
  const auto listener = listen_link("unix:" + folder / "s", {});
  ASSERT_TRUE(listener) << listener.error().text();
  ::chmod((folder / "s").c_str(), 0660);  // whatever this process's umask is
  const std::string said = refused_as_nobody(folder / "s");
  EXPECT_NE(said.find("the group 'root' may: sudo usermod -aG root $USER"), std::string::npos) << said;
  ::chmod((folder / "s").c_str(), 0600);
  EXPECT_NE(refused_as_nobody(folder / "s").find("its owner and root may"), std::string::npos);
  ::chmod((folder / "").c_str(), 0700);
  EXPECT_NE(refused_as_nobody(folder / "s").find("may not enter the socket's folder"), std::string::npos);
}

}  // namespace
}  // namespace nodal::hal
