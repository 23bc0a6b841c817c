// The heads' own pictures of a take on this computer, set by set, in any order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::host {

/// Whether it is the folder of a take.
bool is_take(const std::string& path);

/// The sets of a take in which every head has a picture.
///
/// Threading: thread-bound.
/// Ownership: has one segment's evidence in memory; the folder must stay.
/// Errors: those of media::TakeFolder.
class TakeHeads {
 public:
  /// Errors: also kBadFormat for a take without heads; kNotFound when no set has all heads, naming the head that most
  /// sets lack.
  static Result<std::unique_ptr<TakeHeads>> open(const std::string& folder);

  /// As in the take.
  const std::vector<std::string>& heads() const { return folder_.about().heads; }
  /// Mid-exposures, ns since the first of these sets.
  const std::vector<std::int64_t>& times() const { return times_; }
  /// The calibration that was in force last. Errors: kNotReady if none was stored with the take.
  Result<Calibration> calibration() const;
  /// Decoded as the blend decodes it.
  Result<DecodedImage> picture(std::size_t set, std::size_t head);
  /// As the head delivered it; empty if it is no JPEG.
  Result<std::vector<std::uint8_t>> jpeg(std::size_t set, std::size_t head);

 private:
  TakeHeads(std::string name, media::TakeFolder folder)
      : name_(std::move(name)), folder_(std::move(folder)), sets_(folder_) {}
  Status find_sets();
  /// Reads the head's picture of a set into `set_`.
  Status read(std::size_t set, std::size_t head);

  const std::string name_;
  const media::TakeFolder folder_;
  media::TakeSets sets_;
  std::vector<media::TakeSets::Place> places_;  ///< one a set
  std::vector<std::int64_t> times_;
  media::TakeSet set_;  ///< the one that was read last
  std::size_t read_ = 0;
  bool any_read_ = false;
};

}  // namespace nodal::host
