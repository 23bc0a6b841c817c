#include "firmware/daemon/confined_work.h"

#include <fmt/format.h>

#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "firmware/calibration/rehearsal.h"
#include "firmware/record/take_recovery.h"
#include "hal/linux/confine/confine.h"
#include "hal/linux/confine/confined_process.h"
#include "hal/linux/confine/own_descriptor.h"
#include "hal/linux/disk.h"
#include "protocol/base/try.h"

namespace nodal::daemon {
namespace {

using hal::linux_os::Confinement;

/// A slow card needs most of this for reading two seconds of video.
constexpr hal::linux_os::ConfinedLimits kRecovery{firmware::kMaxRecoveryBytes, 600, std::chrono::seconds(60), 64};

Result<std::vector<std::uint8_t>> recover(const std::string& takes, const hal::ConfinedJob& job,
                                          const hal::ConfinedProgress& progress) {
  NODAL_TRY_ASSIGN(auto disk, hal::linux_os::LinuxDisk::open(takes));
  // Not through a symbolic link: it would give rights to where it leads.
  const std::string path = takes + "/" + job.what;
  const hal::linux_os::OwnDescriptor folder(::open(path.c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!folder) return fail(Errc::kBadFormat, "folder '" + path + "': " + std::strerror(errno));
  Confinement rights;
  rights.write = {fmt::format("/proc/self/fd/{}", folder.get())};
  rights.calls = Confinement::Calls::kFilesAndMemory;
  NODAL_TRY(hal::linux_os::confine(rights));
  return firmware::recovery_work(*disk, job.what, progress);
}

}  // namespace

Result<std::unique_ptr<hal::ConfinedPort>> start_recovery(const std::filesystem::path& takes) {
  return hal::linux_os::ConfinedProcess::start(
      kRecovery, [path = takes.string()](const hal::ConfinedJob& job, const hal::ConfinedProgress& progress) {
        return recover(path, job, progress);
      });
}

Result<std::unique_ptr<hal::ConfinedPort>> start_rehearsal(const firmware::RigConfig& config) {
  return hal::linux_os::ConfinedProcess::start(
      {firmware::rehearsal_bytes(config), 300, std::chrono::seconds(60), 64},
      [config](const hal::ConfinedJob& job,
               const hal::ConfinedProgress& progress) -> Result<std::vector<std::uint8_t>> {
        Confinement rights;
        rights.calls = Confinement::Calls::kFilesAndMemory;
        NODAL_TRY(hal::linux_os::confine(rights));
        return firmware::rehearse(config, job, progress);
      });
}

std::string missing_confinement() { return hal::linux_os::missing_in_kernel(); }

}  // namespace nodal::daemon
