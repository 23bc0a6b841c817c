#include "firmware/daemon/takes_disk.h"

#include <sys/stat.h>
#include <time.h>

#include "hal/linux/disk.h"

namespace nodal::daemon {

Result<TakesDisk> open_takes_disk(const std::filesystem::path& folder, bool mounted) {
  struct stat inside {
  }, outside{};
  const bool known = ::stat(folder.c_str(), &inside) == 0 && ::stat((folder / "..").c_str(), &outside) == 0;
  if (mounted && (!known || inside.st_dev == outside.st_dev)) {
    return fail(Errc::kNotReady, "[takes] folder '" + folder.string() +
                                     "': no disk is mounted there; mount the card, or remove mounted = true");
  }
  auto to_write = hal::linux_os::LinuxDisk::open(folder.string());
  if (!to_write) return fail(to_write.error().in("[takes]"));
  auto to_read = hal::linux_os::LinuxDisk::open(folder.string());
  if (!to_read) return fail(to_read.error().in("[takes]"));
  return TakesDisk{std::move(*to_write), std::move(*to_read)};
}

std::int64_t utc_ns() {
  constexpr std::int64_t kYear2020 = 1'577'836'800;
  timespec now{};
  if (::clock_gettime(CLOCK_REALTIME, &now) != 0 || now.tv_sec < kYear2020) return 0;
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace nodal::daemon
