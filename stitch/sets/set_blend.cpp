#include "stitch/sets/set_blend.h"

#include <utility>

#include "protocol/base/result.h"
#include "stitch/blend/blend.h"
#include "stitch/decode/frame_decoder.h"
#include "stitch/sets/seam_views.h"

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

InstalledPtr SetBlend::adopt(InstalledPtr installed) {
  field_ = 0;
  return std::exchange(installed_, std::move(installed));
}

std::size_t SetBlend::begin(std::span<const SetFrame> frames) {
  heads_to_decode_ = 0;
  std::size_t unfit = 0;
  const auto& decoders = installed_->decoders;
  for (std::size_t i = 0; i < decoders.size(); ++i) {
    frames_[i] = {};
    if (!frames[i].there) continue;
    exposed_[i] = {stops_of(frames[i].exposure) + stops_of(frames[i].gain), frames[i].gamma};
    was_exposed_ |= bit(i);
    if (frames[i].image.planes[0].data == nullptr || !decoders[i]->takes(frames[i].image) ||
        !has_fields_for(installed_->tables[0].sources[i], frames[i])) {
      ++unfit;
      continue;
    }
    frames_[i] = frames[i].image;
    if (decoders[i]->needed(frames_[i])) to_decode_[heads_to_decode_++] = i;
  }
  return unfit;
}

SetBlend::Decoded SetBlend::decode(std::size_t k) {
  const std::size_t head = to_decode_[k];
  const ImageView frame = frames_[head];
  return {head, installed_->decoders[head]->decode(frame, frames_[head])};
}

void SetBlend::begin_views() {
  std::uint32_t& heads = installed_->seam_pictures->heads;
  heads = 0;
  heads_to_view_ = 0;
  for (std::size_t i = 0; i < installed_->tables[0].sources.size(); ++i) {
    if (frames_[i].planes[0].data == nullptr) continue;
    heads |= bit(i);
    to_view_[heads_to_view_++] = i;
  }
}

void SetBlend::view(std::size_t k) {
  const std::size_t head = to_view_[k];
  const blend::BlendTable& first = installed_->tables[0];
  std::uint8_t* scratch = installed_->prepared->data();
  for (std::size_t i = 0; i < head; ++i) scratch += installed_->seams->scratch_size(i);
  // Views of raymaps of linear light have 8 bits, for which these exposures are not.
  const bool equalized = exposures_known() && !is_linear16(first.format);
  installed_->seams->view(head, picture_of(first.sources[head], frames_[head]), installed_->exposures,
                          std::span(exposed_).first(equalized ? first.sources.size() : 0), scratch,
                          *installed_->seam_pictures);
}

void SetBlend::begin_raymap(std::size_t field, std::uint8_t* pixels) {
  field_ = field;
  into_ = packed_image(table().format, table().width, table().height, pixels);
  take_pictures();
  undo_exposures();
}

void SetBlend::take_pictures() {
  std::uint8_t* memory = installed_->prepared->data();
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
  const std::size_t heads = installed_->tables[0].sources.size();
  const std::uint32_t all = static_cast<std::uint32_t>((std::uint64_t{1} << heads) - 1);
  return installed_->exposures.heads.size() == heads && (was_exposed_ & all) == all;
}

void SetBlend::undo_exposures() {
  const std::size_t heads = table().sources.size();
  const bool known = exposures_known();
  linear_.reset();
  if (is_linear16(table().format)) {
    const auto as_calibrated = decltype(exposed_){};
    const std::span<const blend::ExposedHead> exposed(known ? exposed_ : as_calibrated);
    tone_ = blend::linear_tone(table(), installed_->exposures, exposed.first(heads));
    linear_ = blend::linear_scale(installed_->exposures, tone_, exposed.first(heads));
    if (!known) linear_->full.reset();
    return;
  }
  tone_ = known ? blend::tone_of_exposures(table(), installed_->exposures, exposed_) : installed_->tone;
}

void SetBlend::prepare(std::size_t k) {
  const ToPrepare& head = to_prepare_[k];
  std::array<ImageView, blend::kMaxPictures> views;
  blend::prepare_picture(*head.source, head.picture, head.memory, views);
  for (std::size_t level = 0; level < head.source->pictures(); ++level) {
    pictures_[level * table().sources.size() + head.index] = views[level];
  }
}

void SetBlend::blend(int row_begin, int row_end) const {
  blend::blend_rows(table(), pictures_, tone_, into_, row_begin, row_end);
}

}  // namespace nodal::sets
