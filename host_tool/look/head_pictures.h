// The pictures of the heads that are placed by hand: one set, or those of a take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host_tool/input/rig_pictures.h"
#include "host_tool/input/take_heads.h"
#include "host_tool/look/correlation.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::host::look {

/// One set, decoded; with copies in grey for correlations.
struct HeadSet {
  std::vector<DecodedImage> pictures;  ///< RGB24, one a head
  std::vector<GreyPyramid> grey;

  registration::FrameSet frames() const;
};

/// Threading: thread-bound; a HeadSet may be used on any thread.
/// Ownership: keeps the set that was asked for last.
/// Errors: those of take_set() and of TakeHeads.
class HeadPictures {
 public:
  /// The first set of `rig`.
  static Result<std::unique_ptr<HeadPictures>> of(RigPictures& rig);
  /// All sets of a take. Errors: also kHeadMismatch if a head of the calibration is not in the take.
  static Result<std::unique_ptr<HeadPictures>> of(std::unique_ptr<TakeHeads> take, const Calibration& calibration);

  /// When the sets were exposed, ns since the first.
  std::vector<std::int64_t> times() const;
  Result<std::shared_ptr<const HeadSet>> set(std::size_t k);
  /// One head's picture of a set as JPEG, its longer side at most `side` px.
  Result<std::vector<std::uint8_t>> jpeg(std::size_t k, std::size_t head, int side);

 private:
  explicit HeadPictures(Calibration calibration) : calibration_(std::move(calibration)) {}

  const Calibration calibration_;
  std::unique_ptr<TakeHeads> take_;  ///< null: there is one set only
  std::vector<std::size_t> order_;   ///< the head of the take for each head of the calibration
  std::shared_ptr<const HeadSet> set_;
  std::size_t number_ = 0;  ///< number of set_
};

}  // namespace nodal::host::look
