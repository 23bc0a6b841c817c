#include "firmware/daemon/bridge.h"

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>

#include "firmware/daemon/options.h"
#include "hal/linux/link/socket_link.h"
#include "hal/linux/link/wait.h"
#include "protocol/base/text.h"

namespace nodal::daemon {
namespace {

constexpr std::size_t kLongestMessage = 1000;

/// One direction of the bridge, with the bytes that were read and are not written yet.
struct Flow {
  hal::LinkPort& from;
  hal::LinkPort& to;
  std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(64 * 1024);
  std::span<const std::uint8_t> rest{};
  bool over = false;  ///< `from` has ended

  bool move() {
    if (!over && rest.empty()) {
      const auto read = from.read(bytes);
      over = !read;
      if (read) rest = std::span(bytes).first(*read);
    }
    if (rest.empty()) return !over;
    const auto wrote = to.write(rest);
    if (!wrote) return false;
    rest = rest.subspan(*wrote);
    return true;
  }
};

void add_wake_ups(const Flow& flow, hal::WakeUps& to) {
  if (flow.rest.empty()) flow.from.add_wake_ups(to, true, false);
  else flow.to.add_wake_ups(to, false, true);
}

}  // namespace

int run_bridge(const std::string& path) {
  auto rig = hal::connect_link("unix:" + path);
  if (!rig) {
    std::fprintf(stderr, "nodald --bridge: %s\n", printable(rig.error().text(), kLongestMessage).c_str());
    return kExitCannotStart;
  }
  auto host = hal::descriptor_link(STDIN_FILENO, STDOUT_FILENO, "standard input and output");
  if (!host) {
    std::fprintf(stderr, "nodald --bridge: %s\n", printable(host.error().text(), kLongestMessage).c_str());
    return kExitCannotStart;
  }
  Flow to_rig{**host, **rig};
  Flow to_host{**rig, **host};
  // After one end closes, the bytes that it sent before are still passed on.
  while (to_rig.move() && to_host.move()) {
    hal::WakeUps wake_ups;
    add_wake_ups(to_rig, wake_ups);
    add_wake_ups(to_host, wake_ups);
    hal::wait_for(wake_ups, Instant(), Duration::seconds(60));
  }
  return kExitFine;
}

}  // namespace nodal::daemon
