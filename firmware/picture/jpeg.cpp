#include "firmware/picture/jpeg.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <string>
#include <utility>

#include "stitch/media/gpano.h"
#include "stitch/media/jpeg_writer.h"

namespace nodal::firmware {
namespace {

std::string sphere_metadata(const RaymapConfig& config) {
  return config.layout == "equirectangular" ? media::gpano_packet(config.width, config.height) : "";
}

}  // namespace

void RaymapComment::add(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  const int more = std::vsnprintf(text_.data() + length_, text_.size() - length_, format, arguments);
  va_end(arguments);
  NODAL_ASSERT(more > 0 && static_cast<std::size_t>(more) < text_.size() - length_);
  length_ += static_cast<std::size_t>(more);
}

RaymapComment::RaymapComment(const RaymapInfo& info) {
  add("nodal set=%llu mid_exposure_ns=%lld spread_ns=%lld heads=0x%x genlock=%s calibration=",
      static_cast<unsigned long long>(info.set), static_cast<long long>(info.mid_exposure.ns()),
      static_cast<long long>(info.sync.spread.ns()), info.heads, genlock_state_name(info.sync.state).data());
  for (const std::uint8_t byte : info.calibration) add("%02x", byte);
  if (info.field) add(" field=%d parity=%s", info.field->number, field_parity_name(info.field->parity).data());
  if (info.sync.trigger) add(" trigger=%llu", static_cast<unsigned long long>(*info.sync.trigger));
}

JpegEncoder::JpegEncoder(const RaymapConfig& config) : config_(config) {
  const std::string xmp = sphere_metadata(config);
  writer_ = std::make_unique<media::JpegWriter>(
      media::JpegSpec{in_8_bits(config.format), config.width, config.height, config.jpeg_quality, xmp});
  if (!is_linear16(config.format)) return;
  picture_.resize(packed_size(in_8_bits(config.format), config.width, config.height));
  level_of_.resize(65536);
}

JpegEncoder::~JpegEncoder() = default;

void JpegEncoder::set_levels(const blend::LinearScale& scale) {
  if (scale.shown_from == shown_from_) return;  // the usual case: exposures did not change
  shown_from_ = scale.shown_from;
  std::size_t number = 0;
  for (std::size_t level = 0; level < 256; ++level) {
    const std::size_t end = level < 255 ? std::max<std::size_t>(number, shown_from_[level + 1]) : level_of_.size();
    std::fill(level_of_.begin() + static_cast<std::ptrdiff_t>(number),
              level_of_.begin() + static_cast<std::ptrdiff_t>(end), static_cast<std::uint8_t>(level));
    number = end;
  }
}

ImageView JpegEncoder::shown(const ImageView& raymap, const RaymapInfo& info) {
  if (!is_linear16(raymap.format)) return raymap;
  if (info.linear) set_levels(*info.linear);
  const PixelFormat in_8 = in_8_bits(raymap.format);
  const MutableImageView picture = packed_image(in_8, raymap.width, raymap.height, picture_.data());
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(in_8)); ++c) {
    const PlaneView& from = raymap.planes[c];
    const MutablePlaneView& to = picture.planes[c];
    for (int y = 0; y < to.height; ++y) {
      const std::uint8_t* in = from.data + y * from.row_stride;
      std::uint8_t* out = to.data + y * to.row_stride;
      for (int x = 0; x < to.width; ++x, in += from.pixel_stride, out += to.pixel_stride) {
        *out = level_of_[static_cast<std::size_t>(in[0] | in[1] << 8)];
      }
    }
  }
  return packed_image(in_8, raymap.width, raymap.height, std::as_const(picture_).data());
}

Status JpegEncoder::encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into) {
  NODAL_ASSERT(raymap.format == config_.format && raymap.width == config_.width && raymap.height == config_.height);
  return writer_->write(shown(raymap, info), RaymapComment(info).text(), into);
}

}  // namespace nodal::firmware
