#include "firmware/record/head_coder.h"

#include "protocol/base/field.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/ut_video.h"

namespace nodal::firmware {
namespace {

/// The fields of a frame. The top field comes first, whichever was exposed first: FFmpeg takes the first JPEG of a block for the top
/// field, and the file's FieldOrder says which was exposed first.
std::vector<FieldParity> parities_of(Fields fields) {
  switch (fields) {
    case Fields::kProgressive: return {};
    case Fields::kTopFirst:
    case Fields::kBottomFirst: return {FieldParity::kTop, FieldParity::kBottom};
    case Fields::kTopOnly: return {FieldParity::kTop};
    case Fields::kBottomOnly: return {FieldParity::kBottom};
  }
  return {};
}

}  // namespace

std::string_view mode_name(TakesConfig::Mode mode) {
  constexpr std::array<std::string_view, 3> kNames = {"driver", "jpeg", "lossless"};
  return kNames[static_cast<std::size_t>(mode)];
}

HeadCoder::HeadCoder(const HeadStream& delivered, Mode mode) : parities_(parities_of(delivered.fields)) {
  if (mode == Mode::kLossless) {
    lossless_ = std::make_unique<media::UtVideoEncoder>();
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

bool HeadCoder::codes(const HeadStream& delivered, Mode mode) {
  if (mode == Mode::kDriver) return false;
  if (mode == Mode::kLossless) return media::ut_video_codes(delivered.format, delivered.width, delivered.height);
  if (!media::JpegWriter::writes(delivered.format)) return false;
  if (delivered.fields == Fields::kProgressive) return true;
  // Both fields must have the same rows, of chroma, too.
  const bool halved = delivered.format == PixelFormat::kI420 || delivered.format == PixelFormat::kNv12;
  return delivered.height % (halved ? 4 : 2) == 0;
}

Result<HeadCoder::Parts> HeadCoder::encode(const ImageView& picture, int quality) {
  Parts parts;
  if (lossless_) {
    lossless_->encode(picture, fields_[0].bytes);
    parts[0] = fields_[0].bytes;
    return parts;
  }
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    Field& field = fields_[k];
    if (!field.writer) continue;
    field.writer->set_quality(quality);
    const ImageView rows = parities_.empty() ? picture : field_of(picture, parities_[k]);
    if (const Status written = field.writer->write(rows, "", field.bytes); !written) return fail(written.error());
    parts[k] = field.bytes;
  }
  return parts;
}

}  // namespace nodal::firmware
