#include "firmware/record/head_coder.h"

#include <algorithm>

#include "protocol/base/field.h"
#include "protocol/base/try.h"
#include "stitch/decode/frame_decoder.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/ut_video.h"

namespace nodal::firmware {
namespace {

/// The fields of a frame, the one exposed first comes first. FFmpeg knows from the file's FieldOrder which rows the
/// first one has.
std::vector<FieldParity> parities_of(Fields fields) {
  switch (fields) {
    case Fields::kProgressive: return {};
    case Fields::kTopFirst: return {FieldParity::kTop, FieldParity::kBottom};
    case Fields::kBottomFirst: return {FieldParity::kBottom, FieldParity::kTop};
    case Fields::kTopOnly: return {FieldParity::kTop};
    case Fields::kBottomOnly: return {FieldParity::kBottom};
  }
  return {};
}

bool becomes_jpeg(const take::Stream& delivered) {
  if (!media::JpegWriter::writes(delivered.format)) return false;
  if (delivered.fields == Fields::kProgressive) return true;
  // Both fields must have the same rows, of chroma, too.
  const bool halved = delivered.format == PixelFormat::kI420 || delivered.format == PixelFormat::kNv12;
  return delivered.height % (halved ? 4 : 2) == 0;
}

}  // namespace

std::string_view mode_name(TakeMode mode) {
  constexpr std::array<std::string_view, 4> kNames = {"driver", "raw", "jpeg", "lossless"};
  return kNames[static_cast<std::size_t>(mode)];
}

std::string mode_names(std::span<const HeadConfig> heads) {
  std::string names;
  for (const TakeMode mode : {TakeMode::kDriver, TakeMode::kRaw, TakeMode::kJpeg, TakeMode::kLossless}) {
    if (std::ranges::count(heads, mode, &HeadConfig::take_mode) == 0) continue;
    names += (names.empty() ? "" : ", ") + std::string(mode_name(mode));
  }
  return names;
}

take::Stream stored_stream(take::Stream delivered, TakeMode mode, PixelFormat raymap) {
  take::Stream stored = delivered;
  switch (mode) {
    case TakeMode::kDriver: break;
    case TakeMode::kRaw:
      if (delivered.format != PixelFormat::kMjpeg) break;
      stored.format = blended_format(PixelFormat::kMjpeg, raymap).value_or(PixelFormat::kI420);
      stored.coding = {};
      break;
    case TakeMode::kJpeg:
      if (becomes_jpeg(delivered)) stored.format = PixelFormat::kMjpeg;
      break;
    case TakeMode::kLossless:
      stored.lossless = media::ut_video_codes(delivered.format, delivered.width, delivered.height);
      break;
  }
  return stored;
}

HeadCoder::HeadCoder(const take::Stream& delivered, const take::Stream& stored)
    : parities_(parities_of(delivered.fields)) {
  if (stored.lossless) {
    lossless_ = std::make_unique<media::UtVideoEncoder>();
    return;
  }
  if (stored.format != PixelFormat::kMjpeg) {
    raw_ = std::make_unique<decode::FrameDecoder>(delivered.format, stored.format, stored.width, stored.height);
    return;
  }
  media::JpegSpec spec{.format = delivered.format, .width = delivered.width, .height = delivered.height};
  if (parities_.empty()) fields_[0].writer = std::make_unique<media::JpegWriter>(spec);
  spec.height /= 2;
  for (std::size_t k = 0; k < parities_.size(); ++k) {
    spec.field = parities_[k];
    fields_[k].writer = std::make_unique<media::JpegWriter>(spec);
  }
}

HeadCoder::HeadCoder(HeadCoder&& other) noexcept = default;
HeadCoder::~HeadCoder() = default;

Result<HeadCoder::Parts> HeadCoder::code(const ImageView& picture, int quality) {
  Parts parts;
  if (lossless_) {
    lossless_->encode(picture, fields_[0].bytes);
    parts[0] = fields_[0].bytes;
    return parts;
  }
  if (raw_) {
    ImageView decoded;
    const decode::DecodeFault fault = raw_->decode(picture, decoded);
    if (fault != decode::DecodeFault::kNone)
      return fail(Errc::kBadFormat, "its pictures " + std::string(decode::decode_fault_text(fault)));
    parts[0] = {decoded.planes[0].data, packed_size(decoded.format, decoded.width, decoded.height)};
    return parts;
  }
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    Field& field = fields_[k];
    if (!field.writer) continue;
    field.writer->set_quality(quality);
    const ImageView rows = parities_.empty() ? picture : field_of(picture, parities_[k]);
    NODAL_TRY(field.writer->write(rows, "", field.bytes));
    parts[k] = field.bytes;
  }
  return parts;
}

}  // namespace nodal::firmware
