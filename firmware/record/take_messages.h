// What hosts ask of the stage that writes takes, what it answers, and its status.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/frame/frame_set.h"
#include "firmware/frame/presence.h"
#include "firmware/record/disk_test.h"
#include "firmware/record/take_entry.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

struct TakeRequest {
  struct Start {
    std::optional<Sha256> calibration{};  ///< hash of the calibration in force; empty: none
    std::string calibration_json{};       ///< canonical form of that calibration
    HeadShapes heads{};                   ///< shapes of the heads' pictures, to estimate the room that a take needs
    bool still = false;                   ///< the take is one set; the answer comes when the set is on the disk
    std::optional<FrameRate> rate{};      ///< rate of the sets; empty: not known, and the one in rig.toml is used
  };
  struct Stop {};
  struct Mark {
    std::string text;
    static constexpr std::size_t kMaxBytes = 200;
  };
  struct List {};
  struct Delete {
    std::uint64_t take = 0;
    std::optional<Sha256> manifest{};  ///< if set, only a take with this manifest is deleted
  };
  struct Protect {
    std::uint64_t take = 0;
    bool on = false;
  };
  struct TestDisk {
    Duration length = Duration::seconds(10);
    HeadShapes heads{};  ///< shapes of the heads' pictures, to estimate what each mode needs
    std::optional<FrameRate> rate{};
    /// A running test also answers later requests, and is extended to the length that they ask for. A test may always
    /// last this long.
    static constexpr Duration kShared = Duration::seconds(10);
  };
  /// Ends the take, syncs the disk and stops using it, so that it can be removed. Done names the take; 0: none was
  /// being recorded.
  struct Eject {};
  using What = std::variant<List, Start, Stop, Mark, Delete, Protect, TestDisk, Eject>;

  std::uint64_t ticket = 0;
  What what;
  Presence host{};
};
using TakeCommand = TakeRequest::What;

struct TakeAnswer {
  struct Listed {
    std::vector<TakeEntry> takes;
  };
  struct Done {
    std::uint64_t take = 0;
  };
  struct DiskTested {
    DiskSpeed speed;
    std::vector<DiskVerdict> modes;
  };
  std::uint64_t ticket = 0;
  Result<std::variant<Listed, Done, DiskTested>> result;
};

/// Status of the stage.
struct TakeReport {
  /// The takes on the disk have been read, and interrupted ones have been recovered, or another process is recovering
  /// them.
  bool ready = false;
  std::string no_disk;      ///< why nothing can be recorded on the disk now; empty: the disk is usable
  bool ejected = false;     ///< a host ejected the disk; it is not used until it is inserted again, or another one is
  std::uint64_t disks = 0;  ///< number of disks that have come since nodald started
  /// The newest take ended, or the newest start was refused, for a temporary reason: a fault of the disk, no room, or
  /// an eject.
  bool interrupted = false;
  bool has_room = true;  ///< as far as is known without deleting anything, there is room to start a take
  std::optional<std::uint64_t> recording;
  Instant since;
  std::uint64_t sets = 0;            ///< sets of the current take
  std::uint64_t lost_sets = 0;       ///< lost sets of the current take
  std::uint64_t lost_by_errors = 0;  ///< how many of lost_sets were lost by an error of the disk, not by its speed
  std::uint64_t lost_raymaps = 0;
  bool leaves_out_raymaps = false;   ///< raymaps are not recorded at the moment because the buffer is too full
  int quality = 0;                   ///< quality of the JPEGs that the rig encodes now; 0: it encodes none
  std::uint32_t buffer_percent = 0;  ///< used part of [takes] buffer_mb
  std::optional<Instant> durable;    ///< everything recorded before this moment is on the disk
  std::uint64_t free_bytes = 0;
  std::uint64_t total_bytes = 0;              ///< size of the disk; 0: not known yet
  std::uint64_t bytes_a_second = 0;           ///< write rate that the take needs
  std::optional<std::uint32_t> test_percent;  ///< progress of the running test of the disk; empty: none runs
  bool loop = false;                          ///< [takes] when_full = "loop"
  std::uint64_t deleted_segments = 0;         ///< segments deleted since nodald started to make room
  std::string problem;                        ///< fault of the disk, or why the last take ended
  std::string refused;  ///< why the last requested take was not started; the audit log has it, too
};

}  // namespace nodal::firmware
