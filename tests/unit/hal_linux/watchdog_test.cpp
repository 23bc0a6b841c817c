#include "hal/linux/watchdog.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>

namespace nodal::hal::linux_os {
namespace {

/// The number of the next descriptor: larger than before if a descriptor was leaked.
int next_descriptor() {
  const int fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  ::close(fd);
  return fd;
}

TEST(LinuxWatchdog, NoSupervisor_DoesNothingAndLeavesNothingOpen) {
  ::unsetenv("NOTIFY_SOCKET");
  const int before = next_descriptor();
  {
    LinuxWatchdog watchdog;
    watchdog.ready();
    watchdog.feed();
    watchdog.status("nobody hears this");
    EXPECT_EQ(next_descriptor(), before) << "no socket was made";
  }
  EXPECT_EQ(next_descriptor(), before);
}

TEST(LinuxWatchdog, NobodyListensOrTheNameIsNonsense_DoesNothing) {
  for (const std::string& name : {std::string("/nowhere/at/all"), std::string("@nobody"), std::string("relative"),
                                  std::string("/"), "/" + std::string(500, 'x')}) {
    const int before = next_descriptor();
    {
      LinuxWatchdog watchdog(name);
      watchdog.ready();
      watchdog.status("nobody hears this");
    }
    EXPECT_EQ(next_descriptor(), before) << name;
  }
}

}  // namespace
}  // namespace nodal::hal::linux_os
