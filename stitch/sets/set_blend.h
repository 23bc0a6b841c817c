// From the frames of one set to its raymaps, in pieces that threads share. Rig and host make the same bytes with it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/blend/prepare.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::decode {
enum class DecodeFault : std::uint8_t;
}

namespace nodal::sets {

struct SeamPictures;

/// One head's frame in a set.
struct SetFrame {
  bool present = false;  ///< the head has a frame in the set
  ImageView image{};     ///< without data: the frame cannot be blended, but its exposure counts
  Fields fields = Fields::kProgressive;
  Exposure exposure;  ///< exposure in effect, as gain and gamma
  Gain gain;
  std::int32_t gamma = 0;  ///< thousandths; 0: the calibrated response
};

/// Work whose pieces may run at once; all of them must have run before the next round.
struct Round {
  enum class Kind : std::uint8_t { kDecode, kView, kPrepare, kBlend };
  Kind kind{};
  std::size_t pieces = 0;
};

/// For each set begin(), and for each table of the plan begin_raymap(); after each of these, next_round() hands out
/// rounds of work in the only possible order until there is none:
///
/// | after | rounds | a piece |
/// |---|---|---|
/// | begin() | kDecode, if the blend cannot read frames as they are | a head |
/// | | kView, if begin() was asked for views | a head |
/// | begin_raymap() | kPrepare, if the table requires it | a head |
/// | | kBlend | kBandRows rows |
///
/// The exposure of every head is kept from set to set: a missing head counts with its last one, so that the brightness
/// of the others does not jump when it disappears.
///
/// Threading: run() for different pieces of a round may run on any threads at once. Other calls only while none of them
///   runs; those that are const also while the pieces of a raymap run.
/// Ownership: holds the plan and the memory; the frames must live until the set's last raymap is complete.
/// Errors: none. Allocates nothing after construction.
class SetBlend {
 public:
  /// Rows of a raymap in a piece; the blend is fastest with multiples of 64.
  static constexpr int kBandRows = 64;

  /// Puts a calibration in force between two sets. Returns the one before.
  BlendSetup adopt(BlendSetup setup);
  /// Puts other seams of the calibration in force between two sets. Returns the plan before.
  PlanPtr move_seams(PlanPtr plan);
  /// Null before adopt().
  const PlanPtr& plan() const { return setup_.plan; }

  /// Notes the exposures of a set that is not blended. `frames` has one entry for each head of the calibration.
  void note_exposures(std::span<const SetFrame> frames);
  /// The same for the next set to blend. `views`: makes the heads' views of this set, too, for placing seams; only with
  /// a plan that has SeamViews. Returns how many frames do not fit the calibration.
  std::size_t begin(std::span<const SetFrame> frames, bool views = false);
  /// `field`: the index of the plan's table. `pixels`: packed_size() bytes of the raymap's format.
  void begin_raymap(std::size_t field, std::uint8_t* pixels);

  /// The next round; nothing when the set is ready for begin_raymap(), and when the raymap is complete.
  std::optional<Round> next_round();
  /// Does a piece, 0 .. pieces - 1, of the newest round.
  void run(std::size_t piece);
  /// All rounds up to the next begin(), begin_raymap(): `share`(pieces, work) calls work(i) for i in 0 .. pieces - 1.
  template <class Share>
  void run_rounds(const Share& share) {
    while (const auto round = next_round()) {
      share(static_cast<int>(round->pieces), [this](int piece) { run(static_cast<std::size_t>(piece)); });
    }
  }

  /// The same on the calling thread.
  void run_rounds() {
    while (const auto round = next_round()) {
      for (std::size_t piece = 0; piece < round->pieces; ++piece) run(piece);
    }
  }

  struct Decoded {
    std::size_t head = 0;
    decode::DecodeFault fault{};  ///< with a fault the head counts as missing
  };
  /// The frames of this set that had to be decoded.
  std::span<const Decoded> decoded() const { return std::span(decoded_).first(heads_to_decode_); }
  /// The views of this set if at least one was made, else null. Valid, also after another adopt(), until the views of
  /// another set are made.
  std::shared_ptr<const SeamPictures> views() const;

  /// Of the raymap that was begun last.
  const blend::BlendTable& table() const { return setup_.plan->tables[field_]; }
  /// Bit i: head i is in it.
  std::uint32_t heads() const { return heads_; }
  /// 16-bit raymaps only.
  const std::optional<blend::LinearScale>& linear() const { return linear_; }

  /// The set's frames as the blend reads them, in place or decoded; empty where there is none.
  std::span<const ImageView> frames() const { return frames_; }
  std::span<const blend::ExposedHead> exposed() const { return exposed_; }

 private:
  std::size_t prepare_round(Round::Kind kind);
  std::size_t begin_views();
  void view(std::size_t head);
  void prepare(std::size_t k);
  void blend(std::size_t band);
  void take_pictures();
  void undo_exposures();
  bool exposures_known() const;

  BlendSetup setup_;
  std::array<blend::ExposedHead, kMaxHeads> exposed_{};  ///< the newest known exposure of each head
  std::uint32_t was_exposed_ = 0;                        ///< heads with an entry in exposed_

  Round round_;
  std::uint8_t next_kind_ = 0;  ///< the kind of the next round; those up to end_kind_ may follow
  std::uint8_t end_kind_ = 0;

  std::array<ImageView, kMaxHeads> frames_{};
  std::array<Decoded, kMaxHeads> decoded_{};  ///< the first heads_to_decode_
  std::size_t heads_to_decode_ = 0;

  bool wants_views_ = false;
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
  std::array<ImageView, kMaxHeads * blend::kMaxPictures> pictures_;  ///< pictures in the order of blend::Pictures
  blend::SetTone tone_;
  MutableImageView into_;
};

}  // namespace nodal::sets
