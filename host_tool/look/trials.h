// A calibration that people try on a running rig from the page, and then keep or drop.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <thread>

#include "host_tool/input/rig_trial.h"
#include "host_tool/rig/upload.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::host::look {

/// One trial at a time: uploads, compares both calibrations on new frames, waits for people until the rig's limit.
///
/// Threading: a trial runs on a thread of its own; the functions are thread-bound.
/// Ownership: the destructor drops what is on trial.
class Trials {
 public:
  /// `limit`: how long people may think, from the moment when the rig uses the calibration.
  explicit Trials(Reconnect connect, Duration limit = kDecideWithin) : connect_(std::move(connect)), limit_(limit) {}
  ~Trials();
  Trials(const Trials&) = delete;
  Trials& operator=(const Trials&) = delete;

  /// Errors: kWrongState while another trial is under way.
  Status begin(Calibration tried);
  /// Keeps or drops what is on trial; state() says when the rig has done so. Errors: kWrongState without a trial.
  Status end(bool keep);
  /// Null before the first trial. Otherwise {phase, says, under_way, left_s}; `phase` is one of "uploading",
  /// "comparing", "on trial", "ending", and after it "kept", "dropped", "expired", "failed"; `says`: a sentence for
  /// people; `left_s`: until the rig reverts by itself, null if nothing is on trial.
  nlohmann::ordered_json state() const;

  static constexpr Duration kDecideWithin = Duration::seconds(180);

 private:
  enum class Phase : std::uint8_t {
    kNone,
    kUploading,
    kComparing,
    kOnTrial,
    kEnding,
    kKept,
    kDropped,
    kExpired,
    kFailed
  };

  static const char* name_of(Phase phase);
  static bool under_way(Phase phase);
  void run(const Calibration& tried);
  /// Waits until people decide, and returns whether to keep it; nothing if nobody did within the limit.
  std::optional<bool> decided();
  void set(Phase phase, std::string says);

  const Reconnect connect_;
  const Duration limit_;
  mutable std::mutex mutex_;  ///< protects all below
  std::condition_variable changed_;
  Phase phase_ = Phase::kNone;
  std::string says_;
  std::optional<Duration> until_;  ///< the rig reverts then
  std::optional<bool> decision_;   ///< to keep it or not
  std::thread thread_;
};

}  // namespace nodal::host::look
