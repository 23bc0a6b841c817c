// A process of hosts that all ask for the same thing without a pause, to keep it from others.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace nodal::crash {

/// What the hosts ask for.
enum class Occupation : std::uint8_t {
  kNothing,
  kStatus,
  kHeads,
  kGenlock,   ///< shown
  kExposure,  ///< shown
  kHosts,
  kDevices,
  kCalibrationList,
  kTakeList,
  kAuditLog,
  kPulls,  ///< endless pulls of raymaps
  kPullsUnread,
  kFrameSets,  ///< pulls of frame sets, which are read
  kFrameSetsUnread,
  kFrameSetsViewOnly,  ///< unread pulls at the view-only socket
  kTakeReads,
  kTakeReadsUnread,
  kUploads,  ///< uploads of calibrations that take long to compile
  kCalibrationUse,
  kDiskTests,  ///< tests of one minute
  kSettings,
  kTakeMarks,  ///< marks while no take is recorded
  kTakeProtects,
};
inline constexpr int kOccupations = 23;
std::string_view name_of(Occupation kind);

/// Forked from a single-threaded program; killed by the destructor and at the program's end. Of the lowest priority,
/// because the subject is the rig's order and not the machine's processors.
///
/// Threading: thread-bound.
/// Ownership: owns the process.
/// Errors: running() is false if it could not be started, or died.
class Occupiers {
 public:
  /// Sockets for control and for viewing. `slow`: a calibration that takes long to compile.
  struct Target {
    std::string control, view, slow;
  };
  Occupiers(Occupation kind, int hosts, const Target& target);
  ~Occupiers();
  Occupiers(const Occupiers&) = delete;
  Occupiers& operator=(const Occupiers&) = delete;

  bool running();

 private:
  pid_t pid_ = -1;
};

}  // namespace nodal::crash
