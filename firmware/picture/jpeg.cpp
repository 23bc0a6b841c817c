#include "firmware/picture/jpeg.h"

#include <cstdarg>
#include <cstdio>
#include <string>

#include "stitch/media/gpano.h"
#include "stitch/media/jpeg_writer.h"

namespace nodal::firmware {

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
  const std::string xmp = media::raymap_packet(config.layout, config.width, config.height);
  writer_ = std::make_unique<media::JpegWriter>(
      media::JpegSpec{in_8_bits(config.format), config.width, config.height, config.jpeg_quality, xmp});
}

JpegEncoder::~JpegEncoder() = default;

Status JpegEncoder::encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into) {
  NODAL_ASSERT(raymap.format == config_.format && raymap.width == config_.width && raymap.height == config_.height);
  return writer_->write(shown_.in_8_bits(raymap, info.linear), RaymapComment(info).text(), into);
}

}  // namespace nodal::firmware
