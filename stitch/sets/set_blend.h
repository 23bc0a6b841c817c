// From the frames of one set to its raymaps, in pieces that threads share. Rig and host make the same bytes with it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/blend/prepare.h"
#include "stitch/sets/installed_calibration.h"

namespace nodal::decode {
enum class DecodeFault : std::uint8_t;
}

namespace nodal::sets {

/// One head's frame in a set.
struct SetFrame {
  bool there = false;  ///< the head has a frame in the set
  ImageView image{};   ///< without data: the frame cannot be blended, but its exposure counts
  Fields fields = Fields::kProgressive;
  Exposure exposure;  ///< in effect, as gain and gamma
  Gain gain;
  std::int32_t gamma = 0;  ///< thousandths; 0: the calibrated response
};

/// The order of calls: adopt() once, then for each set begin(), decode() of each head that needs it, and for each table of the
/// calibration begin_raymap(), prepare() of each head that needs it, blend() of all rows. The exposure of every head is kept
/// from set to set: a missing head counts with its last one, so that the brightness of the others does not jump when it
/// disappears.
///
/// Threading: decode(), prepare() and blend() of different pieces may run on any threads at once; the other calls only while
///   none of them runs.
/// Ownership: holds the calibration; the frames must live until the set's last raymap is complete.
/// Errors: none. Allocates nothing after construction.
class SetBlend {
 public:
  /// Puts a calibration in force between two sets. Returns the one before.
  InstalledPtr adopt(InstalledPtr installed);
  const InstalledPtr& installed() const { return installed_; }

  /// `frames` has one entry for each head of the calibration. Returns how many frames do not fit the calibration.
  std::size_t begin(std::span<const SetFrame> frames);
  /// Frames of this set that have to be decoded: decode() them all.
  std::size_t to_decode() const { return heads_to_decode_; }
  struct Decoded {
    std::size_t head = 0;
    decode::DecodeFault fault{};  ///< with a fault the head counts as missing
  };
  Decoded decode(std::size_t k);

  /// For placed seams, before begin_raymap() and only with a calibration that has SeamViews: the heads' views of this set
  /// are made in the calibration's `seam_pictures`. view() them all.
  void begin_views();
  std::size_t to_view() const { return heads_to_view_; }
  void view(std::size_t k);

  /// `field`: the index of the calibration's table. `pixels`: packed_size() bytes of the raymap's format.
  void begin_raymap(std::size_t field, std::uint8_t* pixels);
  /// Pictures of this raymap that have to be prepared: prepare() them all.
  std::size_t to_prepare() const { return heads_to_prepare_; }
  void prepare(std::size_t k);
  /// Rows as blend::blend_rows() takes them.
  void blend(int row_begin, int row_end) const;

  /// Of the raymap that was begun last.
  const blend::BlendTable& table() const { return installed_->tables[field_]; }
  /// Bit i: head i is in it.
  std::uint32_t heads() const { return heads_; }
  /// 16-bit raymaps only.
  const std::optional<blend::LinearScale>& linear() const { return linear_; }

  /// The set's frames as the blend reads them, in place or decoded; empty where there is none.
  std::span<const ImageView> frames() const { return frames_; }
  std::span<const blend::ExposedHead> exposed() const { return exposed_; }

 private:
  void take_pictures();
  void undo_exposures();
  bool exposures_known() const;

  InstalledPtr installed_;
  std::array<blend::ExposedHead, kMaxHeads> exposed_{};  ///< the newest known exposure of each head
  std::uint32_t was_exposed_ = 0;                        ///< heads with an entry in exposed_

  std::array<ImageView, kMaxHeads> frames_{};
  std::array<std::size_t, kMaxHeads> to_decode_{};  ///< heads
  std::size_t heads_to_decode_ = 0;

  std::array<std::size_t, kMaxHeads> to_view_{};  ///< heads
  std::size_t heads_to_view_ = 0;

  std::size_t field_ = 0;
  std::uint32_t heads_ = 0;
  std::optional<blend::LinearScale> linear_;
  struct ToPrepare {
    const blend::BlendTable::Source* source = nullptr;
    ImageView picture;
    std::uint8_t* memory = nullptr;
    std::size_t index = 0;
  };
  std::array<ToPrepare, kMaxHeads> to_prepare_;
  std::size_t heads_to_prepare_ = 0;
  std::array<ImageView, kMaxHeads * blend::kMaxPictures> pictures_;  ///< in the order of blend::Pictures
  blend::SetTone tone_;
  MutableImageView into_;
};

}  // namespace nodal::sets
