// A calibration on trial on a running rig, compared with the one before on frames that are taken meanwhile.
#pragma once

#include <memory>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/input/rig_pictures.h"
#include "host_tool/rig/rig_connection.h"
#include "host_tool/rig/upload.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// What the heads' pictures differ by: the objective of a registration, levels squared.
struct TrialFigures {
  double before = 0;  ///< under the calibration that was in force
  double after = 0;   ///< under the one on trial, on the same frames

  /// Whether the one on trial is better; a repetition of the same calibration is not.
  bool better() const;
  /// Both, in words.
  std::string text() const;
};

/// While it lives, a rig uses a calibration that it has not stored. If this program, its link or the rig's power fail,
/// the rig reverts by itself after limit().
///
/// Threading: thread-bound.
/// Ownership: owns a connection; the destructor tells the rig to revert unless end() was called.
/// Errors: kUnsupported for a rig without trials, kNotFound for one without a calibration; those of upload(), of
///   pull_frame_sets() and of registration::objectives_of().
class RigTrial {
 public:
  /// Uploads `tried`, which is then in force. `document` is its file, which `terms.signature` is for; without them
  /// `tried` is serialized and sent unsigned. `terms.trial`: the limit, kUsualLimit if it is not set; it is 40 frame
  /// periods, if these are longer.
  static Result<std::unique_ptr<RigTrial>> begin(const Reconnect& connect, const Calibration& tried, UploadTerms terms,
                                                 std::string document, Console& console);
  ~RigTrial();
  RigTrial(const RigTrial&) = delete;
  RigTrial& operator=(const RigTrial&) = delete;

  /// How long the rig uses the calibration if nobody calls end().
  Duration limit() const { return limit_; }
  /// Frame sets that the rig blended with it, from which neither calibration was made.
  Result<RigPictures> pull(int sets, Console& console);
  /// Takes seconds, and does not need the rig.
  Result<TrialFigures> compare(const RigPictures& pictures) const;
  /// Closes the connection; end() makes another one. A rig does not wait for a host for as long as people think.
  void hang_up() { rig_.reset(); }
  /// The rig keeps the calibration for good, or reverts. Errors: kNotFound or kWrongState after limit().
  Status end(bool keep);

  static constexpr Duration kUsualLimit = Duration::seconds(60);

 private:
  RigTrial(Reconnect connect, Calibration tried);

  Reconnect connect_;
  std::unique_ptr<RigConnection> rig_;
  Calibration before_, tried_;
  Duration limit_;
  bool ended_ = false;
};

}  // namespace nodal::host
