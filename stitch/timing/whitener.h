// Makes all frequencies from 300 to 4000 Hz equally loud, and all moments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stitch/timing/fourier.h"

namespace nodal::timing {

/// Divides the spectra of overlapping frames, 0.4 s each, by their magnitude: the phase transform (PHAT) of both sides
/// of a correlation. Frames below -80 dB are 0. The result does not depend on how the samples are cut into blocks.
///
/// Threading: thread-bound.
class Whitener {
 public:
  Whitener();
  /// Takes samples at kBandRate; returns those that are ready, which come up to 0.4 s later.
  std::vector<float> add(std::span<const float> samples);
  /// The rest; as many samples in all as were added.
  std::vector<float> finish();

 private:
  void add_frame();

  Fourier fourier_;
  std::vector<double> window_;
  std::vector<float> waiting_;  // samples of frames to come; the first frame begins half a frame before the sound
  std::vector<float> sum_;      // sum of the two frames that cover each sample
  std::vector<float> ready_;
  std::int64_t added_ = 0, given_ = 0;
  bool first_ = true;
};

}  // namespace nodal::timing
