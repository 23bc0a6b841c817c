// The whole rig: every stage and the rings between them. In the field each stage has threads of its own that call it;
// in tests one executor calls them all.
#pragma once

#include <string>
#include <vector>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/control.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "firmware/storage/settings_store.h"
#include "hal/clock.h"
#include "hal/disk.h"
#include "hal/head.h"
#include "hal/link.h"
#include "hal/trigger.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

/// Frames a head must be able to lend: of open sets, of what each reader of sets holds, and two for the driver to fill.
inline constexpr std::size_t kFramesAHead =
    Capture::kMaxOpenSets + held_at_most(Blender::kSets) + held_at_most(FrameSender::kSets) + 2;

/// The world, as a rig reaches it.
struct RigPorts {
  hal::ClockPort& clock;
  hal::HeadEnumerator& heads;
  hal::TriggerPort* trigger = nullptr;
  hal::DiskPort& disk;
  std::vector<Listener> listeners;
  hal::WatchdogPort* watchdog = nullptr;
  PanelPins panel;
  hal::ClockPort* stopwatch = nullptr;  ///< for how long a blend takes, when `clock` is a virtual one
};

/// Threading: each step_ function by one thread, step_blend() by as many as there are cores. close() when none is in
///   any of them.
/// Ownership: the ports outlive it.
/// Errors: none; what goes wrong is in the status that hosts are told.
class Rig {
 public:
  Rig(const RigConfig& config, const RigPorts& ports, const std::string& software);
  ~Rig();

  // Each is true when it did something.
  bool step_capture();
  bool step_blend() { return blender_.step(); }
  bool step_encode() { return encoder_.step(); }
  /// All that waits for the disk: calibrations and settings.
  bool step_keeper();
  bool step_control();

  /// Everything once, for an executor of one thread; bands until none are left.
  bool step_all();
  /// Ends: gives frames back, stops heads and trigger.
  void close();

  Capture& capture() { return capture_; }
  Blender& blender() { return blender_; }
  EncodeStage& encoder() { return encoder_; }
  CalibrationKeeper& keeper() { return keeper_; }
  Control& control() { return control_; }

 private:
  hal::ClockPort& clock_;
  Capture capture_;
  Blender blender_;
  EncodeStage encoder_;
  CalibrationKeeper keeper_;
  SettingsStore settings_;
  Control control_;
};

}  // namespace nodal::firmware
