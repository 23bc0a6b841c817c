#include "stitch/sets/set_blend.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/blend/blend.h"
#include "stitch/sets/blend_memory.h"

namespace nodal::sets {
namespace {

std::uint32_t bit(std::size_t head) { return std::uint32_t{1} << head; }

/// The part of a head's frame that is blended: all of it, or the field that the source is for.
ImageView picture_of(const blend::BlendTable::Source& source, const ImageView& frame) {
  return source.field ? field_of(frame, *source.field) : frame;
}

/// `first` is the head's source in the first table, the one for the field exposed first.
bool has_fields_for(const blend::BlendTable::Source& first, const SetFrame& frame) {
  return !first.field || frame.fields == fields_from(*first.field);
}

}  // namespace

BlendSetup SetBlend::adopt(BlendSetup setup) {
  field_ = 0;
  return std::exchange(setup_, std::move(setup));
}

PlanPtr SetBlend::move_seams(PlanPtr plan) { return std::exchange(setup_.plan, std::move(plan)); }

void SetBlend::note_exposures(std::span<const SetFrame> frames) {
  for (std::size_t i = 0; i < plan()->delivered.size(); ++i) {
    if (!frames[i].present) continue;
    exposed_[i] = {stops_of(frames[i].exposure) + stops_of(frames[i].gain), frames[i].gamma};
    was_exposed_ |= bit(i);
  }
}

std::size_t SetBlend::begin(std::span<const SetFrame> frames, bool views) {
  note_exposures(frames);
  heads_to_decode_ = heads_to_view_ = 0;
  wants_views_ = views;
  next_kind_ = static_cast<std::uint8_t>(Round::Kind::kDecode);
  end_kind_ = static_cast<std::uint8_t>(Round::Kind::kPrepare);
  std::size_t unfit = 0;
  const std::vector<decode::FrameDecoder>& decoders = setup_.memory->decoders;
  for (std::size_t i = 0; i < decoders.size(); ++i) {
    frames_[i] = {};
    if (!frames[i].present) continue;
    if (frames[i].image.planes[0].data == nullptr || !decoders[i].takes(frames[i].image) ||
        !has_fields_for(plan()->tables[0].sources[i], frames[i])) {
      ++unfit;
      continue;
    }
    frames_[i] = frames[i].image;
    if (decoders[i].needed(frames_[i])) decoded_[heads_to_decode_++] = {i, decode::DecodeFault::kNone};
  }
  return unfit;
}

std::optional<Round> SetBlend::next_round() {
  while (next_kind_ < end_kind_) {
    round_.kind = static_cast<Round::Kind>(next_kind_++);
    round_.pieces = prepare_round(round_.kind);
    if (round_.pieces > 0) return round_;
  }
  return std::nullopt;
}

/// Returns the number of pieces.
std::size_t SetBlend::prepare_round(Round::Kind kind) {
  switch (kind) {
    case Round::Kind::kDecode: return heads_to_decode_;
    case Round::Kind::kView: return wants_views_ ? begin_views() : 0;
    case Round::Kind::kPrepare: return heads_to_prepare_;
    case Round::Kind::kBlend: return static_cast<std::size_t>((table().height + kBandRows - 1) / kBandRows);
  }
  return 0;
}

void SetBlend::run(std::size_t piece) {
  switch (round_.kind) {
    case Round::Kind::kDecode: {
      Decoded& decoded = decoded_[piece];
      const ImageView frame = frames_[decoded.head];
      decoded.fault = setup_.memory->decoders[decoded.head].decode(frame, frames_[decoded.head]);
      break;
    }
    case Round::Kind::kView: view(to_view_[piece]); break;
    case Round::Kind::kPrepare: prepare(piece); break;
    case Round::Kind::kBlend: blend(piece); break;
  }
}

std::size_t SetBlend::begin_views() {
  std::uint32_t& heads = setup_.memory->seam_pictures.heads;
  heads = 0;
  for (std::size_t i = 0; i < plan()->tables[0].sources.size(); ++i) {
    if (frames_[i].planes[0].data == nullptr) continue;
    heads |= bit(i);
    to_view_[heads_to_view_++] = i;
  }
  return heads_to_view_;
}

void SetBlend::view(std::size_t head) {
  const blend::BlendTable& first = plan()->tables[0];
  std::uint8_t* scratch = setup_.memory->prepared.data();
  for (std::size_t i = 0; i < head; ++i) scratch += plan()->seams->scratch_size(i);
  // Views of raymaps of linear light have 8 bits, for which these exposures are not.
  const bool equalized = exposures_known() && !is_linear16(first.format);
  plan()->seams->view(head, picture_of(first.sources[head], frames_[head]), plan()->exposures,
                      std::span(exposed_).first(equalized ? first.sources.size() : 0), scratch,
                      setup_.memory->seam_pictures);
}

std::shared_ptr<const SeamPictures> SetBlend::views() const {
  if (heads_to_view_ == 0) return nullptr;
  return {setup_.memory, &setup_.memory->seam_pictures};
}

void SetBlend::begin_raymap(std::size_t field, std::uint8_t* pixels) {
  field_ = field;
  into_ = packed_image(table().format, table().width, table().height, pixels);
  next_kind_ = static_cast<std::uint8_t>(Round::Kind::kPrepare);
  end_kind_ = static_cast<std::uint8_t>(Round::Kind::kBlend) + 1;
  take_pictures();
  undo_exposures();
}

void SetBlend::take_pictures() {
  std::uint8_t* memory = setup_.memory->prepared.data();
  heads_to_prepare_ = 0;
  heads_ = 0;
  for (std::size_t i = 0; i < table().sources.size(); ++i) {
    const blend::BlendTable::Source& source = table().sources[i];
    const std::size_t bytes = blend::prepared_size(source);
    std::uint8_t* own_memory = memory;
    memory += bytes;
    pictures_[i] = {};
    if (frames_[i].planes[0].data == nullptr) continue;
    heads_ |= bit(i);
    pictures_[i] = picture_of(source, frames_[i]);
    if (bytes > 0) to_prepare_[heads_to_prepare_++] = {&source, pictures_[i], own_memory, i};
  }
}

bool SetBlend::exposures_known() const {
  const std::size_t heads = plan()->tables[0].sources.size();
  const std::uint32_t all = static_cast<std::uint32_t>((std::uint64_t{1} << heads) - 1);
  return plan()->exposures.heads.size() == heads && (was_exposed_ & all) == all;
}

void SetBlend::undo_exposures() {
  const std::size_t heads = table().sources.size();
  const bool known = exposures_known();
  linear_.reset();
  if (is_linear16(table().format)) {
    const auto as_calibrated = decltype(exposed_){};
    const std::span<const blend::ExposedHead> exposed(known ? exposed_ : as_calibrated);
    tone_ = blend::linear_tone(table(), plan()->exposures, exposed.first(heads));
    linear_ = blend::linear_scale(plan()->exposures, tone_, exposed.first(heads));
    if (!known) linear_->full.reset();
    return;
  }
  tone_ = known ? blend::tone_of_exposures(table(), plan()->exposures, exposed_) : plan()->tone;
}

void SetBlend::prepare(std::size_t k) {
  const ToPrepare& head = to_prepare_[k];
  std::array<ImageView, blend::kMaxPictures> views;
  blend::prepare_picture(*head.source, head.picture, head.memory, views);
  for (std::size_t level = 0; level < head.source->pictures(); ++level) {
    pictures_[level * table().sources.size() + head.index] = views[level];
  }
}

void SetBlend::blend(std::size_t band) {
  const int row = static_cast<int>(band) * kBandRows;
  blend::blend_rows(table(), pictures_, tone_, into_, row, std::min(row + kBandRows, table().height));
}

}  // namespace nodal::sets
