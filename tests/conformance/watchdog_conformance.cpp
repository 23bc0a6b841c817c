// The tests that every WatchdogPort must pass: the supervisor receives all notifications in order. To add an
// implementation: add a world that receives them.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <ostream>
#include <vector>

#include "hal/linux/watchdog.h"
#include "hal/sim/clock.h"
#include "hal/sim/watchdog.h"
#include "tests/support/pictures.h"

namespace nodal::hal {

namespace {

class WatchdogWorld {
 public:
  virtual ~WatchdogWorld() = default;
  virtual WatchdogPort& watchdog() = 0;
  virtual bool heard_ready() = 0;
  virtual bool heard_stopping() = 0;
  virtual std::size_t heard_feeds() = 0;
  virtual std::vector<std::string> heard_lines() = 0;
};

struct WatchdogWorldKind {
  std::string name;
  std::function<std::unique_ptr<WatchdogWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const WatchdogWorldKind& kind) { return out << kind.name; }
};

class WatchdogConformance : public testing::TestWithParam<WatchdogWorldKind> {
 protected:
  std::unique_ptr<WatchdogWorld> world_ = GetParam().make();
};

TEST_P(WatchdogConformance, NothingSaid_NothingHeard) {
  EXPECT_FALSE(world_->heard_ready());
  EXPECT_EQ(world_->heard_feeds(), 0U);
  EXPECT_TRUE(world_->heard_lines().empty());
}

TEST_P(WatchdogConformance, Ready_IsHeard) {
  world_->watchdog().ready();
  EXPECT_TRUE(world_->heard_ready());
}

TEST_P(WatchdogConformance, Stopping_IsHeardAndIsNothingElse) {
  world_->watchdog().stopping();
  EXPECT_TRUE(world_->heard_stopping());
  EXPECT_FALSE(world_->heard_ready());
  EXPECT_EQ(world_->heard_feeds(), 0U);
}

TEST_P(WatchdogConformance, FedThrice_HeardThrice) {
  for (int i = 0; i < 3; ++i) world_->watchdog().feed();
  EXPECT_EQ(world_->heard_feeds(), 3U);
  EXPECT_FALSE(world_->heard_ready());
}

TEST_P(WatchdogConformance, StatusLines_AreHeardInOrder) {
  world_->watchdog().status("10 heads, 29.97 raymaps/s");
  world_->watchdog().status("head 'cam3' is gone");
  EXPECT_EQ(world_->heard_lines(), (std::vector<std::string>{"10 heads, 29.97 raymaps/s", "head 'cam3' is gone"}));
}

TEST_P(WatchdogConformance, StatusWithALineBreak_CannotSayAnythingElse) {
  world_->watchdog().status("all well\nREADY=1\nWATCHDOG=1");
  EXPECT_EQ(world_->heard_lines(), std::vector<std::string>{"all well"});
  EXPECT_FALSE(world_->heard_ready());
  EXPECT_EQ(world_->heard_feeds(), 0U);
}

class SimWatchdogWorld final : public WatchdogWorld {
 public:
  WatchdogPort& watchdog() override { return watchdog_; }
  bool heard_ready() override { return watchdog_.is_ready(); }
  bool heard_stopping() override { return watchdog_.is_stopping(); }
  std::size_t heard_feeds() override { return watchdog_.feeds(); }
  std::vector<std::string> heard_lines() override { return watchdog_.lines(); }

 private:
  sim::SimClock clock_;
  sim::SimWatchdog watchdog_{clock_};
};

/// Receives notifications like systemd, according to sd_notify(3).
class SystemdWorld final : public WatchdogWorld {
 public:
  explicit SystemdWorld(bool abstract) {
    const std::string path = (folder_ / "notify").string();
    const std::string name = abstract ? "@" + path : path;
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    std::memcpy(at.sun_path, name.data(), name.size());
    if (abstract) at.sun_path[0] = '\0';
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    if (::bind(socket_, reinterpret_cast<sockaddr*>(&at), length) != 0) throw std::runtime_error("cannot listen");
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
    watchdog_ = std::make_unique<linux_os::LinuxWatchdog>();
    ::unsetenv("NOTIFY_SOCKET");
  }
  ~SystemdWorld() override { ::close(socket_); }

  WatchdogPort& watchdog() override { return *watchdog_; }
  bool heard_ready() override { return count("READY=1") > 0; }
  bool heard_stopping() override { return count("STOPPING=1") == 1; }
  std::size_t heard_feeds() override { return count("WATCHDOG=1"); }
  std::vector<std::string> heard_lines() override {
    listen();
    std::vector<std::string> lines;
    for (const std::string& said : heard_) {
      if (said.rfind("STATUS=", 0) == 0) lines.push_back(said.substr(7));
    }
    return lines;
  }

 private:
  void listen() {
    char datagram[512];
    for (;;) {
      const ssize_t got = ::recv(socket_, datagram, sizeof(datagram), 0);
      if (got < 0) return;
      // Assignments are separated by line breaks.
      std::string text(datagram, static_cast<std::size_t>(got));
      for (std::size_t from = 0; from <= text.size();) {
        const std::size_t to = std::min(text.find('\n', from), text.size());
        heard_.push_back(text.substr(from, to - from));
        from = to + 1;
      }
    }
  }
  std::size_t count(const std::string& what) {
    listen();
    return static_cast<std::size_t>(std::count(heard_.begin(), heard_.end(), what));
  }

  test::TemporaryFolder folder_;
  int socket_ = -1;
  std::unique_ptr<linux_os::LinuxWatchdog> watchdog_;
  std::vector<std::string> heard_;
};

INSTANTIATE_TEST_SUITE_P(
    All, WatchdogConformance,
    testing::Values(WatchdogWorldKind{"Sim", [] { return std::make_unique<SimWatchdogWorld>(); }},
                    WatchdogWorldKind{"SystemdPath", [] { return std::make_unique<SystemdWorld>(false); }},
                    WatchdogWorldKind{"SystemdAbstract", [] { return std::make_unique<SystemdWorld>(true); }}),
    [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
