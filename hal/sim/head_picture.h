// What a simulated head writes into a buffer for a frame.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "hal/head.h"
#include "hal/sim/head_options.h"
#include "hal/sim/scene/jpeg_camera.h"
#include "hal/sim/scene/scene.h"
#include "hal/sim/scene/sensor.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// A frame from its exposure to its buffer.
struct ExposedFrame {
  std::uint32_t sequence = 0;
  Instant mid, received;
  Instant said_mid;  ///< the reported mid-exposure
  Duration nudged;
  HeadSettings settings;
  FrameVerdict verdict = FrameVerdict::kGood;
  Fields fields = Fields::kProgressive;
  double light = 1;
  bool spoiled = false;
};

/// A buffer's content.
struct BufferContent {
  std::vector<std::uint8_t> bytes;
  std::uint64_t holds = 0;         ///< by which Sensor::render knows the picture again; 0: unknown
  std::vector<std::uint8_t> jpeg;  ///< the encoded picture of a head that delivers MJPEG
};

/// Threading: thread-bound.
/// Ownership: none; the scene is shared.
/// Errors: none.
class HeadPicture {
 public:
  HeadPicture(const HeadCalibration& truth, const HeadOptions& options, ScenePtr scene, std::uint64_t seed);

  /// Renders the static scene now, which the first frame would otherwise do.
  void prepare() { sensor_.prepare(); }
  const HeadCalibration& truth() const { return truth_; }
  /// The frame with its bytes in `content`.
  FrameView render(const ExposedFrame& frame, BufferContent& content);

 private:
  const HeadCalibration truth_;
  const PixelFormat pixels_;
  const std::uint64_t seed_;
  Sensor sensor_;
  std::unique_ptr<JpegCamera> jpeg_camera_;  ///< the encoder of a head that delivers MJPEG
};

}  // namespace nodal::hal::sim
