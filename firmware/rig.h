// The whole rig: every stage and the rings between them. In nodald each stage has its own threads; in tests one
// executor calls all stages.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/control.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "firmware/picture/seam_stage.h"
#include "firmware/record/recorder.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_reader.h"
#include "firmware/storage/audit_store.h"
#include "firmware/storage/settings_store.h"
#include "hal/clock.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "hal/head.h"
#include "hal/heartbeats.h"
#include "hal/link.h"
#include "hal/trigger.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

class FlightLog;
class FlightRecorder;

/// The most frame sets that all readers hold at once.
inline constexpr std::size_t kSetsHeld =
    held_at_most(Blender::kSets) + held_at_most(FrameSender::kSets) + held_at_most(Recorder::kSets);
/// The number of buffers of a head: one for each open set, one for each set that a reader can hold, two for the driver.
inline constexpr std::size_t kFramesAHead = Capture::kMaxOpenSets + kSetsHeld + 2;

/// The ports of a rig.
struct RigPorts {
  hal::ClockPort& clock;
  hal::HeadEnumerator& heads;
  hal::TriggerPort* trigger = nullptr;
  hal::DiskPort& disk;
  std::vector<Listener> listeners;
  hal::WatchdogPort* watchdog = nullptr;
  PanelPins panel;
  hal::ClockPort* stopwatch = nullptr;     ///< real clock that measures processing times, if `clock` is virtual
  DeviceScan* scan = nullptr;              ///< null: hosts cannot list what is plugged in
  hal::DiskPort* takes = nullptr;          ///< where takes are recorded ([takes]); null: nothing is recorded
  hal::DiskPort* takes_read = nullptr;     ///< the same folder, for the thread that reads; null without `takes`
  hal::ConfinedPort* recovery = nullptr;   ///< where takes are recovered; null: in step_takes()
  hal::ConfinedPort* rehearsal = nullptr;  ///< where calibrations are parsed and compiled first; null: nowhere
  TakeKeeper::UtcClock utc = [] { return std::int64_t{0}; };
  hal::HeartbeatsPort* heartbeats = nullptr;  ///< heartbeats of the threads that call the steps
};

/// Threading: one thread per step_ function, any number of threads for step_blend(); close() while no thread is in any
///   of them.
/// Ownership: the ports outlive it.
/// Errors: none; faults are in the status that hosts read.
class Rig {
 public:
  Rig(const RigConfig& config, const RigPorts& ports, const std::string& software);
  ~Rig();

  // Each step returns true when it did something.
  bool step_capture();
  bool step_blend() { return blender_.step(); }
  bool step_encode() { return encoder_.step(); }
  /// Without effect in a rig with fixed seams.
  bool step_seams() { return seams_.step(); }
  /// The stages that block on the disk: calibrations, settings and the audit log.
  bool step_keeper();
  bool step_control();
  /// False in a rig that records nothing.
  bool step_record() { return takes_ && takes_->recorder.step(); }
  /// Blocks on the disk of the takes.
  bool step_takes() { return takes_ && takes_->keeper.step(clock_.now()); }
  /// Blocks on the same disk, reading.
  bool step_take_reader() { return takes_ && takes_->reader.step(); }

  /// One step of every stage, for an executor with one thread; the blend and the encoder until they have no work.
  bool step_all();
  /// Ends the rig: returns frames, stops heads and trigger.
  void close();

  Capture& capture() { return capture_; }
  Blender& blender() { return blender_; }
  EncodeStage& encoder() { return encoder_; }
  bool places_seams() const { return places_seams_; }
  const SeamStage& seams() const { return seams_; }
  CalibrationKeeper& keeper() { return keeper_; }
  Control& control() { return control_; }
  /// Frame sets wait that control sends to hosts.
  bool hosts_have_sets() const { return !frame_sets_.empty(); }
  bool records() const { return takes_ != nullptr; }
  Recorder& recorder() { return takes_->recorder; }
  TakeKeeper& takes() { return takes_->keeper; }

 private:
  /// The stages of a rig that records.
  struct Takes {
    Takes(Rig& rig, const RigConfig& config, const RigPorts& ports, const std::string& software);

    Recorder recorder;
    std::unique_ptr<FlightLog> flight_log;  ///< null without [takes] flight_recorder
    TakeKeeper keeper;
    TakeReader reader;
  };
  Stages stages(const RigPorts& ports);

  hal::ClockPort& clock_;
  std::unique_ptr<FlightRecorder> flight_;  ///< null without [takes] flight_recorder
  Capture capture_;
  Blender blender_;
  const bool places_seams_;
  SeamStage seams_;
  EncodeStage encoder_;
  CalibrationKeeper keeper_;
  SettingsStore settings_;
  AuditStore audit_;
  Outlet<SetLoan>& frame_sets_;   ///< capture's, for hosts
  std::unique_ptr<Takes> takes_;  ///< null in a rig that records nothing
  Control control_;
};

}  // namespace nodal::firmware
