#include "firmware/daemon/takes_disk.h"

#include <time.h>

#include "hal/linux/disk.h"

namespace nodal::daemon {

Result<TakesDisk> open_takes_disk(const std::filesystem::path& folder, bool mounted) {
  TakesDisk disk{hal::linux_os::LinuxDisk::guest(folder.string(), mounted),
                 hal::linux_os::LinuxDisk::guest(folder.string(), mounted)};
  const Status claimed = disk.to_write->claim();
  disk.to_write->release();
  if (claimed || claimed.error().code == Errc::kNotReady) return disk;
  if (claimed.error().code != Errc::kBusy) return fail(claimed.error().in("[takes]"));
  return fail(Errc::kBusy, "another nodald uses the takes folder '" + folder.string() +
                               "'; stop it, or give this rig a folder of its own ([takes] folder)");
}

std::int64_t utc_ns() {
  constexpr std::int64_t kYear2020 = 1'577'836'800;
  timespec now{};
  if (::clock_gettime(CLOCK_REALTIME, &now) != 0 || now.tv_sec < kYear2020) return 0;
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace nodal::daemon
