// The stages that Operation controls.
#pragma once

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/operate/audit_log.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_reader.h"
#include "firmware/storage/audit_store.h"
#include "firmware/storage/settings_store.h"
#include "hal/heartbeats.h"

namespace nodal::firmware {

struct Stages {
  Capture& capture;
  Blender& blender;
  EncodeStage& encoder;
  CalibrationKeeper& keeper;
  SettingsStore& settings;
  AuditStore& audit;
  AuditLog::UtcClock utc;
  TakeKeeper* takes = nullptr;                ///< null: the rig records nothing
  TakeReader* take_reader = nullptr;          ///< null if `takes` is
  hal::HeartbeatsPort* heartbeats = nullptr;  ///< null: every stage runs on one thread, in tests
};

/// The stages' newest reports.
struct Reports {
  const CaptureReport* capture = nullptr;
  const KeeperReport* keeper = nullptr;
  const TakeReport* takes = nullptr;  ///< null: the rig records nothing
};

}  // namespace nodal::firmware
